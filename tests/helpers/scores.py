"""How far a motion is from the right one."""

from spark.evaluation.metrics import Score, san_height, score_positions
from spark.transfer.canonical import CanonicalMotion, canonical_positions


def score(result: CanonicalMotion, truth: CanonicalMotion) -> Score:
    """Of two motions on one rig."""
    own, theirs = canonical_positions(result), canonical_positions(truth)
    return score_positions(own, theirs, truth.rig, truth.frame_time, san_height(truth.rig))
