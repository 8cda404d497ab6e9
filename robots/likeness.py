"""How alike the poses of a robot and of its source are: angles between the parts of both."""

from collections.abc import Sequence

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
_HANDS = (Role.LEFT_HAND, Role.RIGHT_HAND)


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
    ahead = np.eye(3)[:1]
    pairs = _turns_of(_FEET, motion, rig, result)
    if not pairs:
        return None
    wanted, found = (
        [quat_rotate(turn, ahead) for turn in turns] for turns in zip(*pairs, strict=True)
    )
    return _mean_angle(wanted, found)


def hand_error(motion: Motion, rig: Rig, result: RobotMotion) -> float | None:
    """The mean angle [rad] by which the hands of both are turned against each other, as they are
    from the T-pose; None without hands."""
    pairs = _turns_of(_HANDS, motion, rig, result)
    if not pairs:
        return None
    away = np.stack([quat_mul(quat_conj(wanted), found) for wanted, found in pairs])
    return float((2 * np.arccos(np.clip(np.abs(away[..., 0]), 0.0, 1.0))).mean())


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


def _turns_of(
    roles: Sequence[Role], motion: Motion, rig: Rig, result: RobotMotion
) -> list[tuple[Float[np.ndarray, "T 4"], Float[np.ndarray, "T 4"]]]:
    """How the parts that both have are turned from the T-pose, in world axes: the source's, and
    the robot's."""
    both = [_turns(roles, motion, rig), _turns(roles, result.motion, result.robot.rig)]
    return [(both[0][role], both[1][role]) for role in roles if all(role in own for own in both)]


def _turns(roles: Sequence[Role], motion: Motion, rig: Rig) -> dict[Role, Float[np.ndarray, "T 4"]]:
    _, world = forward(motion)
    joints = {role: rig.roles.joint(role) for role in roles}
    return {
        role: quat_mul(world[:, j], quat_conj(rig.tpose[j]))
        for role, j in joints.items()
        if j is not None
    }


def _trunk(motion: Motion, rig: Rig) -> Float[np.ndarray, "T 3"] | None:
    if not has_shoulders(rig):
        return None
    along = hips_to_shoulders(rig, forward(motion)[0])
    return along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
