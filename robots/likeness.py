"""How alike the poses of a robot and of its source are: angles between the parts of both."""

import numpy as np
from jaxtyping import Float

from robots.model.motion import RobotMotion
from robots.solver.targets import bone_directions
from robots.solver.trunk import has_shoulders, hips_to_shoulders
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_mul, quat_rotate

_LOWER = {
    "upper_leg": "lower_leg",
    "lower_leg": "foot",
    "upper_arm": "forearm",
    "forearm": "hand",
}
_FEET = (Role.LEFT_FOOT, Role.RIGHT_FOOT)


def limb_error(motion: Motion, rig: Rig, result: RobotMotion) -> float:
    """The mean angle [rad] between the limbs' segments of both."""
    own = result.robot.rig
    wanted, found = _limbs(motion, rig), _limbs(result.motion, own)
    ends = {
        role: own.roles.joint(Role(f"{role.side}_{_LOWER[role.part]}"))
        for role in wanted
        if role in found
    }
    roles = [role for role, end in ends.items() if end is not None]
    return _mean_angle([wanted[role] for role in roles], [found[role] for role in roles])


def foot_error(motion: Motion, rig: Rig, result: RobotMotion) -> float | None:
    """The mean angle [rad] between where the feet of both point, that point ahead in the T-pose;
    None without feet."""
    wanted, found = _feet(motion, rig), _feet(result.motion, result.robot.rig)
    roles = [role for role in wanted if role in found]
    if not roles:
        return None
    return _mean_angle([wanted[role] for role in roles], [found[role] for role in roles])


def trunk_error(motion: Motion, rig: Rig, result: RobotMotion) -> float | None:
    """The mean angle [rad] between the lines of both from the middle of the hips to that of the
    shoulders; None without shoulders."""
    wanted, found = _trunk(motion, rig), _trunk(result.motion, result.robot.rig)
    return None if wanted is None or found is None else _mean_angle([wanted], [found])


def _mean_angle(
    wanted: list[Float[np.ndarray, "T 3"]], found: list[Float[np.ndarray, "T 3"]]
) -> float:
    cosines = (np.stack(wanted) * np.stack(found)).sum(axis=-1)
    return float(np.arccos(np.clip(cosines, -1.0, 1.0)).mean())


def _limbs(motion: Motion, rig: Rig) -> dict[Role, Float[np.ndarray, "T 3"]]:
    positions, world = forward(motion)
    return bone_directions(rig, positions, quat_mul(world, quat_conj(rig.tpose)))


def _feet(motion: Motion, rig: Rig) -> dict[Role, Float[np.ndarray, "T 3"]]:
    _, world = forward(motion)
    joints = {role: rig.roles.joint(role) for role in _FEET}
    return {
        role: quat_rotate(quat_mul(world[:, j], quat_conj(rig.tpose[j])), np.eye(3)[:1])
        for role, j in joints.items()
        if j is not None
    }


def _trunk(motion: Motion, rig: Rig) -> Float[np.ndarray, "T 3"] | None:
    if not has_shoulders(rig):
        return None
    along = hips_to_shoulders(rig, forward(motion)[0])
    return along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
