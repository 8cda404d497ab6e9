"""What a body says against the unit and the up axis that a user gave: a wrong one reads as well."""

from spark.io.convention import Up
from spark.io.unit_inference import HUMAN_HEIGHTS, stature
from spark.io.up_inference import stands_along
from spark.motion import Motion


def doubts(motion: Motion, *, unit_m: float | None = None, up: Up | None = None) -> tuple[str, ...]:
    """Notes on a given unit [m] and up axis that the body of `motion`, in file units and axes,
    contradicts. What is None was not given, and nothing is said of it."""
    found = []
    if unit_m is not None:
        tall = unit_m * stature(motion)[0]
        if tall > 0 and not HUMAN_HEIGHTS[0] < tall < HUMAN_HEIGHTS[1]:
            found.append(f"in the unit that is given the body is {tall:.3g} m: no human's height")
    if up is not None and (standing := stands_along(motion)) not in (up, None):
        found.append(
            f"up axis {up} is given, and the body stands along {standing}, in its motion and at "
            "rest: it lies in the result"
        )
    return tuple(found)
