"""What a few frames of a robot are asked to do: `robots.solver.targets`, turns as matrices."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from robots.solver.targets import Targets
from spark.rig.roles import Role
from spark.rotation import matrix_from_quat


@dataclass(frozen=True, eq=False)
class PoseTargets:
    """`robots.solver.targets.Targets` of one frame's pose, or of some (T), floor at z = 0, turns as
    matrices (`R_world_joint`); `bones` in some order of their roles, `hands` 0 where they are not
    known."""

    world: Float[np.ndarray, "*T J 3 3"]
    chest: Float[np.ndarray, "*T 3 3"]
    hips: Float[np.ndarray, "*T 3"]
    bones: Float[np.ndarray, "*T B 3"]
    hands: Float[np.ndarray, "*T 3"]

    def at(self, frames: Int[np.ndarray, "S"]) -> "PoseTargets":
        """Those of some frames."""
        return PoseTargets(
            self.world[frames],
            self.chest[frames],
            self.hips[frames],
            self.bones[frames],
            self.hands[frames],
        )


@dataclass(frozen=True, eq=False)
class PointTargets:
    """Where points are held: `positions` [m, world], and by axis how firmly (`holds`): the share of
    the weight of a standing foot's."""

    positions: Float[np.ndarray, "T P 3"]
    holds: Float[np.ndarray, "T P 3"]

    @property
    def last(self) -> "PointTargets":
        """Those of the last frame."""
        return PointTargets(self.positions[-1:], self.holds[-1:])


@dataclass(frozen=True, eq=False)
class Asked:
    """What is asked of some frames, as `robots.solver.window_terms` takes it: of some parts their
    turns, inverted (`R_part_world`), and where points should be [m, world] and directions should
    point, with their weights by axis [1/m, 1/rad]."""

    turns: Float[np.ndarray, "T K 3 3"]
    places: Float[np.ndarray, "T R 3"]
    weights: Float[np.ndarray, "T R 3"]


def pose_targets(targets: Targets, bones: Sequence[Role]) -> PoseTargets:
    """Those of all frames, the directions of `bones` in this order."""
    count = len(targets)
    directions = [targets.bones[role] for role in bones]
    return PoseTargets(
        matrix_from_quat(targets.world),
        matrix_from_quat(targets.chest),
        targets.hips,
        np.stack(directions, axis=1) if bones else np.zeros((count, 0, 3)),
        np.zeros((count, 3)) if targets.hands is None else targets.hands,
    )
