"""How far a motion is from the one that is known to be right."""

from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from jaxtyping import Float

from spark.blocks import in_blocks
from spark.errors import SkeletonError
from spark.evaluation.metrics import san_height
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
    joints, height = body_features(rig).joints, san_height(rig)

    def apart(block: slice) -> Float[np.ndarray, "T 3"]:
        own, theirs = (
            canonical_positions(to_canonical(each.picked(block), rig)) for each in (motion, truth)
        )
        away = (own - theirs) / height
        relative = away - away[:, [rig.pelvis]]
        away, relative = away[:, joints], relative[:, joints]
        means = [(away**2).mean((1, 2)), (relative**2).mean((1, 2))]
        return np.column_stack([*means, np.linalg.norm(away, axis=-1).mean(axis=1)])

    found = in_blocks(apart, len(motion))
    mse, relative_mse, mpjpe = found.mean(axis=0).tolist()
    return Accuracy(mse, relative_mse, 100 * mpjpe, 100 * found[:, 2])


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
