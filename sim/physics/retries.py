"""Falls that are taken back: a motion that is known beforehand can be tried again.

Where a balanced body falls, the simulation goes back to a while before, and looks ahead with other
random shifts; in vain again and again, to longer before. What comes out is one simulation, with
nothing that holds the body, of the servos' targets that were found (as in Liu et al.,
Sampling-based Contact-rich Motion Control, 2010, with one sample that is kept). Times go by the
body's size.
"""

import numpy as np

from sim.physics.simulation import Moment, Simulation
from spark.constants import GRAVITY

# In units of the time sqrt(height / g) in which a body of some height tips over, 0.37 s of a G1:
BACK = (2.0, 3.0, *[4.0] * 3, *[5.0] * 3, *[6.0] * 4, *[8.0] * 4)  # before the fall, each try
PASSED = 1.5  # of staying up after the latest fall: the next one is another
KEPT = 0.3  # from one moment to go back to, to the next


class Retries:
    """The moments that a simulation can go back to, and which falls were taken back: the frames in
    which they happened."""

    def __init__(self, frame_time: float, height: float) -> None:
        time = float(np.sqrt(height / GRAVITY)) / frame_time
        self._every = max(1, round(KEPT * time))
        self._back = [max(1, round(back * time)) for back in BACK]
        self._passed = round(PASSED * time)
        self._moments: dict[int, Moment] = {}
        self._tried, self._fall = 0, 0
        self.falls: list[int] = []

    def keep(self, t: int, simulation: Simulation) -> None:
        """The moment of frame `t`, as far as it is wanted."""
        if t > self._fall + self._passed:
            self._tried = 0
        if t % self._every == 0:
            self._moments[t] = simulation.moment()
            oldest = max(self._moments) - self._back[-1] - self._every
            self._moments = {k: kept for k, kept in self._moments.items() if k >= oldest}

    def go_back(self, t: int, simulation: Simulation) -> int | None:
        """The frame from which the simulation goes on after a fall in frame `t`; None where there
        was another try for each of `BACK`."""
        if self._tried == len(self._back):
            return None
        before = [k for k in self._moments if k <= t - self._back[self._tried]]
        frame = max(before) if before else min(self._moments)
        self.falls.append(t)
        self._tried, self._fall = self._tried + 1, max(self._fall, t)
        simulation.go_back(self._moments[frame], seed=len(self.falls))
        return frame
