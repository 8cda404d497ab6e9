"""What `retarget` does to a transfer: all that touches the ground, and then the hips."""

from spark.transfer.canonical import CanonicalMotion
from spark.transfer.foot_lock import lock_feet
from spark.transfer.hip_sway import sway_hips
from spark.transfer.noise import Noise
from spark.transfer.over_floor import over_floor


def grounded(
    source: CanonicalMotion, moved: CanonicalMotion, noise: Noise | None = None
) -> CanonicalMotion:
    """`moved`, the transfer of `source`, with its feet held where the source's stand, and nothing
    else in the floor. `noise` is what was taken from the source."""
    return over_floor(source, lock_feet(source, moved, noise))


def refined(
    source: CanonicalMotion, moved: CanonicalMotion, noise: Noise | None = None
) -> CanonicalMotion:
    """The same with hips that sway so that its weight moves as the source's does: for a transfer
    with fitted legs."""
    return sway_hips(source, grounded(source, moved, noise))
