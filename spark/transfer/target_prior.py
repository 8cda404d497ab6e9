"""What a body's own recording tells of the joints that a source lacks.

A target is often a recording itself. Put on the source's skeleton and back, its motion shows what
copying loses between these two: how its spine shares a bend, how its wearer holds neck and
shoulders. A ridge regression from the parts of the body that the source has tells the same of any
motion. How far it is trusted is how well it foretells quarters of the recording from the others.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from spark.errors import name_list
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import (
    quat_from_rotvec,
    quat_mul,
    quat_relative,
    rotvec_from_quat,
    sixd_from_quat,
)
from spark.transfer.analytic import Correspondence, correspond, transfer
from spark.transfer.canonical import FRAME_TIME, CanonicalMotion, at_frame_time

_SPANS, _SPAN = 10, 100  # so many parts of a recording, of so many frames at 30 fps, are looked at
SHORTEST = 2.0  # [s] of a recording that tells anything
_STILL = 0.2  # a body whose features all stay closer than this stands, as in a T-pose
_LITTLE = 0.05  # of the way from one joint to another
_FOLDS = 4
_RIDGE = 0.2  # of the variance of a feature
_LEAST = 0.1  # a feature that varies less, in units of a rotation matrix, isn't blown up
_RANGE = 2.5  # standard deviations beyond which a feature says nothing more
_PARTS = (  # each seen from the chest, or from the pelvis
    (Role.HEAD, Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM),
    (Role.LEFT_UPPER_LEG, Role.RIGHT_UPPER_LEG),
)


RetargetMethod = Callable[[CanonicalMotion, Rig], CanonicalMotion]
"""Puts a motion on a rig: the analytic transfer, or a trained network."""


def with_target_prior(
    method: RetargetMethod, source: CanonicalMotion, own: CanonicalMotion
) -> CanonicalMotion:
    """What `method` makes of `source` on the rig of `own`, a recording, joints that had to be
    guessed (`Correspondence.unmatched`) turned as they turn in `own` with the rest of the body.

    Unchanged where nothing is a guess, or where `own` is short, doesn't move, or foretells nothing.
    """
    moved = method(source, own.rig)
    link = correspond(source.rig, own.rig)
    joints = _foretold(source.rig, own.rig, link)
    spans = _spans(own) if len(joints) else []
    if not spans:
        return moved
    backs = [method(transfer(span, source.rig), own.rig) for span in spans]
    lost = [
        rotvec_from_quat(quat_relative(back.rotations[:, joints], span.rotations[:, joints]))
        for back, span in zip(backs, spans, strict=True)
    ]
    features = np.concatenate([_features(back) for back in backs])
    if np.ptp(features, axis=0).max() < _STILL:
        return moved
    habits = _learn(features, np.concatenate(lost))
    if not habits.share.any():
        return moved
    turns = quat_from_rotvec(habits.of(_features(moved)))
    names = name_list([own.rig.skeleton.names[j] for j in joints])
    return replace(
        moved,
        rotations=_turned(moved.rotations, joints, link.unmatched, turns),
        notes=(*moved.notes, f"{names}: corrected by the target's own motion"),
    )


def _foretold(source: Rig, target: Rig, link: Correspondence) -> Int[np.ndarray, "K"]:
    """The guesses whose neighbours in the source have a counterpart in the target: what others
    would do in the target's own motion is a guess as well."""
    unmatched_joints = np.flatnonzero(link.unmatched == np.arange(len(link.unmatched)))
    told = correspond(target, source).unmatched < 0
    first, second = (told[joints[unmatched_joints]] for joints in (link.first, link.second))
    mix = link.mix[unmatched_joints]
    return unmatched_joints[(first | (mix > 1 - _LITTLE)) & (second | (mix < _LITTLE))]


@dataclass(frozen=True, eq=False)
class _Habits:
    """What K joints do, linear in F features: `rest`, `slopes` [rad]; how far that is trusted."""

    center: Float[np.ndarray, "F"]
    spread: Float[np.ndarray, "F"]
    rest: Float[np.ndarray, "D"]
    slopes: Float[np.ndarray, "F D"]
    share: Float[np.ndarray, "K"]

    def of(self, features: Float[np.ndarray, "T F"]) -> Float[np.ndarray, "T K 3"]:
        told = self.rest + _scaled(features, self.center, self.spread) @ self.slopes
        return self.share[:, None] * told.reshape(len(told), -1, 3)


def _learn(features: Float[np.ndarray, "T F"], lost: Float[np.ndarray, "T K 3"]) -> _Habits:
    center, spread = features.mean(0), np.maximum(features.std(0), _LEAST)
    X, Y = _scaled(features, center, spread), lost.reshape(len(lost), -1)
    told = np.empty_like(Y)
    for fold in np.array_split(np.arange(len(Y)), _FOLDS):
        others = np.delete(np.arange(len(Y)), fold)
        rest, slopes = _ridge(X[others], Y[others])
        told[fold] = rest + X[fold] @ slopes
    agree, size = ((told * of).reshape(lost.shape).sum((0, 2)) for of in (Y, told))
    share = np.clip(agree / np.maximum(size, 1e-12), 0.0, 1.0)
    return _Habits(center, spread, *_ridge(X, Y), share)


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
    return _RANGE * np.tanh((features - center) / spread / _RANGE)


def _features(motion: CanonicalMotion) -> Float[np.ndarray, "T F"]:
    """How chest, head, arms and legs are turned against each other, as columns of matrices: those
    don't jump."""
    rig, rotations = motion.rig, motion.rotations
    seen = [quat_relative(rotations[:, rig.pelvis], rotations[:, rig.chest])]
    for base, roles in zip((rig.chest, rig.pelvis), _PARTS, strict=True):
        parts = [rig.roles.joint(role) for role in roles]
        seen += [quat_relative(rotations[:, base], rotations[:, j]) for j in parts if j is not None]
    return np.concatenate([sixd_from_quat(q) for q in seen], -1)


def _turned(
    rotations: Float[np.ndarray, "T J 4"],
    joints: Int[np.ndarray, "K"],
    unmatched: Int[np.ndarray, "J"],
    turns: Float[np.ndarray, "T K 4"],
) -> Float[np.ndarray, "T J 4"]:
    """Joints turned in their own axes, and what only follows them, with them."""
    out = rotations.copy()
    out[:, joints] = quat_mul(rotations[:, joints], turns)
    for k in joints.tolist():
        for j in np.flatnonzero(unmatched == k).tolist():
            if j != k:
                out[:, j] = quat_mul(out[:, k], quat_relative(rotations[:, k], rotations[:, j]))
    return out


def _spans(own: CanonicalMotion) -> list[CanonicalMotion]:
    """Parts of a recording, spread over it; none of a short one."""
    if len(own) * own.frame_time < SHORTEST:
        return []
    size = min(max(1, round(_SPAN * FRAME_TIME / own.frame_time)), len(own))
    count = min(_SPANS, len(own) // size)
    firsts = np.linspace(0, len(own) - size, count).astype(int).tolist()
    return [at_frame_time(own.frames(at, at + size), FRAME_TIME) for at in firsts]
