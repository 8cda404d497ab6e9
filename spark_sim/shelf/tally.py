"""What a run of a batch came to."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Tally:
    """How many motions of each kind there were, and why those that failed did; how many
    `frames` it made, and which `share` of its work, by the bytes of the sources, is done."""

    written: int = 0
    unchanged: int = 0
    left_out: int = 0
    frames: int = 0
    share: float = 0.0
    reasons: list[tuple[str, str]] = field(default_factory=list)

    @property
    def failed(self) -> int:
        """How many jobs failed."""
        return len(self.reasons)

    def sentence(self) -> str:
        """`11 written, 1 unchanged, 1 failed: walk.bvh: is empty`."""
        counts = {
            "written": self.written,
            "unchanged": self.unchanged,
            "left out by --keep": self.left_out,
            "failed": self.failed,
        }
        words = ", ".join(f"{n} {what}" for what, n in counts.items() if n) or "nothing to do"
        kinds = Counter(reason for _, reason in self.reasons)
        first = {reason: source for source, reason in reversed(self.reasons)}
        why = [
            f"{first[reason]}: {reason}" + (f" (and {n - 1} more)" if n > 1 else "")
            for reason, n in kinds.most_common(3)
        ]
        if len(kinds) > 3:
            why.append(f"and {len(kinds) - 3} other reasons, in the manifest")
        return words + (f": {'; '.join(why)}" if why else "")
