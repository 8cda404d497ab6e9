"""How a robot's mass moves: its centre of mass, its Jacobian, and the angular momentum."""

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from jaxtyping import Float

from robots.kinematics import LinkPoses, cross
from robots.model.morphology import Morphology


@dataclass(frozen=True, eq=False)
class LinkMass:
    """The mass that moves with each link, as a share of all; the base's is last. `coms` [m] and
    `inertias` [m², about those, for unit mass of the robot] are in the rest pose's world."""

    shares: Float[np.ndarray, "L"]
    coms: Float[np.ndarray, "L 3"]
    inertias: Float[np.ndarray, "L 3 3"]


@lru_cache(maxsize=16)
def link_mass(robot: Morphology) -> LinkMass:
    """The masses of the robot's links, as the file has them."""
    model = robot.mjcf.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    link_of = {int(model.jnt_bodyid[joint]): k for k, joint in enumerate(robot.mj_joints)}
    count = len(robot.tree) + 1
    mass, first = np.zeros(count), np.zeros((count, 3))
    second = np.zeros((count, 3, 3))
    for body in np.flatnonzero(model.body_rootid == model.body_rootid[robot.mjcf.root]).tolist():
        above = body
        while above not in link_of and above != robot.mjcf.root:
            above = int(model.body_parentid[above])
        k = link_of.get(above, count - 1)
        m, c = float(model.body_mass[body]), data.xipos[body]
        R = data.ximat[body].reshape(3, 3)
        mass[k] += m
        first[k] += m * c
        own = R @ np.diag(model.body_inertia[body]) @ R.T
        second[k] += own + m * ((c @ c) * np.eye(3) - np.outer(c, c))
    coms = first / np.maximum(mass, 1e-12)[:, None]
    for k, c in enumerate(coms):
        second[k] -= mass[k] * ((c @ c) * np.eye(3) - np.outer(c, c))
    total = max(float(mass.sum()), 1e-9)
    return LinkMass(mass / total, coms, second / total)


def center_of_mass(robot: Morphology, poses: LinkPoses) -> Float[np.ndarray, "3 T"]:
    """[m, world]."""
    masses = link_mass(robot)
    out = np.zeros((3, poses.positions.shape[2]))
    for k, (share, com) in enumerate(zip(masses.shares, masses.coms, strict=True)):
        if share > 0:
            out += share * poses.point(k if k < len(robot.tree) else -1, com)
    return out


def angular_momentum(
    robot: Morphology, poses: LinkPoses, frame_time: float
) -> Float[np.ndarray, "3 T"]:
    """About the centre of mass, for a robot of unit mass [m²/s], world axes."""
    masses = link_mass(robot)
    T = poses.positions.shape[2]
    out = np.zeros((3, T))
    if T < 2:
        return out
    com = center_of_mass(robot, poses)
    for k, (share, rest) in enumerate(zip(masses.shares, masses.coms, strict=True)):
        if share <= 0:
            continue
        link = k if k < len(robot.tree) else -1
        arm = poses.point(link, rest) - com
        out += share * np.cross(arm, np.gradient(arm, frame_time, axis=1), axis=0)
        R = poses.rotations[link]
        rate = np.gradient(R, frame_time, axis=2)
        W = np.einsum("ijt,kjt->ikt", rate, R)  # skew of the angular velocity
        omega = np.stack([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]]) / 2
        out += np.einsum("ijt,jk,lkt,lt->it", R, masses.inertias[k], R, omega, optimize=True)
    return out


def com_jacobian(
    robot: Morphology, poses: LinkPoses, joints: tuple[int, ...], *, base: bool
) -> Float[np.ndarray, "C 3 T"]:
    """By the dofs of some joints, and of the base before them: each moves the mass beyond it."""
    masses, tree = link_mass(robot), robot.tree
    T, N = poses.positions.shape[2], len(tree)
    shares = masses.shares.copy()
    moments = np.zeros((N + 1, 3, T))  # share times centre of mass, of all that a link carries
    for k in range(N + 1):
        if shares[k] > 0:
            moments[k] = shares[k] * poses.point(k if k < N else -1, masses.coms[k])
    for k in range(N - 1, -1, -1):
        above = int(tree.parents[k])
        moments[above] += moments[k]
        shares[above] += shares[k]
    out = np.zeros((6 * base + len(tree.dofs(joints)), 3, T))
    row = 0
    if base:
        out[:3] = shares[-1] * np.eye(3)[:, :, None]
        arm = moments[-1] - shares[-1] * poses.positions[-1]
        axes = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, T))
        for k in range(3):
            cross(axes[k], arm, out[3 + k])
        row = 6
    for j in joints:
        arm = moments[j] - shares[j] * poses.positions[j]
        for k in range(3 if tree.balls[j] else 1):
            cross(poses.axis(j, k), arm, out[row])
            row += 1
    return out
