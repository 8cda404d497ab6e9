"""The parts of a robot that are turned as the source's, in a few frames."""

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.weights import W_OTHER_ROTATION, W_PALM, W_ROTATION
from robots.solver.window_dofs import WindowDofs
from robots.solver.window_poses import WindowPoses

_AXIAL = np.zeros((9, 3))  # what the axial vector of a matrix sums up
for _i, _j, _k in ((2, 1, 0), (0, 2, 1), (1, 0, 2)):
    _AXIAL[3 * _i + _j, _k], _AXIAL[3 * _j + _i, _k] = 1.0, -1.0


class WindowRotations:
    """`robots.residuals.rotation_residual` of all parts with a role that some dofs turn. They turn
    about the same axes, so their Jacobians are summed up as one product of these with each other.
    With `firm_hands`, hands weigh as much as those that lie on the ground."""

    def __init__(self, robot: Morphology, dofs: WindowDofs, *, firm_hands: bool) -> None:
        rig, links = robot.rig, robot.links.tolist()
        joints, weights = [], []
        for j, role in enumerate(rig.roles.roles):
            own = j == 0 or links[j] != links[int(rig.skeleton.parents[j])]
            if role is not None and own:
                joints.append(j)
                firm = W_PALM if firm_hands and role.part == "hand" else 0.0
                weights.append(W_ROTATION.get(role.part, W_OTHER_ROTATION) + firm)
        joints.append(len(links))  # the chest's target comes after all joints'
        weights.append(W_ROTATION["chest"])
        turned = [links[j] if j < len(links) else links[rig.chest] for j in joints]
        moving = dofs.moving(turned)
        moved = moving.any(axis=1)
        self._joints, self._bodies = np.array(joints)[moved], dofs.bodies(turned)[moved]
        weighted = moving[moved] * np.array(weights)[moved, None] ** 2
        self._weights = 0.5 * weighted
        self._gram = weighted.T @ moving[moved]

    def asked(
        self, world: Float[np.ndarray, "T J 3 3"], chest: Float[np.ndarray, "T 3 3"]
    ) -> Float[np.ndarray, "T K 3 3"]:
        """Those of the targets that are followed, and back: `R_joint_world`."""
        targets = np.concatenate([world, chest[:, None]], axis=1).take(self._joints, axis=1)
        return targets.transpose(0, 1, 3, 2)

    def normal_equations(
        self, poses: WindowPoses, asked: Float[np.ndarray, "T K 3 3"]
    ) -> tuple[Float[np.ndarray, "T D D"], Float[np.ndarray, "T D"]]:
        """H and g."""
        turned = (poses.rotations.take(self._bodies, axis=1) @ asked).reshape(-1, 9)
        axial = (turned @ _AXIAL).reshape(len(asked), -1, 3)
        axes = poses.twists[:, :3]
        pulls = axes * (axial.transpose(0, 2, 1) @ self._weights)
        return self._gram * (axes.transpose(0, 2, 1) @ axes), np.add.reduce(pulls, axis=1)
