"""How far a result is from the ground truth, in body heights, so that bodies compare.

`san_mse` is the metric of Skeleton-Aware Networks (Aberman et al. 2020), in which the literature
reports: the mean over frames, joints and x, y, z of `(d / h)^2`, with the root as predicted and
nothing aligned; then the mean over a character's clips, then over characters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np
from jaxtyping import Bool, Float

from spark.network.features import body_features
from spark.rig.contacts import planted_feet, speeds
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_rotate


@dataclass(frozen=True)
class Score:
    """One result against its ground truth; lengths in body heights h.

    `relative_mse` and `mpjpe` [% of h] are root-relative and global. `foot_speed` [h/s] is that of
    the feet where the truth's stand, `jerk` [h/s³] the joints' root mean square; both with the
    truth's own beside them. NaN where the truth's feet never stand, or the clip is too short.
    """

    mse: float
    relative_mse: float
    mpjpe: float
    foot_speed: float
    truth_foot_speed: float
    jerk: float
    truth_jerk: float


def score_positions(
    own: Float[np.ndarray, "T J 3"],
    truth: Float[np.ndarray, "T J 3"],
    rig: Rig,
    frame_time: float,
    height: float,
) -> Score:
    """Positions on `rig` against the true ones, over the joints of its body (no fingers, hair,
    clothes); lengths in one unit, that of `height` too."""
    joints = body_features(rig).joints
    planted = planted_feet(rig, truth, frame_time)
    feet, pelvis = rig.contact_joints, rig.pelvis
    return Score(
        san_mse(own[:, joints], truth[:, joints], height),
        san_mse(_relative(own, pelvis)[:, joints], _relative(truth, pelvis)[:, joints], height),
        mpjpe(own[:, joints], truth[:, joints], height),
        foot_speed(own[:, feet], planted, frame_time, height),
        foot_speed(truth[:, feet], planted, frame_time, height),
        jerk(own[:, joints], frame_time, height),
        jerk(truth[:, joints], frame_time, height),
    )


def mean_score(scores: Mapping[str, Sequence[Score]]) -> Score:
    """The mean over each character's clips, then over the characters; NaN is left out, and the mean
    of nothing."""
    clips = [np.array([astuple(s) for s in of_one]) for of_one in scores.values()]
    of_characters = np.array([_mean(values) for values in clips]).reshape(-1, len(fields(Score)))
    return Score(*_mean(of_characters).tolist())


def san_mse(
    positions: Float[np.ndarray, "T J 3"], truth: Float[np.ndarray, "T J 3"], height: float
) -> float:
    """The mean over frames, joints and axes of the squared error in heights."""
    return float(np.mean(((positions - truth) / height) ** 2))


def mpjpe(
    positions: Float[np.ndarray, "T J 3"], truth: Float[np.ndarray, "T J 3"], height: float
) -> float:
    """The mean distance of joints from where they should be [% of the height]."""
    return float(100 * np.mean(np.linalg.norm(positions - truth, axis=-1)) / height)


def foot_speed(
    feet: Float[np.ndarray, "T F 3"],
    planted: Bool[np.ndarray, "T F"],
    frame_time: float,
    height: float,
) -> float:
    """Mean horizontal speed [heights/s] of the feet in the frames in which they should stand."""
    if not planted.any():
        return float("nan")
    return float(np.mean(speeds(feet, frame_time)[planted]) / height)


def jerk(positions: Float[np.ndarray, "T J 3"], frame_time: float, height: float) -> float:
    """Root mean square of the joints' third derivative [heights/s³]."""
    if len(positions) < 4:
        return float("nan")
    third = np.linalg.norm(np.diff(positions, 3, axis=0), axis=-1) / frame_time**3
    return float(np.sqrt(np.mean(third**2)) / height)


def source_sensitivity(
    results: Sequence[Float[np.ndarray, "_ J 3"]], truths: Sequence[Float[np.ndarray, "_ J 3"]]
) -> float:
    """Whether other sources give other results: how far the results of different clips on one body
    are from one another, over how far their truths are. 1 for what carries all of the source, 0 for
    what ignores it. Positions are root-relative; over the frames that both clips of a pair have.
    """

    def distance(clips: Sequence[Float[np.ndarray, "_ J 3"]], i: int, k: int) -> float:
        count = min(len(clips[i]), len(clips[k]))
        return float(np.linalg.norm(clips[i][:count] - clips[k][:count], axis=-1).mean())

    pairs = [(i, k) for i in range(len(truths)) for k in range(i)]
    expected = sum(distance(truths, i, k) for i, k in pairs)
    found = sum(distance(results, i, k) for i, k in pairs)
    return float(found / expected) if expected > 0 else float("nan")


def san_height(rig: Rig) -> float:
    """The chain of bones from the pelvis to the end of the left toe, and that to the end of the
    head [m]. A chain stops at its last joint that the rig has."""
    return _chain(rig, (Role.LEFT_TOE, Role.LEFT_FOOT), 0) + _chain(rig, (Role.HEAD, Role.NECK), 2)


def _chain(rig: Rig, roles: tuple[Role, ...], axis: int) -> float:
    """Length [m] from the pelvis over the joint of the first role there is to that joint's end: of
    its children and End Sites the one furthest along `axis` in the T-pose."""
    skeleton = rig.skeleton
    joint = next((j for role in roles for j in rig.roles.joints(role)[-1:]), None)
    if joint is None:
        return 0.0
    chain = [j for j in skeleton.ancestors(joint) if rig.pelvis in skeleton.ancestors(j)[1:]]
    length = float(np.linalg.norm(skeleton.offsets[chain], axis=-1).sum())
    below = [skeleton.offsets[list(skeleton.children[joint])]]
    below.append(skeleton.end_offsets[skeleton.end_parents == joint])
    ends = np.concatenate(below)
    if len(ends):
        turned = quat_rotate(np.broadcast_to(rig.tpose[joint], (len(ends), 4)), ends)
        length += float(np.linalg.norm(ends[np.argmax(turned[:, axis])]))
    return length


def _relative(positions: Float[np.ndarray, "T J 3"], root: int) -> Float[np.ndarray, "T J 3"]:
    return positions - positions[:, root : root + 1]


def _mean(values: Float[np.ndarray, "N M"]) -> Float[np.ndarray, "M"]:
    """Means of columns over their numbers that are there; NaN where there is none."""
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(0)
    count = known.sum(0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
