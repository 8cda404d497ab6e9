"""A prior from the target's own recording, for the joints that a source lacks.

A target is often a recording itself. Put on the source's skeleton and back, it shows what copying
loses between these two rigs: how the target's spine shares a bend, how its wearer holds neck and
shoulders. A ridge regression predicts that loss from the parts of the body that the source has.
Each joint's correction is scaled by how well quarters of the recording are predicted from the
others (cross-validation).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from spark.blocks import in_blocks
from spark.errors import name_list
from spark.rig.rig import Rig
from spark.rig.roles import UPPER_LEGS, Role
from spark.rotation import quat_from_rotvec, quat_mul, quat_relative, rotvec_from_quat
from spark.sixd import sixd_from_quat
from spark.transfer.analytic import Correspondence, correspond, transfer
from spark.transfer.canonical import FRAME_TIME, CanonicalMotion, at_frame_time

MIN_DURATION = 2.0  # [s] of a recording that a prior is learned from
_MAX_CLIPS, _CLIP_FRAMES = 10, 100  # what is looked at: clips spread over it, frames at 30 fps each
_MIN_RANGE = 0.2  # of rotation matrix entries; a body whose features all vary less stands still
_MIN_MIX = 0.05  # of the way between two joints; a joint this near to one depends on it alone
_FOLDS = 4  # of the cross-validation
_RIDGE = 0.2  # regularisation, in variances of a feature
_MIN_SPREAD = 0.1  # of rotation matrix entries; a feature that varies less isn't blown up
_CLIP_AT = 2.5  # [standard deviations] a feature further from its mean predicts no more than this
_FEATURES = (  # seen from the chest, and from the pelvis
    (Role.HEAD, Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM),
    UPPER_LEGS,
)


RetargetMethod = Callable[[CanonicalMotion, Rig], CanonicalMotion]
"""Puts a motion on a rig: the analytic transfer, or a trained network."""


def with_target_prior(
    method: RetargetMethod, source: CanonicalMotion, recording: CanonicalMotion
) -> CanonicalMotion:
    """What `method` makes of `source` on the rig of `recording`, with its unmatched joints
    (`Correspondence.unmatched`) turned as they turn in `recording` with the rest of the body.

    Unchanged where all joints are matched, or where `recording` is short, stands still, or predicts
    nothing.
    """
    rig = recording.rig
    moved = method(source, rig)
    link = correspond(source.rig, rig)
    joints = _predictable(source.rig, rig, link)
    clips = _clips(recording) if len(joints) else []
    if not clips:
        return moved
    returned = [method(transfer(clip, source.rig), rig) for clip in clips]
    lost = [
        rotvec_from_quat(quat_relative(back.rotations[:, joints], clip.rotations[:, joints]))
        for back, clip in zip(returned, clips, strict=True)
    ]
    features = np.concatenate([_features(back) for back in returned])
    if np.ptp(features, axis=0).max() < _MIN_RANGE:
        return moved
    prior = _fit(features, np.concatenate(lost))
    if not prior.trust.any():
        return moved

    def corrected(block: slice) -> Float[np.ndarray, "T J 4"]:
        part = moved.picked(block)
        corrections = quat_from_rotvec(prior.predict(_features(part)))
        return _corrected(part.rotations, joints, link.unmatched, corrections)

    names = name_list([rig.skeleton.names[j] for j in joints])
    return replace(
        moved,
        rotations=in_blocks(corrected, len(moved)),
        notes=(*moved.notes, f"{names}: corrected by the target's own motion"),
    )


def _predictable(source: Rig, target: Rig, link: Correspondence) -> Int[np.ndarray, "K"]:
    """The unmatched joints whose neighbours in the source have a counterpart in the target. What
    the others would do is not known from the recording either."""
    joints = np.flatnonzero(link.unmatched == np.arange(len(link.unmatched)))
    matched = correspond(target, source).unmatched < 0
    first, second = (matched[ends[joints]] for ends in (link.first, link.second))
    mix = link.mix[joints]
    return joints[(first | (mix > 1 - _MIN_MIX)) & (second | (mix < _MIN_MIX))]


@dataclass(frozen=True, eq=False)
class _Prior:
    """The correction [rad] of K joints, linear in F features: `offset + slopes @ scaled features`,
    times the joint's `trust`, 0 to 1."""

    center: Float[np.ndarray, "F"]
    spread: Float[np.ndarray, "F"]
    offset: Float[np.ndarray, "D"]
    slopes: Float[np.ndarray, "F D"]
    trust: Float[np.ndarray, "K"]

    def predict(self, features: Float[np.ndarray, "T F"]) -> Float[np.ndarray, "T K 3"]:
        """Rotation vectors in the joints' own axes."""
        out = self.offset + _scaled(features, self.center, self.spread) @ self.slopes
        return self.trust[:, None] * out.reshape(len(out), -1, 3)


def _fit(features: Float[np.ndarray, "T F"], lost: Float[np.ndarray, "T K 3"]) -> _Prior:
    center, spread = features.mean(0), np.maximum(features.std(0), _MIN_SPREAD)
    X, Y = _scaled(features, center, spread), lost.reshape(len(lost), -1)
    predicted = np.empty_like(Y)
    for fold in np.array_split(np.arange(len(Y)), _FOLDS):
        others = np.delete(np.arange(len(Y)), fold)
        offset, slopes = _ridge(X[others], Y[others])
        predicted[fold] = offset + X[fold] @ slopes
    # The factor that brings the predictions nearest to what was lost, in least squares.
    agreement, size = (
        (predicted * other).reshape(lost.shape).sum((0, 2)) for other in (Y, predicted)
    )
    trust = np.clip(agreement / np.maximum(size, 1e-12), 0.0, 1.0)
    return _Prior(center, spread, *_ridge(X, Y), trust)


def _ridge(
    X: Float[np.ndarray, "T F"], Y: Float[np.ndarray, "T D"]
) -> tuple[Float[np.ndarray, "D"], Float[np.ndarray, "F D"]]:
    """The values at X = 0 and the slopes."""
    x, y = X.mean(0), Y.mean(0)
    X, Y = X - x, Y - y
    slopes = np.linalg.solve(X.T @ X + _RIDGE * len(X) * np.eye(X.shape[1]), X.T @ Y)
    return y - x @ slopes, slopes


def _scaled(
    features: Float[np.ndarray, "T F"],
    center: Float[np.ndarray, "F"],
    spread: Float[np.ndarray, "F"],
) -> Float[np.ndarray, "T F"]:
    return _CLIP_AT * np.tanh((features - center) / spread / _CLIP_AT)


def _features(motion: CanonicalMotion) -> Float[np.ndarray, "T F"]:
    """How chest, head, arms and legs are turned against each other, as columns of matrices, which
    are continuous."""
    rig, rotations = motion.rig, motion.rotations
    seen = [quat_relative(rotations[:, rig.pelvis], rotations[:, rig.chest])]
    for base, roles in zip((rig.chest, rig.pelvis), _FEATURES, strict=True):
        parts = [rig.roles.joint(role) for role in roles]
        seen += [quat_relative(rotations[:, base], rotations[:, j]) for j in parts if j is not None]
    return np.concatenate([sixd_from_quat(q) for q in seen], -1)


def _corrected(
    rotations: Float[np.ndarray, "T J 4"],
    joints: Int[np.ndarray, "K"],
    unmatched: Int[np.ndarray, "J"],
    corrections: Float[np.ndarray, "T K 4"],
) -> Float[np.ndarray, "T J 4"]:
    """Joints turned in their own axes, and with them the unmatched joints that follow them."""
    out = rotations.copy()
    out[:, joints] = quat_mul(rotations[:, joints], corrections)
    for k in joints.tolist():
        for j in np.flatnonzero(unmatched == k).tolist():
            if j != k:
                out[:, j] = quat_mul(out[:, k], quat_relative(rotations[:, k], rotations[:, j]))
    return out


def _clips(recording: CanonicalMotion) -> list[CanonicalMotion]:
    """Clips spread over a recording, at 30 fps; none of a short one."""
    if len(recording) * recording.frame_time < MIN_DURATION:
        return []
    size = min(max(1, round(_CLIP_FRAMES * FRAME_TIME / recording.frame_time)), len(recording))
    count = min(_MAX_CLIPS, len(recording) // size)
    starts = np.linspace(0, len(recording) - size, count).astype(int).tolist()
    return [at_frame_time(recording.frames(at, at + size), FRAME_TIME) for at in starts]
