"""Where a recording is broken: its body turns or moves as none can from one frame to the next.

Fitted and converted recordings flip by half a turn, or jump, within a few frames. What is made of
them follows; so whoever retargets one is told.
"""

import numpy as np
from jaxtyping import Float

from spark.rotation import quat_angle
from spark.runs import true_runs
from spark.summary import counted

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
    reach = max(1, round(_SPAN / frame_time))
    turned = quat_angle(pelvis[:-reach], pelvis[reach:])
    moved = np.linalg.norm(hips[reach:] - hips[:-reach], axis=1)
    return (
        *_said(turned, MAX_TURN, reach * frame_time, frame_time, "turn by {:.0f}°", 180 / np.pi),
        *_said(moved, MAX_SPEED, reach * frame_time, frame_time, "move by {:.2f} m", 1.0),
    )


def _said(
    way: Float[np.ndarray, "T"],
    fastest: float,
    span: float,
    frame_time: float,
    what: str,
    unit: float,
) -> tuple[str, ...]:
    found = true_runs(way > fastest * span, gap=round(_APART / frame_time))
    if not found:
        return ()
    start, stop = found[0]
    worst = start + int(way[start:stop].argmax())
    times = "" if len(found) == 1 else f", the first of {counted(len(found), 'time')}"
    return (
        f"the hips {what.format(unit * way[worst])} within {span:.3f} s at {worst * frame_time:.2f}"
        f" s{times}: faster than bodies do; is the recording broken there?",
    )
