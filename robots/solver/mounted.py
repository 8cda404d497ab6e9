"""Robots without legs: the base stays where it is mounted, and the rest follows in its heading."""

from dataclasses import replace

import numpy as np

from robots.model.morphology import Morphology
from robots.tree import Coordinates
from spark.rotation import quat_from_yaw, quat_mul, quat_rotate
from spark.transfer.canonical import CanonicalMotion


def facing_ahead(source: CanonicalMotion) -> CanonicalMotion:
    """The same with the hips' heading and path taken out: a body that does not turn or go."""
    w, _, _, z = source.rotations[:, source.rig.pelvis].T
    back = quat_from_yaw(-2 * np.unwrap(np.arctan2(z, w), period=np.pi))
    hips = source.hips * np.array([0.0, 0.0, 1.0])
    return replace(
        source, rotations=quat_mul(back[:, None], source.rotations), hips=quat_rotate(back, hips)
    )


def on_mount(robot: Morphology, q: Coordinates) -> Coordinates:
    """`q` with the base where the robot is mounted; as it is for one with legs."""
    mount = robot.mount
    if mount is None:
        return q
    return replace(
        q, pos=np.repeat(mount.pos, len(q), axis=0), quat=np.repeat(mount.quat, len(q), axis=0)
    )
