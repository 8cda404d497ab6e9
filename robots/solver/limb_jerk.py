"""How jerky a source's limbs are: a robot's may be as much so as they need to strike as hard."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d

from robots.model.morphology import Morphology
from spark.resample import values_at
from spark.rig.roles import LIMBS, Group, Role

_INTERVAL = 0.05  # [s] over which directions are differenced: noise of single frames is no haste
JERK_WINDOW = 0.15  # [s] before and after a frame over which jerk is averaged
_GROUPS = (Group.LEFT_LEG, Group.RIGHT_LEG, Group.LEFT_ARM, Group.RIGHT_ARM)


def limb_jerks(
    bones: Mapping[Role, Float[np.ndarray, "T 3"]], frame_time: float
) -> Float[np.ndarray, "T 4"]:
    """The RMS, around each frame, of the angular jerk [rad/s³] of the left and the right leg and of
    the left and the right arm: of the segment of each that has most; 0 without one."""
    count = max(map(len, bones.values()), default=0)
    out = np.zeros((count, len(_GROUPS)))
    window = 2 * max(1, round(JERK_WINDOW / frame_time)) + 1
    for k, group in enumerate(_GROUPS):
        for bone in (bones[role] for role in LIMBS[group] if role in bones):
            squared = uniform_filter1d((_jerk(bone, frame_time) ** 2).sum(axis=1), window)
            out[:, k] = np.maximum(out[:, k], np.sqrt(np.maximum(squared, 0.0)))
    return out


def _jerk(values: Float[np.ndarray, "T 3"], frame_time: float) -> Float[np.ndarray, "T 3"]:
    """Third differences over `_INTERVAL`; near the ends those of the nearest whole one."""
    step = _INTERVAL / frame_time
    reach, last = 1.5 * step, len(values) - 1
    if last < 2 * reach:
        return np.zeros_like(values)
    at = np.clip(np.arange(last + 1), reach, last - reach)
    steps = zip((1.0, -3.0, 3.0, -1.0), (1.5, 0.5, -0.5, -1.5), strict=True)
    total = sum(weight * values_at(values, at + step * shift) for weight, shift in steps)
    return np.asarray(total) / _INTERVAL**3


@lru_cache(maxsize=16)
def limb_dofs(robot: Morphology) -> tuple[list[int], ...]:
    """The dofs of a robot's limbs, in the order of `limb_jerks`, from trunk to end."""
    tree, roles = robot.tree, robot.rig.roles
    trunk = set(tree.chain(int(robot.links[robot.rig.chest])))
    trunk |= set(tree.chain(int(robot.links[robot.rig.pelvis])))
    found = []
    for group in _GROUPS:
        ends = [j for role in LIMBS[group] if (j := roles.joint(role)) is not None]
        links = {link for j in ends for link in tree.chain(int(robot.links[j]))}
        found.append(tree.dofs(tuple(sorted(links - trunk))))
    return tuple(found)
