"""What an assessment finds, as data."""

from dataclasses import dataclass

from sim.report.clip_metrics import ClipMetrics
from sim.report.limbs import Limbs
from sim.report.measures import ContactMatch, Drift
from sim.report.pose_error import PoseError
from sim.report.swing import Swing
from sim.report.tremble import Tremble
from sim.report.truth import Accuracy


@dataclass(frozen=True, eq=False)
class Finding:
    """One thing to look at: what, where, in which frames [start, stop), how much.

    `measure` is a name of `sim.report.names`. `amount` is in `unit` ("m", "rad", "bw" body weights,
    "bw_m"); `sentence` says it all, without the frames.
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
        first, last = self.start * frame_time, (self.stop - 1) * frame_time
        if self.stop - self.start == 1:
            return f"at frame {self.start} ({first:.2f} s)"
        digits = 1 if last - first >= 0.2 else 2
        seconds = f"{first:.{digits}f}-{last:.{digits}f} s"
        return f"in frames {self.start}-{self.stop - 1} ({seconds})"


@dataclass(frozen=True, eq=False)
class Result:
    """How believable a motion is, beside the motion it was made from where there is one, and how
    far from the ground truth where that is known.

    `clip.self_depth` is then what goes beyond the source's own self-penetration, and `scale` is the
    hip height over the source's. `swing` is None where the source's feet hardly swing, `limbs` and
    `pose` are of what both have.
    """

    clip: ClipMetrics
    source: ClipMetrics | None
    drift: Drift | None
    contacts: ContactMatch | None
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]
    tremble: Tremble
    truth: Accuracy | None = None
    swing: Swing | None = None
    limbs: Limbs | None = None
    pose: PoseError | None = None
    scale: float = 1.0

    @property
    def implausible(self) -> float:
        """The headline: the share of frames with any flag."""
        return self.clip.implausible_share
