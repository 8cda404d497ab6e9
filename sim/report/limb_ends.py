"""Where the limbs of a body end."""

import numpy as np
from jaxtyping import Float

from sim.report.clip_poses import ClipPoses
from spark.kinematics import end_positions
from spark.rig.roles import Role

_JOINTS = {
    "left hand": Role.LEFT_HAND,
    "right hand": Role.RIGHT_HAND,
    "left elbow": Role.LEFT_FOREARM,
    "right elbow": Role.RIGHT_FOREARM,
    "left foot": Role.LEFT_FOOT,
    "right foot": Role.RIGHT_FOOT,
    "head": Role.HEAD,
}


def limb_ends(poses: ClipPoses) -> tuple[tuple[str, ...], Float[np.ndarray, "T L 3"]]:
    """The wrists, elbows, ankles and head that the rig has: names and places [m, world].

    Of a forearm without a wrist, as many robots have, the End Site is the hand.
    """
    skeleton, places = poses.rig.skeleton, dict[str, Float[np.ndarray, "T 3"]]()
    ends = end_positions(skeleton, poses.positions, poses.rotations)
    of = {parent: k for k, parent in enumerate(skeleton.end_parents.tolist())}
    for name, role in _JOINTS.items():
        joint = poses.rig.roles.joint(role)
        elbow = None if "hand" not in name else poses.rig.roles.joint(_JOINTS[_elbow(name)])
        if joint is not None:
            places[name] = poses.positions[:, joint]
        elif elbow in of:
            places[name] = ends[:, of[elbow]]
    return tuple(places), np.stack([np.zeros((len(poses), 3)), *places.values()], axis=1)[:, 1:]


def _elbow(hand: str) -> str:
    return hand.replace("hand", "elbow")
