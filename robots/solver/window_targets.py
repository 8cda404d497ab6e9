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


@dataclass(frozen=True, eq=False)
class FootTargets:
    """The footholds of the soles' points: `positions` [m, world], and by axis the share of the
    weight with which they are held there (`holds`, 0 to 1)."""

    positions: Float[np.ndarray, "T P 3"]
    holds: Float[np.ndarray, "T P 3"]


def pose_targets(
    targets: Targets, frames: Int[np.ndarray, "S"], bones: Sequence[Role]
) -> PoseTargets:
    """Those of some frames, the directions of `bones` in this order."""
    directions = [targets.bones[role][frames] for role in bones]
    none = np.zeros((len(frames), 3))
    return PoseTargets(
        matrix_from_quat(targets.world[frames]),
        matrix_from_quat(targets.chest[frames]),
        targets.hips[frames],
        np.stack(directions, axis=1) if bones else np.zeros((len(frames), 0, 3)),
        none if targets.hands is None else targets.hands[frames],
    )
