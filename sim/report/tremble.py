"""Tremble and pops: what a body does from frame to frame that no window of derivatives shows."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import maximum_filter1d

from sim.report.strays import Strays, strays_of
from sim.report.thresholds import HUMAN_HIP_HEIGHT
from sim.trajectory import Subject
from spark.motion import Motion
from spark.resample import motion_at
from spark.runs import true_runs
from spark.summary import brief

# Twice as much as the source, and so much at least, is tremble: [m, of an adult] and [rad]. Without
# a source, what no recording of 140 keeps to: climbers' hands and hips reach 7 mm, joints 3.5°.
_TIMES_SOURCE = 2.0
_LEAST, _LEAST_ALONE = 0.0025, 0.008
_LEAST_TURN, _LEAST_TURN_ALONE = np.radians(0.5), np.radians(4.0)
# What trembles with the whole body does so no more than this many times as far as the base.
_OF_BASE = 1.5
# A joint pops that strays so far [rad] for a moment, so many times as far as it keeps to. Without a
# source it has to be faster, too: strikes and flips in films of 24 fps turn by 40 degrees a frame.
_POP, _POP_ALONE = np.radians(5.0), np.radians(12.0)
_POP_OF_LASTING = 4.0
_POP_SPEED = 20.0  # [rad/s]
_NEAR = 2  # frames before and after that belong to a pop


class Pop(NamedTuple):
    """A joint turns by `turn` [rad] from the frame before `frame`."""

    joint: str
    frame: int
    turn: float


@dataclass(frozen=True, eq=False)
class Tremble:
    """How far a body keeps straying from smooth ways, beside its source at the same times.

    `points` [m]: of the base and of the limbs' ends, by `point_names`; `joints` [rad]: by
    `joint_names`. The source's are scaled to the body, 0 where it lacks one. `points_far` and
    `joints_far` are where it is much more than the source's, and more than captured people have.
    """

    point_names: tuple[str, ...]
    points: Float[np.ndarray, "T P"]
    source_points: Float[np.ndarray, "T P"] | None
    points_far: Bool[np.ndarray, "T P"]
    joint_names: tuple[str, ...]
    joints: Float[np.ndarray, "T J"]
    source_joints: Float[np.ndarray, "T J"] | None
    joints_far: Bool[np.ndarray, "T J"]
    pops: tuple[Pop, ...]

    __repr__ = brief

    @property
    def largest(self) -> float:
        """Of the points, in the worst half second [m]."""
        return float(self.points.max())

    @property
    def source_largest(self) -> float | None:
        """The source's [m], scaled; None without one."""
        return None if self.source_points is None else float(self.source_points.max())


def tremble_beside(
    subject: Subject, source: Subject | None = None, times: Float[np.ndarray, "T"] | None = None
) -> Tremble:
    """Of a motion whose frames lie at `times` [s] of its source, where there is one."""
    motion, rig = subject.motion, subject.rig
    own = strays_of(rig, motion.picked, len(motion), motion.frame_time)
    if source is None or times is None:
        return tremble_of(own, None, 1.0)
    theirs, at = source.motion, times / source.motion.frame_time

    def picked(block: slice) -> Motion:
        return motion_at(theirs, at[block], motion.frame_time)

    beside = strays_of(source.rig, picked, len(motion), motion.frame_time)
    return tremble_of(own, beside, rig.hip_height / source.rig.hip_height)


def tremble_of(own: Strays, source: Strays | None, scale: float) -> Tremble:
    """Of a body `scale` times as high at the hips as its source, whose strays are at the same
    times."""
    size = own.lengths[0] / HUMAN_HIP_HEIGHT
    points, joints = own.lasting_points, own.lasting_joints
    least, least_turn = size * _LEAST_ALONE, _LEAST_TURN_ALONE
    source_points = source_joints = None
    bounds, joint_bounds = np.zeros_like(points), np.zeros_like(joints)
    if source is not None:
        least, least_turn = size * _LEAST, _LEAST_TURN
        known = [k for k, name in enumerate(own.point_names) if name in source.point_names]
        theirs = [source.point_names.index(own.point_names[k]) for k in known]
        scales = np.maximum(scale, own.lengths[known] / source.lengths[theirs])
        source_points = np.zeros_like(points)
        source_points[:, known] = scales * source.lasting_points[:, theirs]
        source_joints = _matched(own.joint_names, source.joint_names, source.lasting_joints)
        bounds, joint_bounds = _TIMES_SOURCE * source_points, _TIMES_SOURCE * source_joints
    bounds = np.maximum(bounds, least)
    bounds[:, 1:] = np.maximum(bounds[:, 1:], _OF_BASE * points[:, :1])
    return Tremble(
        point_names=own.point_names,
        points=points,
        source_points=source_points,
        points_far=points > bounds,
        joint_names=own.joint_names,
        joints=joints,
        source_joints=source_joints,
        joints_far=joints > np.maximum(joint_bounds, least_turn),
        pops=tuple(_pops(own, source)),
    )


def _matched(
    names: tuple[str, ...], others: tuple[str, ...], values: Float[np.ndarray, "T N"]
) -> Float[np.ndarray, "T M"]:
    """The columns of `others` that have the `names`, 0 where none has."""
    found = np.zeros((len(values), len(names)))
    for k, name in enumerate(names):
        if name in others:
            found[:, k] = values[:, others.index(name)]
    return found


def _pops(own: Strays, source: Strays | None) -> list[Pop]:
    """The turns of a frame or two that stand out of what is around them, the largest first."""
    bounds = _POP_OF_LASTING * own.lasting_pops
    if source is None:
        bounds = np.maximum(bounds, _POP_ALONE)
        fast = _around(own.turns) > _POP_SPEED * own.frame_time
    else:  # where any joint of it pops, one of the motion may that is turned about other axes
        theirs = _around(source.pops).max(axis=1, keepdims=True)
        bounds = np.maximum(bounds, np.maximum(_TIMES_SOURCE * theirs, _POP))
        fast = np.ones_like(own.turns, dtype=bool)
    pops = []
    for name, pop, turns in zip(
        own.joint_names, ((own.pops > bounds) & fast).T, own.turns.T, strict=True
    ):
        for start, stop in true_runs(pop, _NEAR):
            first = max(start - _NEAR, 0)
            frame = first + int(turns[first : stop + _NEAR].argmax())
            pops.append(Pop(name, frame, float(turns[frame])))
    return sorted(pops, key=lambda pop: -pop.turn)


def _around(values: Float[np.ndarray, "T N"]) -> Float[np.ndarray, "T N"]:
    """The largest within `_NEAR` frames."""
    return np.asarray(maximum_filter1d(values, 2 * _NEAR + 1, axis=0, mode="nearest"))
