"""A motion as a small drawing: five moments of a stick figure, side by side, as inline SVG."""

import numpy as np
from jaxtyping import Float

from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_from_yaw, quat_mul, quat_rotate, yaw_from_quat

WIDTH, HEIGHT = 200, 72
_MOMENTS = 5
_VIEW = np.radians(50.0)  # the camera stands ahead of the body, and so far to its right
_TALL = 1.15  # standing heights that the picture shows


def thumbnail(motion: Motion, rig: Rig, floor_z: float, at: int, *, marked: bool) -> str:
    """The drawing. The moment nearest to frame `at` is that frame, and in the colour of what is bad
    where it is `marked`. Each figure stands over the same floor, seen from the same side of it."""
    frames = np.linspace(0, len(motion) - 1, _MOMENTS).round().astype(int)
    chosen = int(np.abs(frames - at).argmin())
    frames[chosen] = at
    picked = _picked(motion, frames)
    positions, rotations = forward(picked)
    pelvis = quat_mul(rotations[:, rig.pelvis], quat_conj(rig.tpose[rig.pelvis]))
    view = quat_from_yaw(_VIEW - yaw_from_quat(pelvis))[:, None]
    seen = quat_rotate(view, positions - positions[:, rig.hips].mean(axis=1)[:, None])
    scale = HEIGHT / (_TALL * rig.standing_height)
    up = (positions[..., 2] - floor_z) * scale
    step = WIDTH / _MOMENTS
    lines = []
    for k in range(_MOMENTS):
        x, y = step * (k + 0.5) + seen[k, :, 1] * scale, HEIGHT - 4 - up[k]
        kind = "worst" if marked and k == chosen else "pose"
        lines.append(f'<path class="{kind}" d="{_bones(rig, x, y)}"/>')
    floor = f'<path class="floor" d="M0 {HEIGHT - 4}H{WIDTH}"/>'
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img">{floor}{"".join(lines)}</svg>'


def _picked(motion: Motion, frames: np.ndarray) -> Motion:
    moved = motion.translations
    return Motion(
        motion.skeleton,
        motion.frame_time,
        motion.root_pos[frames],
        motion.rotations[frames],
        None if moved is None else moved[frames],
    )


def _bones(rig: Rig, x: Float[np.ndarray, "J"], y: Float[np.ndarray, "J"]) -> str:
    """A line from each joint with a role to the next one above it that has one."""
    roles, parents = rig.roles.roles, rig.skeleton.parents.tolist()
    parts = []
    for joint, role in enumerate(roles):
        above = parents[joint] if role is not None else -1
        while above >= 0 and roles[above] is None:
            above = parents[above]
        if above >= 0:
            ends = (x[above], y[above], x[joint], y[joint])
            a, b, c, d = (f"{value:.1f}" for value in ends)
            parts.append(f"M{a} {b}L{c} {d}")
    return "".join(parts)
