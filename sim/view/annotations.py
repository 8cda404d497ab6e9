"""What is known of a motion in each of its frames, for views to draw over the figure."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

from sim.view.timeline import Event


@dataclass(frozen=True, eq=False)
class Annotations:
    """Of the T frames of one motion, `frame_time` [s] apart; points are in its own world [m].

    `corners` are points of the soles; one of state 0 is in the air, one of state k has the name and
    the colour (CSS) `corner_states[k - 1]`. `com` is the centre of mass; what is below
    `support_height` [m] may bear it.
    `joints` are the places of joints that come to a limit, `joint_names` what they are called, and
    `at_limit` says when each is at one. `flags` says when each measure is up, by its label, and
    `events` which findings there are.
    """

    frame_time: float
    corners: Float[np.ndarray, "T M 3"]
    states: UInt8[np.ndarray, "T M"]
    corner_states: tuple[tuple[str, str], ...]
    com: Float[np.ndarray, "T 3"]
    support_height: float
    joints: Float[np.ndarray, "T K 3"]
    joint_names: tuple[str, ...]
    at_limit: Bool[np.ndarray, "T K"]
    flags: dict[str, Bool[np.ndarray, "T"]]
    events: tuple[Event, ...]

    def frame(self, time: float) -> int:
        """The motion's frame at a time [s]; its last one when it is over."""
        return min(int(time / self.frame_time + 1e-6), len(self.com) - 1)
