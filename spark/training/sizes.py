"""What batches are padded to, so that all have one shape and one compiled graph does."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from spark.network.features import BodyFeatures
from spark.training.variants import most_joints

_UNMATCHED = ("spine", "neck", "head", "clavicle")  # parts that a source may lack


class Sizes(NamedTuple):
    """The least that a batch's axes have."""

    joints: int = 1  # of a body
    group: int = 1  # joints of a body part
    corrected: int = 1  # joints that a residual network decodes


def sizes_of(bodies: Iterable[BodyFeatures]) -> Sizes:
    """What holds these bodies as they are."""
    bodies = list(bodies)
    return Sizes(
        max(len(body.joints) for body in bodies),
        max(len(group) for body in bodies for group in body.groups),
    )


def sizes_of_variants(bodies: Sequence[BodyFeatures]) -> Sizes:
    """What holds variants of these bodies, and the joints that may be unmatched on the bodies."""
    return Sizes(
        max(most_joints(body, range(len(body.joints))) for body in bodies),
        max(most_joints(body, group) for body in bodies for group in body.groups),
        max(sum(part in _UNMATCHED for part in body.parts) for body in bodies),
    )
