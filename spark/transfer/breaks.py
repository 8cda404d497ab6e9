"""Where a recording is broken: its body turns or moves as none can from one frame to the next.

Fitted and converted recordings flip by half a turn, or jump, within a few frames. What is made of
them follows; so whoever retargets one is told.
"""

import numpy as np
from jaxtyping import Bool, Float

from spark.rotation import quat_angle
from spark.runs import true_runs

# Dancers turn by up to 17 rad/s, skaters in a spin by 36, flips in recordings by 27 to 120.
# Sprinters run at 12.4 m/s.
MAX_TURN = 25.0  # [rad/s]
MAX_SPEED = 15.0  # [m/s]
_SPAN = 1 / 60  # [s] at least that both are measured over: noise of a fast recording is none
_APART = 0.5  # [s] between breaks that are not one


def breaks(
    pelvis: Float[np.ndarray, "T 4"], hips: Float[np.ndarray, "T 3"], frame_time: float
) -> tuple[str, ...]:
    """Sentences on where the pelvis turns faster than bodies do, and where the hips [m] move so;
    none for a motion in which neither does."""
    reach = _reach(frame_time)
    turned, moved = _ways(pelvis, hips, reach)
    span = reach * frame_time
    return (
        *_said(turned > MAX_TURN * span, np.degrees(turned), "turn by {:.0f}°", reach, frame_time),
        *_said(moved > MAX_SPEED * span, moved, "move by {:.2f} m", reach, frame_time),
    )


def anew(
    pelvis: Float[np.ndarray, "T 4"], hips: Float[np.ndarray, "T 3"], frame_time: float
) -> list[int]:
    """The first frame after each break."""
    reach = _reach(frame_time)
    turned, moved = _ways(pelvis, hips, reach)
    span = reach * frame_time
    broken = (turned > MAX_TURN * span) | (moved > MAX_SPEED * span)
    return [stop for _, stop in true_runs(broken, gap=round(_APART / frame_time))]


def _reach(frame_time: float) -> int:
    """How many frames apart poses are compared."""
    return max(1, round(_SPAN / frame_time))


def _ways(
    pelvis: Float[np.ndarray, "T 4"], hips: Float[np.ndarray, "T 3"], reach: int
) -> tuple[Float[np.ndarray, "N"], Float[np.ndarray, "N"]]:
    """How far the pelvis turns [rad] and the hips move [m] from each frame to the one `reach`
    after it."""
    turned = quat_angle(pelvis[:-reach], pelvis[reach:])
    return turned, np.linalg.norm(hips[reach:] - hips[:-reach], axis=1)


def _said(
    broken: Bool[np.ndarray, "T"],
    way: Float[np.ndarray, "T"],
    what: str,
    reach: int,
    frame_time: float,
) -> tuple[str, ...]:
    found = true_runs(broken, gap=round(_APART / frame_time))
    if not found:
        return ()
    start, stop = found[0]
    worst = start + int(way[start:stop].argmax())
    times = "" if len(found) == 1 else f", the first of {len(found)} times"
    return (
        f"the hips {what.format(way[worst])} within {reach * frame_time:.3f} s at "
        f"{worst * frame_time:.2f} s{times}: faster than bodies do; is the recording broken there?",
    )
