"""Recordings of the SMPL family: AMASS's npz, GVHMR's pt, Motion-X's and PHUMA's npy.

The files hold rotations since the model's rest pose, a T-pose, and where the model's origin
is; the bones' lengths come from a model file that the user has, or else from a mean skeleton of our
own, scaled by what the file tells.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from spark.io.arrays import read_npy, read_npz
from spark.io.convention import UPS, Up, axis_of, given_up, points_down
from spark.io.foreign import foreign_recording
from spark.io.recording import Recording
from spark.io.smpl_body import Body, mean_body, read_body_model
from spark.io.smpl_columns import from_array
from spark.io.smpl_layouts import from_npz, from_tensors
from spark.io.smpl_motion import SmplMotion
from spark.io.stance import stance_scale, walked
from spark.io.up_inference import standing_axis
from spark.kinematics import end_positions, forward
from spark.motion import Motion
from spark.rotation import quat_conj, quat_from_matrix, quat_from_rotvec, quat_mul

# [m] Mean heights of the people that the family's shapes were learned from (CAESAR), by gender.
_HEIGHTS = {"male": 1.77, "female": 1.64}
_NEUTRAL = 1.70

# [m] What SMPL-X's first shape adds to the height of 1.66 m (the rule of GMR, a retargeting tool).
_PER_BETA = 0.1
_BETA_ZERO = 1.66
_HEIGHT_RANGE = (1.3, 2.2)  # [m] of adults

_LOWEST = 5  # [%] of the frames' lowest points: the floor

_BALLS = ("left_foot", "right_foot")
_ANKLES = ("left_ankle", "right_ankle")


def read_smpl(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
    body_model: str | Path | None = None,
) -> Recording:
    """The recording in a file of the SMPL family.

    `body_model` is the user's own file of SMPL, SMPL-H or SMPL-X (.npz), for exact offsets. `fps`
    is the rate of files that say none. Raises `FileFormatError` where the file is none of the
    layouts, or broken.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".npz":
        said = from_npz(read_npz(path), path)
    elif suffix == ".npy":
        said = from_array(read_npy(path), path)
    else:
        said = from_tensors(path)
    count = said.rotvecs.shape[1]
    notes = [f"{said.origin}, {_hands(said)}", *said.notes]
    if fps is None and said.fps is None:
        notes.append(
            f"{said.usual_fps:g} fps, as is usual: the file says none; else give --fps (of "
            "retarget: --source-fps)"
        )
    if body_model is not None:
        body, what = read_body_model(Path(body_model), count, said.betas)
        notes.append(f"bones of {what}")
    else:
        height, why = _height(said)
        body = mean_body(count, height, smplx=said.smplx)
    frame_time = 1 / (fps or said.fps or said.usual_fps)
    motion = _motion(said, body, frame_time)
    if up is None:
        axis, downward, why_up = standing_axis(motion, said.usual_up)
    else:
        given = given_up(up)
        axis, downward, why_up = UPS[axis_of(given)], points_down(given), "as given"
    if body_model is None:
        scale = _scale(motion, UPS.index(axis))
        if scale is not None:
            height, why = height * scale, "so that planted feet stand still"
            motion = _motion(said, mean_body(count, height, smplx=said.smplx), frame_time)
        notes.append(
            f"a mean skeleton, {height:.2f} m tall {why}; --body-model SMPLX_NEUTRAL.npz (your own "
            "file) gives exact bones"
        )
    notes.append(f"metres, up axis {axis}, {why_up}")
    if downward:
        notes.append(f"the file's {axis} axis points down, as a camera's does: turned over")
        motion = _turned_over(motion, "z" if axis == "x" else "x")
    if said.trans is None:
        notes.append("no positions: the hips are moved so that the lower foot stands")
        motion = walked(motion, _joints(motion, _ANKLES + _BALLS), UPS.index(axis))
    else:
        notes.append(_floor(motion, UPS.index(axis)))
    return foreign_recording(path, _upright(motion, axis), notes, unit=unit or 1.0, up=axis)


def _motion(said: SmplMotion, body: Body, frame_time: float) -> Motion:
    """The motion in metres and the file's axes."""
    trans = np.zeros((len(said.rotvecs), 3)) if said.trans is None else said.trans
    return Motion(body.skeleton, frame_time, trans + body.pelvis, quat_from_rotvec(said.rotvecs))


def _turned_over(motion: Motion, about: Up) -> Motion:
    """Half a turn about an axis."""
    along = np.eye(3)[UPS.index(about)]
    half_turn = np.broadcast_to([0.0, *along], motion.rotations[:, :1].shape)
    root = quat_mul(half_turn, motion.rotations[:, :1])
    return replace(
        motion,
        root_pos=motion.root_pos * (2 * along - 1),
        rotations=np.concatenate([root, motion.rotations[:, 1:]], axis=1),
    )


def _upright(motion: Motion, up: Up) -> Motion:
    """The same motion with the rest pose standing along the file's `up`, as it does along the
    model's y: what the joints turn against is then the T-pose itself."""
    steps = UPS.index(up) - UPS.index("y")  # axes x, y, z become y, z, x with each
    axes = [(axis - steps) % 3 for axis in range(3)]
    turn = quat_from_matrix(np.eye(3)[axes])  # q_file_model
    rotations = motion.rotations[..., [0, *(1 + axis for axis in axes)]]
    rotations[:, 0] = quat_mul(
        motion.rotations[:, 0], np.broadcast_to(quat_conj(turn), (len(motion), 4))
    )
    skeleton = motion.skeleton
    skeleton = replace(
        skeleton,
        offsets=skeleton.offsets[:, axes],
        end_offsets=skeleton.end_offsets[:, axes],
    )
    return replace(motion, skeleton=skeleton, rotations=rotations)


def _joints(motion: Motion, names: tuple[str, ...]) -> list[int]:
    return [motion.skeleton.names.index(name) for name in names]


def _floor(motion: Motion, up: int) -> str:
    """Where the feet are lowest, in the file's heights."""
    positions, world = forward(motion)
    low = end_positions(motion.skeleton, positions, world)[..., up].min(axis=1)
    return f"floor {100 * np.percentile(low, _LOWEST):+.0f} cm from the file's zero, by the feet"


def _hands(said: SmplMotion) -> str:
    count = said.rotvecs.shape[1]
    if count < 52:
        return "without fingers"
    moves = np.ptp(said.rotvecs[:, count - 30 :], axis=0).any()
    if moves:
        return "fingers and all"
    return "fingers held still" if said.rotvecs[:, count - 30 :].any() else "fingers straight"


def _height(said: SmplMotion) -> tuple[float, str]:
    """The body's height [m] as the file tells it, and how."""
    if said.gender in _HEIGHTS:
        return _HEIGHTS[said.gender], f"(the mean of its gender, {said.gender})"
    known = f" (gender {said.gender})" if said.gender else ""
    if said.betas is not None and said.betas[0] != 0:
        tall = _BETA_ZERO + _PER_BETA * float(said.betas[0])
        return float(np.clip(tall, *_HEIGHT_RANGE)), f"by its first beta{known}"
    return _NEUTRAL, f"for want of a shape{known}"


def _scale(motion: Motion, up: int) -> float | None:
    positions, _ = forward(motion)
    level = [axis for axis in range(3) if axis != up]
    relative = (positions - motion.root_pos[:, None])[..., level]
    balls, ankles = (relative[:, _joints(motion, names)] for names in (_BALLS, _ANKLES))
    return stance_scale(balls, ankles, motion.root_pos[:, level], motion.frame_time)
