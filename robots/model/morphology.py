"""A robot as a rig: parts, soles, T-pose; its coordinates as MuJoCo's and as a motion."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.model.followers import Follower, followers_of, following, led_by
from robots.model.mjcf import Mjcf, read_mjcf
from robots.model.posing import local_poses
from robots.model.tpose import rest_pose
from robots.tree import Coordinates, Tree
from spark.blocks import in_blocks
from spark.motion import Motion, lazy_motion
from spark.rig.feet import Sole
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import (
    quat_conj,
    quat_continuous,
    quat_mul,
    quat_normalize,
    quat_relative,
)
from spark.summary import counted


@dataclass(frozen=True, eq=False)
class Morphology:
    """What a robot is. Joint j of `rig.skeleton` is the part that tree link `links[j]` moves (-1:
    the base), and `centers[j]` [m] is where it turns, in the rest pose. `mount` is where a robot
    without legs stays."""

    mjcf: Mjcf
    tree: Tree
    mj_joints: tuple[int, ...]
    rig: Rig
    links: Int[np.ndarray, "J"]
    centers: Float[np.ndarray, "J 3"]
    tpose: Coordinates
    notes: tuple[str, ...] = ()
    mount: Coordinates | None = None

    def __repr__(self) -> str:
        return f"Morphology({self.mjcf.path.name!r}, {counted(len(self.mj_joints), 'joint')})"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the hinges and balls, in the order of qpos."""
        return tuple(self.mjcf.joint_name(joint) for joint in self.mj_joints)

    @cached_property
    def whole(self) -> Mjcf:
        """The model with all its shapes, read and compiled once for all motions; not to be
        changed."""
        return read_mjcf(self.mjcf.path)

    @cached_property
    def bones(self) -> dict[Role, Float[np.ndarray, "3"]]:
        """Unit directions, in the rest pose, of the bones of joints with a role that have one."""
        pose = rest_pose(self.rig.skeleton, self.rig.roles)
        found = {}
        for j, role in enumerate(self.rig.roles.roles):
            bone = None if role is None or role in found else pose.bone(j)
            if role is not None and bone is not None:
                found[role] = bone / np.linalg.norm(bone)
        return found

    @cached_property
    def addresses(self) -> Int[np.ndarray, "N"]:
        """Where `qpos` has the tree's joints: a hinge's angle, the first of a ball's four."""
        return np.asarray(self.mjcf.model.jnt_qposadr[list(self.mj_joints)], dtype=np.int64)

    @cached_property
    def _rest_quats(self) -> tuple[Float[np.ndarray, "4"], Float[np.ndarray, "N 4"]]:
        """The rotations in the rest pose of the root's body and of each joint's body."""
        model = self.mjcf.model
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        bodies = model.jnt_bodyid[list(self.mj_joints)]
        return data.xquat[self.mjcf.root].copy(), data.xquat[bodies].reshape(-1, 4).copy()

    def to_qpos(self, q: Coordinates) -> Float[np.ndarray, "T nq"]:
        """MuJoCo's qpos: base position [m], base quaternion wxyz, joints [rad; wxyz for balls], in
        the order of the model; what is not the robot's stays at `qpos0`."""
        model, tree = self.mjcf.model, self.tree
        qpos = np.tile(model.qpos0, (len(q), 1))
        root_quat, body_quats = self._rest_quats
        base = self.mjcf.base_qpos
        qpos[:, base : base + 3] = q.pos
        qpos[:, base + 3 : base + 7] = quat_continuous(quat_mul(q.quat, root_quat))
        hinges = ~tree.balls
        qpos[:, self.addresses[hinges]] += q.angles[:, hinges]
        for j in np.flatnonzero(tree.balls):
            assert q.ball_quats is not None
            at = int(self.addresses[j])
            local = quat_relative(body_quats[j], quat_mul(q.ball_quats[:, j], body_quats[j]))
            qpos[:, at : at + 4] = quat_continuous(local)
        return qpos

    def from_qpos(self, qpos: Float[np.ndarray, "T nq"]) -> Coordinates:
        """The inverse of `to_qpos`."""
        model, tree = self.mjcf.model, self.tree
        root_quat, body_quats = self._rest_quats
        base = self.mjcf.base_qpos
        angles = np.zeros((len(qpos), len(tree)))
        hinges = ~tree.balls
        angles[:, hinges] = qpos[:, self.addresses[hinges]] - model.qpos0[self.addresses[hinges]]
        balls = tree.rest_balls(len(qpos))
        if balls is not None:
            for j in np.flatnonzero(tree.balls):
                at = int(self.addresses[j])
                local = quat_normalize(qpos[:, at : at + 4])
                balls[:, j] = quat_mul(body_quats[j], quat_mul(local, quat_conj(body_quats[j])))
        quat = quat_normalize(qpos[:, base + 3 : base + 7])
        return Coordinates(
            qpos[:, base : base + 3].copy(), quat_mul(quat, quat_conj(root_quat)), angles, balls
        )

    @cached_property
    def moved(self) -> frozenset[int]:
        """The tree's joints that move a part with a role or a sole: others, as a gripper's, stay
        as in the T-pose."""
        links = {int(k) for k, role in zip(self.links, self.rig.roles.roles, strict=True) if role}
        return frozenset(j for link in links | self.foot_links for j in self.tree.chain(link))

    @property
    def foot_links(self) -> set[int]:
        """The tree's links with soles, or with joints that stand on the floor."""
        soles = {int(link) for sole in self.soles for link in self.sole_points(sole)[0]}
        return soles | {int(self.links[j]) for j in self.rig.contact_joints}

    @cached_property
    def followers(self) -> tuple[Follower, ...]:
        """The joints that follow others, leaders before who follows them."""
        return led_by(followers_of(self.mjcf, self.mj_joints), self.moved)

    def following(self, q: Coordinates) -> Coordinates:
        """The same with joints that follow others where those take them."""
        return following(self.followers, q)

    @property
    def soles(self) -> tuple[Sole, ...]:
        """The soles of its feet, left before right."""
        return self.rig.soles

    def sole_points(self, sole: Sole) -> tuple[Int[np.ndarray, "P"], Float[np.ndarray, "P 3"]]:
        """The link that moves each point of a sole, and the point's place in the rest pose [m]."""
        return self.links[sole.joints], self.rig.skeleton.rest_positions[sole.joints] + sole.offsets

    def motion(self, q: Coordinates, frame_time: float) -> Motion:
        """The same motion on the rig's skeleton. Axes that miss each other move the joints' centres
        against each other by millimetres: `translations` says so. Of a long motion, frames are made
        as they are asked for."""
        return lazy_motion(lambda span: self._motion(q.at(span), frame_time), len(q))

    def _motion(self, q: Coordinates, frame_time: float) -> Motion:
        joints = in_blocks(lambda block: self._local(q.at(block)), len(q))
        local, offsets = joints[..., :4], joints[..., 4:]
        return Motion(self.rig.skeleton, frame_time, offsets[:, 0], local, offsets)

    def _local(self, q: Coordinates) -> Float[np.ndarray, "T J 7"]:
        """The joints' rotations and places [m] in their parents' axes, the root's in the world."""
        return local_poses(self.tree, self.links, self.centers, self.rig.skeleton.parents, q)
