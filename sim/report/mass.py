"""How mass moves: a human's on the bones of a rig, or that of a model's own bodies."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from sim.report.model_poses import ModelPoses
from sim.trajectory import ModelTrajectory
from spark.rig.rig import Rig
from spark.rig.segments import segments
from spark.rotation import quat_mul, quat_rotate


@dataclass(frozen=True, eq=False)
class Mass:
    """Rigid pieces over time; the mass `fractions` sum to 1.

    `coms` [m, world] are their centres of mass; `inertias` [m²] are the tensors about those for
    unit mass, in axes of their own that `rotations` maps into the world.
    """

    fractions: Float[np.ndarray, "S"]
    inertias: Float[np.ndarray, "S 3 3"]
    coms: Float[np.ndarray, "T S 3"]
    rotations: Float[np.ndarray, "T S 4"]

    @cached_property
    def com(self) -> Float[np.ndarray, "T 3"]:
        """The centre of mass of all [m, world]."""
        com: Float[np.ndarray, "T 3"] = np.einsum("s,tsx->tx", self.fractions, self.coms)
        return com


def human_mass(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], world: Float[np.ndarray, "T J 4"]
) -> Mass:
    """A human's mass on the rig's bones (`spark.rig.segments`)."""
    body = segments(rig)
    rotations = world[:, body.joints]
    coms = positions[:, body.joints] + quat_rotate(rotations, body.coms)
    return Mass(body.masses, body.inertias, coms, rotations)


def model_mass(body: ModelTrajectory, poses: ModelPoses) -> Mass:
    """The mass of the model's bodies, as the file has it."""
    model = body.model
    heavy = poses.bodies[model.body_mass[poses.bodies] > 0]
    masses = model.body_mass[heavy]
    return Mass(
        masses / masses.sum(),
        np.einsum("si,ij->sij", model.body_inertia[heavy] / masses[:, None], np.eye(3)),
        poses.pos[:, heavy] + quat_rotate(poses.quat[:, heavy], model.body_ipos[heavy]),
        quat_mul(poses.quat[:, heavy], model.body_iquat[heavy]),
    )
