"""The objective of a few frames, in a few tenths of a millisecond.

The terms are those of `robots.solver.objective`, with the same weights, and so is the order: arms
and head hang on base, trunk and legs, and don't move them. There every term walks its own chain,
over thousands of frames; here MuJoCo gives the bodies' poses, and the Jacobian of all terms is made
at once. Its columns are MuJoCo's dofs, in the order of `robots.tree`: the base rotates about its
own axes, and so do balls.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.block import blocks_of
from robots.solver.floor import Solid, carried_solids, solids_over_floor
from robots.solver.hinges import Hinges, Posture
from robots.solver.near_spheres import NearSpheres
from robots.solver.weights import (
    FLOOR_ROUNDING,
    HANDS_RANGE,
    W_FLOOR,
    W_HANDS,
    W_HIPS_POSITION,
    W_HOLD,
    W_LIMB_DIRECTION,
    W_OTHER_ROTATION,
    W_ROTATION,
    per_metre,
)
from robots.solver.window_collision import WindowCollisions
from robots.solver.window_floor import WindowFloor
from robots.solver.window_poses import WindowPoses
from robots.solver.window_targets import PointTargets, PoseTargets
from robots.tree import BASE, cross
from spark.rig.roles import Role

LinearTerms = tuple[
    Float[np.ndarray, "T R 3 D"], Float[np.ndarray, "T R 3"], Float[np.ndarray, "T R 3"]
]
"""J, squared weights, and squared weights times residuals, of R directions and points."""


class Terms:
    """The residuals of a robot's poses, as normal equations. `bones` are the limbs' segments whose
    directions the source gives, `hands` says whether it gives the offset between both, and `parts`
    are points, in the rest pose [m], of links that may be held. With `later_only`, base, trunk and
    legs are given: nothing that they alone move is looked at, and the dofs are those of the later
    block. `mj_dofs` are MuJoCo's numbers of the dofs."""

    def __init__(
        self,
        robot: Morphology,
        bones: Sequence[Role],
        hands: bool,
        parts: Sequence[tuple[int, Float[np.ndarray, "3"]]] = (),
        *,
        later_only: bool = False,
    ) -> None:
        self.robot, tree = robot, robot.tree
        self._firm = per_metre(robot)
        self._model = robot.mjcf.model
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)
        self._rest_rotations = self._data.xmat.reshape(-1, 3, 3).copy()
        self._rest = self._data.xpos.copy()
        first, later = blocks_of(robot)
        self._in_first_block = np.zeros(len(tree) + 1, dtype=bool)  # of the links, and -1
        self._in_first_block[[*first.joints, -1]] = True
        self._dofs = np.array(later.dofs if later_only else range(tree.nv), dtype=int)
        self.hinges = Hinges(robot, self._dofs)
        self._index_dofs()
        bodies = np.array([self._body(link) for link in (*range(len(tree)), -1)])
        given = set(np.flatnonzero(self._in_first_block[:-1]).tolist())
        self._collisions = WindowCollisions(
            robot, bodies, self._rest, given, self._dofs, later_only=later_only
        )
        solids = solids_over_floor(robot)
        carried = carried_solids(robot)
        if later_only:
            solids = tuple(solid for solid in solids if not self._in_first_block[solid.link])
            carried = ()
        links = [solid.link for solid in (*solids, *carried)]
        own = self._in_first_block[[solid.link for solid in solids]]
        moving = self._mask(links, np.append(own, np.ones(len(carried), dtype=bool)))
        self._floor = WindowFloor(
            (*solids, *carried), bodies[links], moving, self._rest, self._firm
        )
        self._index_rotations()
        self._index_bones(bones)
        self._index_points(hands, parts, soles_and_hips=not later_only)

    def poses(self, q: Float[np.ndarray, "T nq"]) -> WindowPoses:
        """The poses of all bodies and joints, by MuJoCo."""
        model, data, count = self._model, self._data, len(q)
        rotations, positions = np.empty((count, model.nbody, 9)), np.empty((count, model.nbody, 3))
        axes, anchors = np.empty((2, count, model.njnt, 3))
        for t in range(count):
            data.qpos = q[t]
            mujoco.mj_kinematics(model, data)
            rotations[t], positions[t] = data.xmat, data.xpos
            axes[t], anchors[t] = data.xaxis, data.xanchor
        turns = rotations.reshape(count, -1, 3, 3) @ self._rest_rotations.transpose(0, 2, 1)
        return WindowPoses(turns, positions, axes, anchors)

    def sole_points(self, poses: WindowPoses) -> Float[np.ndarray, "T P 3"]:
        """The points of the soles [m, world]."""
        return self._points(poses, slice(self.sole_count))

    def part_points(self, poses: WindowPoses) -> Float[np.ndarray, "T K 3"]:
        """The points of the parts that may be held [m, world]."""
        return self._points(poses, slice(self._before_parts, None))

    def bones(self, poses: WindowPoses) -> Float[np.ndarray, "T B 3"]:
        """The unit directions of the bones [world]."""
        return (poses.rotations[:, self._bone_bodies] @ self._bones[:, :, None])[..., 0]

    def under(self, solids: Sequence[Solid]) -> WindowFloor:
        """The floor under some shapes."""
        links = [solid.link for solid in solids]
        bodies = np.array([self._body(link) for link in links], dtype=int)
        return WindowFloor(tuple(solids), bodies, self._mask(links), self._rest, self._firm)

    def sinking(self, poses: WindowPoses) -> Float[np.ndarray, "T"]:
        """How deep [m] the deepest point is in the floor; below 0 over it."""
        soles = -self.sole_points(poses)[..., 2]
        depth = np.concatenate([soles, self._floor.depth(poses)], axis=1)
        deepest: Float[np.ndarray, T] = depth.max(axis=1, initial=-np.inf)
        return deepest

    def candidates(self, poses: WindowPoses) -> NearSpheres:
        """The collision candidates, in these poses and others that are not far away."""
        return self._collisions.candidates(poses)

    def linearize(
        self,
        q: Float[np.ndarray, "T nq"],
        poses: WindowPoses,
        targets: PoseTargets,
        foot_targets: PointTargets,
        posture: Posture,
        candidates: NearSpheres,
        floor_scale: Float[np.ndarray, "T"] | None = None,
        resting: PointTargets | None = None,
    ) -> tuple[Float[np.ndarray, "T D D"], Float[np.ndarray, "T D"]]:
        """H and g of the normal equations `H step = -g`, each frame for itself. `poses` are those
        of `q`, `candidates` those of poses near these; `floor_scale` multiplies the weight of
        the floor, `resting` says where parts are held."""
        floor_scale = np.ones(len(q)) if floor_scale is None else floor_scale
        axes, anchors = self._dof_axes(poses)
        twists = self._twists(axes, anchors)
        # Parts that should be turned some way: an axial vector each
        # (`robots.residuals.rotation_residual`).
        target = np.concatenate([targets.world, targets.chest[:, None]], axis=1)
        target = target[:, self._rotation_joints]
        M = poses.rotations[:, self._rotation_bodies] @ target.transpose(0, 1, 3, 2)
        axial = np.empty((*M.shape[:2], 3))
        np.subtract(M[..., 2, 1], M[..., 1, 2], out=axial[..., 0])
        np.subtract(M[..., 0, 2], M[..., 2, 0], out=axial[..., 1])
        np.subtract(M[..., 1, 0], M[..., 0, 1], out=axial[..., 2])
        H = self._rotation_gram * (axes @ axes.transpose(0, 2, 1))
        g = 0.5 * (axes * (self._rotation_weights @ axial)).sum(2)
        J, weights, forces = self._linear_terms(
            poses, axes, anchors, targets, foot_targets, floor_scale, resting
        )
        J_rows = J.reshape(len(q), -1, J.shape[3])
        across = J_rows.transpose(0, 2, 1)
        H += across @ (J_rows * weights.reshape(len(q), -1, 1))
        g += (across @ forces.reshape(len(q), -1, 1))[..., 0]
        self._floor.add_to(poses, twists, floor_scale, H, g)
        self._collisions.add_to(poses, twists, candidates, H, g)
        self.hinges.add_to(q, posture, H, g)
        return H, g

    def _dof_axes(
        self, poses: WindowPoses
    ) -> tuple[Float[np.ndarray, "T D 3"], Float[np.ndarray, "T D 3"]]:
        """The dofs' axes [world], 0 for the base's shifts, and the points they rotate about."""
        base, count = self._base, len(poses.positions)
        axes, anchors = np.zeros((2, count, len(self._dofs), 3))
        if base:
            root = self.robot.mjcf.root
            axes[:, 3:base] = self._body_axes(poses, root)
            anchors[:, 3:base] = poses.positions[:, None, root]
        axes[:, base:] = poses.axes[:, self._joints]
        anchors[:, base:] = poses.anchors[:, self._joints]
        for start, body in self._balls:
            axes[:, start : start + 3] = self._body_axes(poses, body)
        return axes, anchors

    def _body_axes(self, poses: WindowPoses, body: int) -> Float[np.ndarray, "T 3 3"]:
        """A body's axes, as MuJoCo has them, as rows."""
        return (poses.rotations[:, body] @ self._rest_rotations[body]).transpose(0, 2, 1)

    def _twists(
        self, axes: Float[np.ndarray, "T D 3"], anchors: Float[np.ndarray, "T D 3"]
    ) -> Float[np.ndarray, "T 6 D"]:
        """The dofs' turns, and the shifts of the world's origin if it went with them."""
        twists = np.empty((len(axes), 6, axes.shape[1]))
        twists[:, :3] = axes.transpose(0, 2, 1)
        cross(anchors.transpose(2, 0, 1), axes.transpose(2, 0, 1), twists[:, 3:].swapaxes(0, 1))
        if self._base:
            twists[:, 3:, :3] = np.eye(3)
        return twists

    def _points(self, poses: WindowPoses, which: slice) -> Float[np.ndarray, "T P 3"]:
        bodies = self._point_bodies[which]
        arms = (poses.rotations[:, bodies] @ self._arms[which, :, None])[..., 0]
        return arms + poses.positions[:, bodies]

    def _linear_terms(
        self,
        poses: WindowPoses,
        axes: Float[np.ndarray, "T D 3"],
        anchors: Float[np.ndarray, "T D 3"],
        targets: PoseTargets,
        foot_targets: PointTargets,
        floor_scale: Float[np.ndarray, "T"],
        resting: PointTargets | None,
    ) -> LinearTerms:
        """The residuals of directions and points, as `robots.residuals` has them."""
        points = self._points(poses, slice(None if resting else self._before_parts))
        bones = self.bones(poses)
        (count, B, _), P, D = bones.shape, points.shape[1], axes.shape[1]
        arms = np.empty((3, count, B + P, D))
        arms[:, :, :B] = bones.transpose(2, 0, 1)[..., None]
        across = anchors.transpose(2, 0, 1)[:, :, None]
        np.subtract(points.transpose(2, 0, 1)[..., None], across, out=arms[:, :, B:])
        (ax, ay, az), (x, y, z) = axes.transpose(2, 0, 1)[:, :, None], arms
        J = np.empty((count, B + P, 3, D))
        np.subtract(ay * z, az * y, out=J[:, :, 0])
        np.subtract(az * x, ax * z, out=J[:, :, 1])
        np.subtract(ax * y, ay * x, out=J[:, :, 2])
        if self._base:
            J[:, B:, :, :3] = np.eye(3)
        J *= self._dof_mask[: B + P]
        weights, forces = np.empty((2, count, B + P, 3))
        weights[:, :B] = W_LIMB_DIRECTION**2
        forces[:, :B] = W_LIMB_DIRECTION**2 * (bones - targets.bones)
        if self.sole_count:
            self._add_soles(points, foot_targets, floor_scale, weights[:, B:], forces[:, B:])
        at = B + self.sole_count
        if self._hips:
            weights[:, at] = (self._firm * W_HIPS_POSITION) ** 2
            forces[:, at] = weights[:, at] * (points[:, at - B] - targets.hips)
            at += 1
        if self._hands:
            # The residual is the difference of two points, so is its Jacobian.
            squared = (self._firm**2 * targets.hands**2).sum(1, keepdims=True)
            weight = (self._firm * W_HANDS * np.exp(-squared / HANDS_RANGE**2)) ** 2
            J[:, at] -= J[:, at + 1]
            weights[:, at], weights[:, at + 1] = weight, 0.0
            between = points[:, at - B] - points[:, at + 1 - B] - targets.hands
            forces[:, at], forces[:, at + 1] = weight * between, 0.0
        if resting:
            parts, own = slice(B + self._before_parts, None), points[:, self._before_parts :]
            weights[:, parts] = (self._firm * W_HOLD * resting.holds) ** 2
            forces[:, parts] = weights[:, parts] * (own - resting.positions)
        return J, weights, forces

    def _add_soles(
        self,
        points: Float[np.ndarray, "T P 3"],
        foot_targets: PointTargets,
        floor_scale: Float[np.ndarray, "T"],
        weights: Float[np.ndarray, "T P 3"],
        forces: Float[np.ndarray, "T P 3"],
    ) -> None:
        """The footholds of the soles' points, and the floor under them; weights squared."""
        count = self.sole_count
        hold_weights = (self._firm * W_HOLD * foot_targets.holds) ** 2
        weights[:, :count] = hold_weights
        forces[:, :count] = hold_weights * (points[:, :count] - foot_targets.positions)
        depth, slope = one_sided(-points[:, :count, 2], FLOOR_ROUNDING / self._firm)
        floor = (self._firm * W_FLOOR * floor_scale[:, None]) ** 2 * slope
        weights[:, :count, 2] += floor * slope
        forces[:, :count, 2] -= floor * depth

    def _body(self, link: int) -> int:
        robot = self.robot
        return int(self._model.jnt_bodyid[robot.mj_joints[link]]) if link >= 0 else robot.mjcf.root

    def _mask(
        self, links: Sequence[int], first: Bool[np.ndarray, "K"] | None = None
    ) -> Bool[np.ndarray, "K D"]:
        """The dofs that move some links, of the first block or the later one: by default that which
        they are in."""
        tree = self.robot.tree
        first = self._in_first_block[list(links)] if first is None else first
        out = np.zeros((len(links), tree.nv), dtype=bool)
        for k, link in enumerate(links):
            out[k, :BASE] = first[k]
            same = [j for j in tree.chain(link) if self._in_first_block[j] == first[k]]
            out[k, tree.dofs(tuple(same))] = True
        return out[:, self._dofs]

    def _index_dofs(self) -> None:
        """MuJoCo's numbers of the dofs and, of those that are not the base's, of their joints."""
        model, tree = self._model, self.robot.tree
        self._base = int((self._dofs < BASE).sum())
        links = np.repeat(np.arange(len(tree)), np.where(tree.balls, 3, 1))
        links = links[self._dofs[self._base :] - BASE]
        self._joints = np.array(self.robot.mj_joints, dtype=int)[links]
        within = self._dofs[self._base :] - tree.dof_starts[links]
        base = int(model.jnt_dofadr[self.robot.mjcf.free_joint]) + self._dofs[: self._base]
        self.mj_dofs = np.append(base, model.jnt_dofadr[self._joints] + within)
        starts = self._base + np.flatnonzero(tree.balls[links] & (within == 0))
        self._balls = [(int(start), self._body(int(links[start - self._base]))) for start in starts]

    def _index_rotations(self) -> None:
        """The parts with a target rotation, and their weights."""
        rig, links = self.robot.rig, self.robot.links.tolist()
        joints, weights = [], []
        for j, role in enumerate(rig.roles.roles):
            own = j == 0 or links[j] != links[int(rig.skeleton.parents[j])]
            if role is not None and own:
                joints.append(j)
                weights.append(W_ROTATION.get(role.part, W_OTHER_ROTATION))
        joints.append(len(links))  # the chest's target comes after all joints'
        weights.append(W_ROTATION["chest"])
        rotated = [links[j] if j < len(links) else links[rig.chest] for j in joints]
        mask = self._mask(rotated)
        moved = mask.any(axis=1)
        mask = mask[moved]
        self._rotation_joints = np.array(joints)[moved]
        self._rotation_bodies = np.array([self._body(link) for link in rotated])[moved]
        self._rotation_weights = (mask * np.array(weights)[moved, None] ** 2).T
        self._rotation_gram = self._rotation_weights @ mask

    def _index_bones(self, bones: Sequence[Role]) -> None:
        robot = self.robot
        self._bone_links = [int(robot.links[robot.rig.roles.require(role)]) for role in bones]
        self._bone_bodies = np.array([self._body(link) for link in self._bone_links], dtype=int)
        self._bones = np.array([robot.bones[role] for role in bones]).reshape(-1, 3)

    def _index_points(
        self,
        hands: bool,
        parts: Sequence[tuple[int, Float[np.ndarray, "3"]]],
        *,
        soles_and_hips: bool,
    ) -> None:
        """The soles' points, the middle of the hips, both wrists where asked, and the parts that
        may be held; the dofs that move these and the bones."""
        robot = self.robot
        soles = [robot.sole_points(sole) for sole in robot.soles if soles_and_hips]
        links = [link for own, _ in soles for link in own.tolist()]
        rest = [point for _, points in soles for point in points]
        self.sole_count = len(links)
        self._hips = soles_and_hips
        if self._hips:
            links.append(int(robot.links[robot.rig.pelvis]))
            rest.append(robot.centers[robot.rig.hips].mean(0))
        self._hands = hands
        if hands:
            for role in (Role.LEFT_HAND, Role.RIGHT_HAND):
                j = robot.rig.roles.require(role)
                links.append(int(robot.links[j]))
                rest.append(robot.centers[j])
        self._before_parts = len(links)
        links += [link for link, _ in parts]
        rest += [point for _, point in parts]
        self._point_bodies = np.array([self._body(link) for link in links], dtype=int)
        self._arms = np.array(rest).reshape(-1, 3) - self._rest[self._point_bodies]
        mask = self._mask([*self._bone_links, *links])
        self._dof_mask = mask[:, None].astype(np.float64)
