"""What the network reads: windows of motion on one body, as arrays."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from spark.network.features import BodyFeatures


class Windows(NamedTuple):
    """W windows of T frames on one body: local 6D rotations, root."""

    body: BodyFeatures
    rotations: Float[np.ndarray, "W T K 6"]
    root: Float[np.ndarray, "W T 3"]
