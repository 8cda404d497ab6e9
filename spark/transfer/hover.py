"""Feet that hover while they stand come down to the floor, as far as recordings err.

The floor of a recording is where its feet are lowest, and many stand some centimetres higher: for a
heel or a marker that dips, or a floor that is not level. What stands touches the floor. So of the
height of a sole in a stance, what is more than that of one that touches is taken off; all of it of
a foot that hovers, nothing of one as high as on a step. A foot that swings is lowered by what its
footprints before and after are (`spark.transfer.footfalls`), so that its swing survives.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from spark.transfer.footfalls import between_contacts

# [hip heights] Of a sole over the floor. One that is lower touches it: within 3.6 cm of an adult,
# feet are recorded no better. One that is higher than a step's least height stands on a step.
_TOUCHES = 0.04
_STEP = 0.1


def put_down(
    low: Float[np.ndarray, "L T"],
    stands: Bool[np.ndarray, "L T"],
    paths: Sequence[Float[np.ndarray, "T 2"]],
) -> Float[np.ndarray, "L T"]:
    """How far each foot is to come down [hip heights], by how high its sole is over the floor, when
    it stands, and the ways over the ground on which it swings."""
    higher = np.maximum(low - _TOUCHES, 0.0)
    hovers = np.clip(2.0 * (_STEP - low) / (_STEP - _TOUCHES), 0.0, 1.0)
    down = [
        between_contacts(own[:, None], here, path)[:, 0]
        for own, here, path in zip(higher * hovers, stands, paths, strict=True)
    ]
    return np.stack(down)
