"""Whether a network has met what a table counts as unseen.

Cells are the dataset's. A network that was trained on another one, or before more files changed the
draw, may have seen characters that are held out now.
"""

from collections.abc import Sequence

from spark.inference.weights import Trunk
from spark.network.known_bodies import is_known
from spark.training.dataset import Performance


def met_unseen(found: Sequence[Performance], trunks: Sequence[Trunk]) -> list[str]:
    """The characters of the cells of unseen ones that have a body of a training (its `trunks`)."""
    unseen = {one.character: one.clip.body for one in found if one.cell.startswith("uc")}
    return sorted(name for name, body in unseen.items() if is_known(body, trunks))
