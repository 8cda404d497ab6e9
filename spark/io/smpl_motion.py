"""What a file of the SMPL family says of a body's motion."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.io.convention import Up


@dataclass(frozen=True, eq=False)
class SmplMotion:
    """What a file of the family says; None where it does not.

    `rotvecs` are those of the model's joints in its order (22, 24, 52 or 55 of them), `trans` moves
    the model's origin [m]. `usual_up` is the axis that points up in such files; `origin` says what
    kind of file it is, `smplx` that the model is SMPL-X whatever the number of joints.
    """

    rotvecs: Float[np.ndarray, "T J 3"]
    trans: Float[np.ndarray, "T 3"] | None
    origin: str
    usual_up: Up
    usual_fps: float = 30.0
    smplx: bool = False
    betas: Float[np.ndarray, "B"] | None = None
    gender: str | None = None
    fps: float | None = None
    notes: tuple[str, ...] = ()
