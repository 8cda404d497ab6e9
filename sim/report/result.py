"""The report as data; `text` and `json` are two views of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from sim.report.limits import LimitExcess
from sim.report.measures import Drift
from sim.report.thresholds import Thresholds

FLAGS = {"P": "penetration", "F": "floating", "S": "skating", "R": "root wrench"}
"""The per-frame flags: letter and name."""


@dataclass(frozen=True, eq=False)
class Finding:
    """One thing to look at: what, where, in which frames [start, stop), how much.

    `amount` is in `unit` ("m", "rad", "bw" body weights, "bw_m"); `sentence` says it all, without
    the frames.
    """

    measure: str
    where: str
    start: int
    stop: int
    amount: float
    unit: str
    sentence: str

    def place(self, frame_time: float) -> str:
        """`in frames 212-240 (3.5-4.0 s)`, or `at frame 57 (0.95 s)`."""
        if self.stop - self.start == 1:
            return f"at frame {self.start} ({self.start * frame_time:.2f} s)"
        last = self.stop - 1
        seconds = f"{self.start * frame_time:.1f}-{last * frame_time:.1f} s"
        return f"in frames {self.start}-{last} ({seconds})"


@dataclass(frozen=True, eq=False)
class Measured:
    """One clip's measures over time, heights from the floor [m].

    `flags` holds one row per letter of `FLAGS`. `depth` and `speeds` are those of `depth_names` and
    of the support points; `clearance` is the height of the body's lowest point.
    """

    frame_time: float
    floor_z: float
    thresholds: Thresholds
    flags: dict[str, Bool[np.ndarray, "T"]]
    depth: Float[np.ndarray, "T N"]
    depth_names: tuple[str, ...]
    clearance: Float[np.ndarray, "T"]
    skating: Bool[np.ndarray, "T P"]
    speeds: Float[np.ndarray, "T P"]
    sides: tuple[str, ...]
    unexplained: Float[np.ndarray, "T 2"]
    limits: tuple[LimitExcess, ...]

    @property
    def implausible(self) -> Bool[np.ndarray, "T"]:
        """Frames with any flag."""
        return np.any(list(self.flags.values()), axis=0)

    @property
    def shares(self) -> dict[str, float]:
        """The share of frames with each flag, by letter."""
        return {letter: float(flag.mean()) for letter, flag in self.flags.items()}

    @property
    def limit_shares(self) -> dict[str, float]:
        """The share of frames beyond the limits, by joint."""
        return {each.joint: float((each.excess > 0).any(axis=1).mean()) for each in self.limits}


@dataclass(frozen=True, eq=False)
class Report:
    """How believable a motion is, beside the motion it was made from where there is one."""

    clip: Measured
    source: Measured | None
    drift: Drift | None
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]

    @property
    def implausible(self) -> float:
        """The headline: the share of frames with any flag."""
        return float(self.clip.implausible.mean())

    def text(self, *, color: bool = False) -> str:
        """What a person reads: headline, parts, and what to mend; with ANSI colours on request."""
        from sim.report.text import render  # it reads this class

        return render(self, color=color)

    def json(self) -> dict[str, Any]:
        """The report for a program, as plain dicts, lists and numbers; SI, units in the keys."""
        from sim.report.record import record  # it reads this class

        return record(self)
