"""Detours for limbs that are stuck behind their limits.

Descent follows a limb wherever it goes, also into a local minimum: an arm that came up on the wrong
side. The rotations projected onto its hinges (`robots.solver.projection`) may have another
solution; then the limb is led there, and after that solution while it moves on.
"""

from math import acos

import numpy as np
from jaxtyping import Float

from robots.solver.hinges import Posture
from robots.solver.projection import turned
from robots.solver.window_terms import Terms
from robots.stream.frame_targets import LATENCY, FrameReader, FrameTargets
from spark.rotation import quat_from_matrix

_LOST = float(np.radians(55))  # a bone farther from its direction is stuck,
_ASTRAY = float(np.radians(30))  # one farther than this may be: it is given more time;
_FOUND = float(np.radians(25))  # a nearer one is free again
_GAIN = float(np.radians(15))  # by which a limb has to be nearer where it is led to
_PATIENCE = 0.1  # [s] that a limb is stuck before it is led,
_ASTRAY_PATIENCE = 0.3  # [s] or astray
_OTHER_WAY = 1.0  # [rad] of a hinge between the same way to a pose and another one
_MAX_DURATION = 0.6  # [s] that it is led, and that it is then left alone
_W_DETOUR = 3.0  # [1/rad] of the angles that it is led to: firmer than its bones' directions
_SPEED = 6.0  # [rad/s] at which it is led
_ONES = np.ones(3)


class Detours:
    """Finds limbs that are stuck, and the posture that leads them out."""

    def __init__(self, reader: FrameReader, terms: Terms, frame_time: float) -> None:
        self._robot, self._terms, self._frame_time = reader.robot, terms, frame_time
        robot = self._robot
        trunk = robot.rig.pelvis, robot.rig.chest
        inner = {k for j in trunk for k in robot.tree.chain(int(robot.links[j]))}
        numbers = np.cumsum(~robot.tree.balls) - 1  # of the tree's hinges
        self._links: list[int] = []  # of the limbs' lower bones
        self._limbs = []  # the number of the upper one's bone, the lower one's is next; and hinges
        for k in range(len(reader.bones) - 1):
            upper, lower = (robot.rig.roles.require(role) for role in reader.bones[k : k + 2])
            if int(robot.rig.skeleton.parents[lower]) != upper:
                continue
            chain = [j for j in robot.tree.chain(int(robot.links[lower])) if j not in inner]
            hinges = [int(numbers[j]) for j in chain if not robot.tree.balls[j]]
            self._limbs.append((k, hinges))
            self._links.append(int(robot.links[lower]))
        self._stuck = [0.0] * len(self._limbs)  # 1 where patience ends
        self._led = [0.0] * len(self._limbs)  # [s] left; below 0 it is left alone
        self._goals = np.full(len(terms.hinges.at_tpose.angles), np.nan)

    def update(
        self,
        targets: FrameTargets,
        bones: Float[np.ndarray, "B 3"],
        angles: Float[np.ndarray, "H"],
    ) -> Posture:
        """The posture that hinges are pulled to, where bones have the directions `bones` and hinges
        are at `angles` [rad] in the first frame of `targets`."""
        worst, time = self._away(bones, targets.bones[0]), self._frame_time
        if not any(self._led) and max(worst, default=0.0) <= _ASTRAY:
            self._stuck = [0.0] * len(self._limbs)
            return self._terms.hinges.at_tpose
        for limb, away in enumerate(worst):
            patience = _PATIENCE if away > _LOST else _ASTRAY_PATIENCE
            self._stuck[limb] = self._stuck[limb] + time / patience if away > _ASTRAY else 0.0
            left = self._led[limb]
            self._led[limb] = left - min(max(left, -time), time)
            if left > 0 and (away < _FOUND or self._led[limb] == 0):
                self._leave_alone(limb)
        led = [k for k, left in enumerate(self._led) if left > 0]
        stuck = [k for k, left in enumerate(self._led) if self._stuck[k] > 1 and left == 0]
        if led or stuck:
            self._look(led, stuck, worst, targets, angles)
        at_tpose = self._terms.hinges.at_tpose
        if max(self._led, default=0.0) <= 0:
            return at_tpose
        on_the_way = np.isfinite(self._goals)
        # `LATENCY` frames lie ahead of the one at `angles`.
        most = _SPEED * time * (LATENCY + 1)
        next_angles = angles + np.clip(self._goals - angles, -most, most)
        return Posture(
            np.where(on_the_way, next_angles, at_tpose.angles),
            np.where(on_the_way, _W_DETOUR, at_tpose.weights),
        )

    def _look(
        self,
        led: list[int],
        stuck: list[int],
        worst: list[float],
        targets: FrameTargets,
        angles: Float[np.ndarray, "H"],
    ) -> None:
        """See where the projection has the limbs that are `led`, and whether it is a way out for
        the `stuck` ones."""
        robot, terms = self._robot, self._terms
        world = quat_from_matrix(targets.world[:1])
        links = [self._links[limb] for limb in led + stuck]
        q = robot.to_qpos(turned(robot, world, links))
        there = self._away(terms.bones(terms.poses(q))[0], targets.bones[0])
        goals = terms.hinges.angles(q)[0]

        def other_way(hinges: list[int], than: Float[np.ndarray, "H"]) -> bool:
            return bool(np.abs(goals[hinges] - than[hinges]).max(initial=0.0) > _OTHER_WAY)

        for limb in led:
            _, hinges = self._limbs[limb]
            if other_way(hinges, self._goals):
                self._leave_alone(limb)
            else:
                self._goals[hinges] = goals[hinges]
        for limb in stuck:
            _, hinges = self._limbs[limb]
            if other_way(hinges, angles) and there[limb] < worst[limb] - _GAIN:
                self._led[limb] = _MAX_DURATION
                self._goals[hinges] = goals[hinges]
            else:
                self._leave_alone(limb)

    def _leave_alone(self, limb: int) -> None:
        self._led[limb] = -_MAX_DURATION
        self._goals[self._limbs[limb][1]] = np.nan

    def _away(
        self, bones: Float[np.ndarray, "B 3"], wanted: Float[np.ndarray, "B 3"]
    ) -> list[float]:
        """How far [rad] each limb's bones are from their directions, the farthest of them."""
        cosines = ((bones * wanted) @ _ONES).tolist()
        nearest = [min(cosines[k], cosines[k + 1]) for k, _ in self._limbs]
        return [acos(min(max(cosine, -1.0), 1.0)) for cosine in nearest]
