"""Motions as files of the SMPL family hold them, made from any motion: rotations since the model's
rest pose, as rotation vectors, and where the model's origin is."""

from functools import cache

import numpy as np

from spark.io.smpl_body import mean_body
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig, understand
from spark.rotation import quat_from_matrix, quat_identity, quat_mul, rotvec_from_quat
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical, to_canonical

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
