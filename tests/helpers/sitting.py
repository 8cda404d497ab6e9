"""A body that sits down on what nobody recorded, sits, and stands up."""

from dataclasses import replace

import numpy as np

from spark.demo.sample import sample_rig
from spark.rig.roles import LIMBS, Group
from spark.rotation import quat_from_rotvec
from spark.transfer.canonical import CanonicalMotion, canonical_positions

FRAME_TIME = 1 / 30
RIG = sample_rig("walker")
SITS = slice(60, 150)  # the frames in which it does
_KEYS = (0, 30, 60, 150, 180, 210)  # frames: it stands, sits down, sits, stands up


def sitting(knees: float = 85.0, lean: float = 0.0) -> CanonicalMotion:
    """Its thighs are raised by so much [degrees] over feet that stay, its trunk leans ahead."""
    share = np.interp(np.arange(_KEYS[-1]), _KEYS, (0, 0, 1, 1, 0, 0))
    share = (share**2 * (3 - 2 * share))[:, None]
    names = RIG.skeleton.names

    def pitched(degrees: float) -> np.ndarray:
        return quat_from_rotvec(np.radians(degrees) * share * np.array([[0.0, 1.0, 0.0]]))

    rotations = np.tile(pitched(lean)[:, None], (1, len(names), 1))
    for group in (Group.LEFT_LEG, Group.RIGHT_LEG):
        thigh, shank, foot = (RIG.roles.require(role) for role in LIMBS[group][:3])
        for top, degrees in ((thigh, -knees), (shank, 0.0), (foot, 0.0)):
            below = [j for j in range(len(names)) if top in RIG.skeleton.ancestors(j)]
            rotations[:, below] = pitched(degrees)[:, None]
    still = CanonicalMotion(RIG, FRAME_TIME, rotations, np.zeros((_KEYS[-1], 3)))
    feet = canonical_positions(still, RIG.contact_joints).mean(axis=1)
    hips = np.array([0.0, 0.0, RIG.hip_height]) + feet[0] - feet
    return replace(still, hips=hips)
