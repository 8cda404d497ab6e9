"""A moving body to show."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from sim.trajectory import Subject
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_mul, quat_rotate
from spark.skin import Skin

_HEAD = 0.12  # of the standing height: from the head's joint to the crown


@dataclass(frozen=True, eq=False)
class Figure:
    """A moving body to show, with what to call it and where its floor is [m].

    Where the subject has no model, one is built from its rig. A `ghost` is seen through, and stands
    where the figure before it stands: in the same world, or, where it is `aligned`, so that both
    begin in one place. With a `height` [m], the body and its way are scaled to stand as tall. A
    `skin` on the rig's joints is shown instead of the body that is built from the rig. It stands
    on the terrain that is stated, or on pillars up to `tops` [m], in its own world.
    """

    subject: Subject
    label: str
    floor_z: float = 0.0
    ghost: bool = False
    aligned: bool = False
    height: float | None = None
    skin: Skin | None = None
    tops: Float[np.ndarray, "K 3"] = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def motion(self) -> Motion:
        return self.subject.motion

    @property
    def rig(self) -> Rig:
        return self.subject.rig

    @property
    def scale(self) -> float:
        """How much larger it is shown than it is."""
        return 1.0 if self.height is None else self.height / self.own_height

    @property
    def own_height(self) -> float:
        """The height [m] of its crown over its soles in the T-pose; where it has no head, that of a
        human with its legs."""
        rig = self.rig
        heads = rig.roles.joints(Role.HEAD)
        if not heads or not rig.soles:
            return rig.standing_height
        heights = rig.tpose_positions[:, 2]
        feet = [sole_positions(s, rig.tpose_positions, rig.tpose)[:, 2].min() for s in rig.soles]
        return float(heights[list(heads)].max() - min(feet)) + _HEAD * rig.standing_height

    @property
    def ahead(self) -> Float[np.ndarray, "3"]:
        """Where its pelvis faces in its first frame, in its own world."""
        rig = self.rig
        pelvis = forward(self.motion.frames(0, 1))[1][0, rig.root_joint]
        since_tpose = quat_mul(pelvis, quat_conj(rig.tpose[rig.root_joint]))
        return quat_rotate(since_tpose, np.array([1.0, 0, 0]))
