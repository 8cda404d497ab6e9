"""The places and directions that a few frames of a robot are asked for, as
`robots.residuals` has them: bones, soles, hips, hands, and what lies on the ground."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from robots.kinematics import skew
from robots.model.morphology import Morphology
from robots.solver.hands import wrist_links
from robots.solver.weights import (
    HANDS_RANGE,
    W_HANDS,
    W_HIPS_POSITION,
    W_HOLD,
    W_LIMB_DIRECTION,
    per_metre,
)
from robots.solver.window_dofs import WindowDofs
from robots.solver.window_poses import WindowPoses
from robots.solver.window_rows import Rows
from robots.solver.window_targets import Asked, PointTargets, PoseTargets
from spark.rig.roles import HANDS, Role

# What (x, y, z, 1) of a point's place, or (x, y, z, 0) of a direction, has to do with the wrenches
# along x, y and z.
_WRENCHES = np.zeros((4, 3, 6))
_WRENCHES[:3, :, :3] = np.array([skew(axis).T for axis in np.eye(3)])
_WRENCHES[3, :, 3:] = np.eye(3)

_ONES = np.ones((3, 1))


class WindowPoints:
    """Of the `bones`, which are directions, of the soles' points and the middle of the hips, which
    are not the later block's, of both wrists where `hands` says so, and of `parts`: points, in the
    rest pose [m], of links that may be held. `rest` is where all bodies are in it."""

    def __init__(
        self,
        robot: Morphology,
        dofs: WindowDofs,
        rest: Float[np.ndarray, "N 3"],
        bones: Sequence[Role],
        hands: bool,
        parts: Sequence[tuple[int, Float[np.ndarray, "3"]]],
    ) -> None:
        self._firm, rig = per_metre(robot), robot.rig
        links = [int(robot.links[rig.roles.require(role)]) for role in bones]
        places: list[Float[np.ndarray, 3]] = [robot.bones[role] for role in bones]
        self._bones = slice(len(links))
        soles = [robot.sole_points(sole) for sole in robot.soles if not dofs.later_only]
        links += [link for own, _ in soles for link in own.tolist()]
        places += [point for _, points in soles for point in points]
        self.soles = slice(self._bones.stop, len(links))
        if not dofs.later_only:
            links.append(int(robot.links[rig.pelvis]))
            places.append(robot.centers[rig.hips].mean(0))
        self._hips = slice(self.soles.stop, len(links))
        wrists = [rig.roles.require(r) for r in HANDS if hands]
        links += wrist_links(robot) if hands else []
        places += [robot.centers[j] for j in wrists]
        self._hands = slice(self._hips.stop, len(links))
        links += [link for link, _ in parts]
        places += [place for _, place in parts]
        self.parts = slice(self._hands.stop, len(links))
        self._bodies = dofs.bodies(links)
        arms = np.ones((len(links), 4))
        arms[:, :3] = np.array(places).reshape(-1, 3)
        arms[self._bones.stop :, :3] -= rest[self._bodies[self._bones.stop :]]
        arms[self._bones, 3] = 0.0
        self._arms = arms.T[:, None, None].copy()
        self._weights = np.full((len(links), 3), W_LIMB_DIRECTION)
        for points, weight in (
            (self.soles, W_HOLD),
            (self._hips, W_HIPS_POSITION),
            (self._hands, W_HANDS),
            (self.parts, W_HOLD),
        ):
            self._weights[points] = self._firm * weight
        self._moving = np.repeat(dofs.moving(links), 3, axis=0)

    def places(self, poses: WindowPoses, which: slice) -> Float[np.ndarray, "T R 3"]:
        """Where some of them are [m, world]; the unit directions of bones."""
        return self._places(poses, which).transpose(1, 2, 0)

    def bones_and_soles(
        self, poses: WindowPoses
    ) -> tuple[Float[np.ndarray, "T B 3"], Float[np.ndarray, "T P 3"]]:
        """The unit directions of the bones [world], and the soles' points [m, world]."""
        both = self.places(poses, slice(self.soles.stop))
        return both[:, self._bones], both[:, self.soles]

    def asked(
        self, targets: PoseTargets, feet: PointTargets, resting: PointTargets | None
    ) -> tuple[Float[np.ndarray, "T R 3"], Float[np.ndarray, "T R 3"]]:
        """Where all should be [m], and their weights by axis [1/m, 1/rad]; parts only where some
        are `resting`."""
        frames, count = len(targets.hips), (self.parts if resting else self._hands).stop
        wanted, weights = np.zeros((2, frames, count, 3))
        weights[:] = self._weights[:count]
        wanted[:, self._bones], wanted[:, self.soles] = targets.bones, feet.positions
        weights[:, self.soles] *= feet.holds
        wanted[:, self._hips] = targets.hips[:, None]
        if self._hands.stop > self._hands.start:
            wanted[:, self._hands.start] = targets.hands  # of both their difference is asked
            far = np.square(targets.hands) @ _ONES * (self._firm / HANDS_RANGE) ** 2
            weights[:, self._hands] *= np.exp(-far)[..., None]
        if resting:
            wanted[:, self.parts] = resting.positions
            weights[:, self.parts] *= resting.holds
        return wanted, weights

    def rows(self, poses: WindowPoses, asked: Asked) -> Rows:
        """Three of each, of what is asked for. The hands' are not yet those of the offset between
        both: see `join_hands`."""
        frames, count, _ = asked.weights.shape
        with_kind = np.empty((4, frames, count))
        with_kind[:3] = places = self._places(poses, slice(count))
        with_kind[3] = self._arms[3, 0, 0, :count]
        off = places.transpose(1, 2, 0) - asked.places
        off *= asked.weights
        wrenches = (with_kind.reshape(4, -1).T @ _WRENCHES.reshape(4, 18)).reshape(frames, -1, 6)
        wrenches *= asked.weights.reshape(frames, -1, 1)
        return Rows(wrenches, self._moving[: 3 * count], off.reshape(frames, -1))

    def join_hands(
        self, J: Float[np.ndarray, "T R D"], residuals: Float[np.ndarray, "T R"]
    ) -> None:
        """The left one's are made those of its place from the right one, whose come to nothing; in
        place, where the rows of `rows` are the first ones."""
        left, end = 3 * self._hands.start, 3 * self._hands.stop
        if left < end:
            right = left + 3
            for rows in (J, residuals):
                rows[:, left:right] -= rows[:, right:end]
                rows[:, right:end] = 0.0

    def _places(self, poses: WindowPoses, which: slice) -> Float[np.ndarray, "3 T R"]:
        return poses.points(self._bodies[which], self._arms[..., which])
