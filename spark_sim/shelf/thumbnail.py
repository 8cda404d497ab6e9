"""A motion as a small drawing: five moments of a stick figure, side by side, in few bytes, so that
a page can hold those of a hundred thousand. The page's script draws them."""

import base64
from typing import Any, Final

import numpy as np

from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_from_yaw, quat_mul, quat_rotate, yaw_from_quat

WIDTH, HEIGHT, FOOT = 200, 72, 4  # [pixels]; FOOT is from the lower edge to the floor
MOMENTS = 5
UNIT, LEFT, BELOW = 0.4, -51.2, -15.0  # [pixels] of a byte; from a figure's middle, from the floor
LAYOUT: Final = {
    "width": WIDTH,
    "height": HEIGHT,
    "foot": FOOT,
    "moments": MOMENTS,
    "unit": UNIT,
    "left": LEFT,
    "below": BELOW,
}
"""What a script must know to draw."""
_VIEW = np.radians(50.0)  # the camera stands ahead of the body, and so far to its right
_TALL = 1.15  # standing heights that the picture shows


def thumbnail(motion: Motion, rig: Rig, floor_z: float, at: int, *, marked: bool) -> dict[str, Any]:
    """The drawing: `bones`, pairs of points; the `points` of all figures, as base64; and which of
    the figures is the `worst`, None where there is nothing bad.

    The moment nearest to frame `at` is that frame, and the worst where it is `marked`. Each figure
    stands over the same floor, seen from the same side of it.
    """
    frames = np.linspace(0, len(motion) - 1, MOMENTS).round().astype(int)
    chosen = int(np.abs(frames - at).argmin())
    frames[chosen] = at
    positions, rotations = forward(_picked(motion, frames))
    pelvis = quat_mul(rotations[:, rig.pelvis], quat_conj(rig.tpose[rig.pelvis]))
    view = quat_from_yaw(_VIEW - yaw_from_quat(pelvis))[:, None]
    seen = quat_rotate(view, positions - positions[:, rig.hips].mean(axis=1)[:, None])
    scale = (HEIGHT - FOOT) / (_TALL * rig.standing_height)
    joints, bones = _bones(rig)
    pixels = np.stack([seen[:, joints, 1], positions[:, joints, 2] - floor_z], axis=-1) * scale
    points = np.clip(np.round((pixels - [LEFT, BELOW]) / UNIT), 0, 255).astype(np.uint8)
    return {
        "bones": bones,
        "points": base64.b64encode(points.tobytes()).decode(),
        "worst": chosen if marked else None,
    }


def _picked(motion: Motion, frames: np.ndarray) -> Motion:
    moved = motion.translations
    return Motion(
        motion.skeleton,
        motion.frame_time,
        motion.root_pos[frames],
        motion.rotations[frames],
        None if moved is None else moved[frames],
    )


def _bones(rig: Rig) -> tuple[list[int], list[list[int]]]:
    """The joints with a role, and a line from each to the next one above it that has one, by their
    places in that list."""
    joints = [*rig.roles.held]
    place = {joint: k for k, joint in enumerate(joints)}
    above = [rig.skeleton.above(joint, place) for joint in joints]
    return joints, [[place[j], k] for k, j in enumerate(above) if j >= 0]
