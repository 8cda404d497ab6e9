"""Where a robot's bodies are over time, how fast they move, and the orders that trackers have
joints and bodies in."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.tree import Tree
from spark.rotation import quat_conj, quat_mul, quat_rotate, rotvec_from_quat
from spark.transfer.treads import feet_by_side


@dataclass(frozen=True, eq=False)
class BodyStates:
    """Places [m], rotations (wxyz), velocities [m/s] and angular velocities [rad/s] of bodies, all
    in world axes; velocities are central differences."""

    pos: Float[np.ndarray, "T B 3"]
    quat: Float[np.ndarray, "T B 4"]
    lin_vel: Float[np.ndarray, "T B 3"]
    ang_vel: Float[np.ndarray, "T B 3"]


def body_states(motion: RobotMotion, bodies: list[int], *, of_mass: bool = False) -> BodyStates:
    """How some bodies move. The velocities are those of the bodies' own origins, or with `of_mass`
    of their centres of mass."""
    robot, dt = motion.robot, motion.frame_time
    own = robot.mjcf.bodies()
    at = [own.index(body) for body in bodies]
    pos, quat = (poses[:, at] for poses in body_poses(robot, motion.qpos))
    moving = pos
    if of_mass:
        centers = robot.mjcf.model.body_ipos[bodies]  # of mass [m], in each body's axes
        moving = pos + quat_rotate(quat, np.broadcast_to(centers, pos.shape))
    return BodyStates(pos, quat, gradient(moving, dt), turning(quat, dt))


def body_poses(
    robot: Morphology, qpos: Float[np.ndarray, "T nq"]
) -> tuple[Float[np.ndarray, "T B 3"], Float[np.ndarray, "T B 4"]]:
    """Where the robot's bodies are [m], and how they are turned (wxyz), the root first."""
    model, bodies = robot.mjcf.model, robot.mjcf.bodies()
    data = mujoco.MjData(model)
    pos, quat = np.zeros((len(qpos), len(bodies), 3)), np.zeros((len(qpos), len(bodies), 4))
    for t, frame in enumerate(qpos):
        data.qpos[:] = frame
        mujoco.mj_kinematics(model, data)
        pos[t], quat[t] = data.xpos[bodies], data.xquat[bodies]
    return pos, quat


def breadth_first(tree: Tree) -> Int[np.ndarray, "N"]:
    """The joints level by level: entry k is the joint that comes k-th."""
    depth = [len(tree.chain(j)) for j in range(len(tree))]
    return np.argsort(depth, kind="stable")


def moving_bodies(robot: Morphology) -> list[int]:
    """The root and the bodies with joints of their own, in the model's order: those that are left
    where fixed joints are merged, as Isaac Lab does and a URDF's reader may."""
    joints = robot.mjcf.model.body_jntnum
    return [body for body in robot.mjcf.bodies() if body == robot.mjcf.root or int(joints[body])]


def isaac_bodies(robot: Morphology) -> list[int]:
    """The moving bodies level by level, the root first, as Isaac Lab numbers them."""
    model = robot.mjcf.model
    order = {robot.mjcf.root: 0}
    for place, joint in enumerate(breadth_first(robot.tree), start=1):
        order[int(model.jnt_bodyid[robot.mj_joints[joint]])] = place  # its last joint's
    return sorted(order, key=lambda body: order[body])


def body_names(robot: Morphology, bodies: list[int]) -> tuple[str, ...]:
    """What the model calls them."""
    return tuple(robot.mjcf.body_name(body) for body in bodies)


def foot_contacts(motion: RobotMotion) -> dict[str, Bool[np.ndarray, "T"]]:
    """In which frames each foot stands, by side; empty for a robot without feet."""
    return feet_by_side(motion.robot.rig, motion.motion, motion.terrain)


def contact_array(motion: RobotMotion) -> dict[str, np.ndarray]:
    """The contacts as an npz holds them: `foot_contacts` (T, F) and `foot_names`."""
    standing = foot_contacts(motion)
    table = np.stack([*standing.values()], 1) if standing else np.zeros((len(motion), 0), bool)
    return {"foot_contacts": table, "foot_names": np.array([*standing], dtype=np.str_)}


def foot_spans(motion: RobotMotion) -> dict[str, list[list[int]]]:
    """The contacts as text holds them: first and last frame of each, by side."""
    spans = {}
    for side, standing in foot_contacts(motion).items():
        edges = np.flatnonzero(np.diff(np.concatenate([[False], standing, [False]]).astype(int)))
        spans[side] = [[int(first), int(stop) - 1] for first, stop in edges.reshape(-1, 2)]
    return spans


def gradient(values: Float[np.ndarray, "T ..."], dt: float) -> Float[np.ndarray, "T ..."]:
    """Central differences over time, one-sided at the ends; a single frame stands still."""
    return np.gradient(values, dt, axis=0) if len(values) > 1 else np.zeros_like(values)


def turning(quat: Float[np.ndarray, "T B 4"], dt: float) -> Float[np.ndarray, "T B 3"]:
    """Angular velocities in world axes [rad/s], by central differences."""
    out = np.zeros((*quat.shape[:2], 3))
    if len(quat) > 1:
        after = np.minimum(np.arange(len(quat)) + 1, len(quat) - 1)
        before = np.maximum(np.arange(len(quat)) - 1, 0)
        turn = rotvec_from_quat(quat_mul(quat[after], quat_conj(quat[before])))
        out = turn / (dt * (after - before))[:, None, None]
    return out
