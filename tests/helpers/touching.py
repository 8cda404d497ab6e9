"""A sample rig that stands with its wrists where one says."""

import numpy as np

from spark.demo.sample import sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_between
from spark.transfer.canonical import CanonicalMotion

FRAME_TIME = 1 / 30
SIDES = {"left": 1.0, "right": -1.0}
HANDS_ON_HIPS = [0.01, 0.085, 0.04]


def standing(wrists: np.ndarray) -> CanonicalMotion:
    """Who stands, with the left wrist where `wrists` (T, 3) says from the left hip, in standing
    heights, the hand as the forearm, the elbow out; the right one mirrors it."""
    rig = sample_rig("walker")
    rotations = np.tile([1.0, 0, 0, 0], (len(wrists), len(rig.skeleton), 1))
    places = rig.tpose_positions
    for side, y in SIDES.items():
        hip, shoulder, elbow, wrist = (
            rig.roles.require(Role(f"{side}_{part}"))
            for part in ("upper_leg", "upper_arm", "forearm", "hand")
        )
        upper, lower = (
            float(np.linalg.norm(places[b] - places[a]))
            for a, b in ((shoulder, elbow), (elbow, wrist))
        )
        for t, there in enumerate(wrists * rig.standing_height * [1.0, y, 1.0]):
            reach = places[hip] + there - places[shoulder]
            far = min(float(np.linalg.norm(reach)), 0.999 * (upper + lower))
            ahead = reach / np.linalg.norm(reach)
            out = np.array([0.0, y, 0.0]) - y * ahead[1] * ahead
            along = (far**2 + upper**2 - lower**2) / (2 * far)
            bend = np.sqrt(max(upper**2 - along**2, 0.0))
            bent = along * ahead + bend * out / np.linalg.norm(out)
            for joint, way in ((shoulder, bent), (elbow, far * ahead - bent)):
                turn = quat_between(np.array([0.0, y, 0.0]), way / np.linalg.norm(way))
                rotations[t, list(rig.skeleton.subtree(joint))] = turn
    hips = np.tile([0.0, 0.0, rig.hip_height], (len(wrists), 1))
    return CanonicalMotion(rig, FRAME_TIME, rotations, hips, 0.0)


def still(place: list[float], frames: int = 60) -> CanonicalMotion:
    return standing(np.tile(place, (frames, 1)))
