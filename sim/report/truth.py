"""How far a motion is from the one that is known to be right."""

from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from jaxtyping import Float

from spark.errors import SkeletonError
from spark.evaluation.metrics import san_height, score
from spark.motion import Motion
from spark.network.features import body_features
from spark.rig.rig import Rig
from spark.transfer.canonical import canonical_positions, to_canonical

# Fraction of the hip height: joints whose offsets differ by more are of another body.
_BONE_TOLERANCE = 0.01


@dataclass(frozen=True, eq=False)
class Accuracy:
    """`mse` and `relative_mse` (root-relative) in the metric of Skeleton-Aware Networks, `mpjpe` [%
    of the height], all of `spark.evaluation.metrics`; `errors` [% of the height] is the joints'
    mean distance from where they should be, frame by frame."""

    mse: float
    relative_mse: float
    mpjpe: float
    errors: Float[np.ndarray, "T"]


def accuracy(motion: Motion, truth: Motion, rig: Rig) -> Accuracy:
    """`motion` against `truth`, both on the skeleton of `rig`, frame by frame, nothing aligned.

    Raises SkeletonError where the skeletons, the frame rates or the numbers of frames differ.
    """
    _check_skeletons(motion, truth, rig)
    if len(motion) != len(truth) or not np.isclose(motion.frame_time, truth.frame_time, rtol=1e-3):
        raise SkeletonError(
            f"the ground truth has {len(truth)} frames at {truth.fps:.4g} fps, the motion "
            f"{len(motion)} at {motion.fps:.4g}; expected the same frames: resample one of them"
        )
    own, theirs = to_canonical(motion, rig), to_canonical(truth, rig)
    result = score(own, theirs)
    joints = body_features(rig).joints
    away = (canonical_positions(own) - canonical_positions(theirs))[:, joints]
    errors = 100 * np.linalg.norm(away, axis=-1).mean(axis=1) / san_height(rig)
    return Accuracy(result.mse, result.relative_mse, result.mpjpe, errors)


def _check_skeletons(motion: Motion, truth: Motion, rig: Rig) -> None:
    own, theirs = motion.skeleton, truth.skeleton
    for one, other in zip_longest(own.names, theirs.names):
        if one != other:
            raise SkeletonError(
                f"the ground truth is on another skeleton: it has the joint {other!r} where the "
                f"motion has {one!r}; expected the same joints in the same order"
            )
    # Where the root stands is motion, not build.
    apart = np.linalg.norm(own.offsets - theirs.offsets, axis=1)[1:]
    if apart.max(initial=0.0) > _BONE_TOLERANCE * rig.hip_height:
        j = int(apart.argmax()) + 1
        raise SkeletonError(
            f"the ground truth is on a body of another build: its joint {own.names[j]!r} lies "
            f"{100 * apart[j - 1]:.1f} cm from where the motion's does on its parent"
        )
