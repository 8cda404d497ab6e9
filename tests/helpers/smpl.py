"""Motions as files of the SMPL family hold them, made from any motion: rotations since the model's
rest pose, as rotation vectors, and where the model's origin is."""

from functools import cache
from typing import Any

import numpy as np

from spark.io.smpl_body import mean_body
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig, understand
from spark.rotation import quat_from_matrix, quat_identity, quat_mul, rotvec_from_quat
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical, to_canonical

TALL = 1.70  # [m] the mean body of a file that tells no height

# The model's axes x left, y up, z forward from ours (x forward, y left, z up).
TO_MODEL = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])


@cache
def model_rig(count: int, height: float) -> Rig:
    """The mean body as a rig in our axes."""
    skeleton = mean_body(count, height).skeleton
    turned = type(skeleton)(
        skeleton.names,
        skeleton.parents,
        skeleton.offsets @ TO_MODEL,
        skeleton.translating,
        skeleton.end_parents,
        skeleton.end_offsets @ TO_MODEL,
    )
    rest = quat_identity(turned.offsets)[None]
    return understand(Motion(turned, 1.0, np.array([[0.0, 0, height / 2]]), rest))


def as_smpl(
    motion: Motion, rig: Rig, *, count: int = 52, height: float = 1.74, up: str = "z"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotation vectors (T J 3), positions (T 3) of the model's origin and, in our axes, where its
    joints are (T J 3), for a person of that height. `up` is the axis of the file that points up."""
    body = model_rig(count, height)
    moved = from_canonical(transfer(to_canonical(motion, rig), body))
    # Rotations seen in the model's axes; the root's turns them into the file's world.
    to_model = np.broadcast_to(quat_from_matrix(TO_MODEL), moved.rotations.shape)
    back = to_model * np.array([1.0, -1, -1, -1])
    rotations = quat_mul(quat_mul(to_model, moved.rotations), back)
    pos = moved.root_pos @ TO_MODEL.T
    if up == "z":
        rotations[:, 0] = quat_mul(back[:, 0], rotations[:, 0])
        pos = moved.root_pos
    joints, _ = forward(moved)
    return rotvec_from_quat(rotations), pos - mean_body(count, height).pelvis, joints


def made(
    motion: Motion, *, count: int = 52, height: float = TALL, up: str = "z"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return as_smpl(motion, understand(motion), count=count, height=height, up=up)


def in_layout(layout: str, rotvecs: np.ndarray, trans: np.ndarray) -> dict[str, Any] | np.ndarray:
    """The first 22 joints of a motion as files have them; fingers are straight."""
    count = len(rotvecs)
    body = rotvecs[:, :22]
    flat = body.reshape(count, -1)
    none = np.zeros((count, 90))
    match layout:
        case "AMASS, SMPL-H":
            poses = np.concatenate([flat, none], axis=1)
            return {"poses": poses, "trans": trans, "betas": np.zeros(16), "gender": "neutral",
                    "mocap_framerate": 30.0, "dmpls": np.zeros((count, 8))}  # fmt: skip
        case "AMASS, SMPL-X":
            return {"root_orient": flat[:, :3], "pose_body": flat[:, 3:], "pose_hand": none,
                    "pose_jaw": none[:, :3], "pose_eye": none[:, :6], "trans": trans,
                    "betas": np.zeros(16), "gender": np.array(b"neutral"), "num_betas": 16,
                    "mocap_frame_rate": np.array(30.0), "surface_model_type": "smplx",
                    "poses": np.concatenate([flat, none[:, :9], none], axis=1)}  # fmt: skip
        case "parts alone":
            return {"root_orient": flat[:, :3], "pose_body": flat[:, 3:], "trans": trans,
                    "mocap_frame_rate": 30}  # fmt: skip
        case "SMPL":
            return {"global_orient": flat[:, None, :3], "transl": trans, "fps": 30,
                    "body_pose": np.concatenate([flat[:, 3:], none[:, :6]], axis=1)}  # fmt: skip
        case "smplx":
            return {"global_orient": flat[:, :3], "body_pose": flat[:, 3:].reshape(count, 21, 3),
                    "left_hand_pose": none[:, :45], "right_hand_pose": none[:, :45],
                    "transl": trans, "betas": np.zeros((1, 10)), "fps": 30}  # fmt: skip
        case "PHUMA":
            return np.concatenate([trans, flat], axis=1)
        case "PHUMA, preprocessed":
            return np.concatenate([trans, flat, none[:, :4]], axis=1)
        case "Motion-X":
            return np.concatenate([flat, none, np.full((count, 3 + 50 + 100), 0.1), trans,
                                   np.zeros((count, 10))], axis=1)  # fmt: skip
    raise AssertionError(layout)


LAYOUTS = {
    "AMASS, SMPL-H": ("z", 52),
    "AMASS, SMPL-X": ("z", 55),
    "parts alone": ("z", 22),
    "SMPL": ("y", 24),
    "smplx": ("y", 55),
    "PHUMA": ("y", 22),
    "PHUMA, preprocessed": ("y", 22),
    "Motion-X": ("y", 55),
}
