"""Loops: motions whose end goes on at their beginning, as a walk cycle or a dance of a game.

What is fitted to a motion as a whole knows nothing of what comes before its first frame and after
its last one, and brings a body to rest there. A loop says what comes: itself. Seen as going on, it
is fitted at its ends as in its middle, and closes.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from spark.blocks import blocks
from spark.resample import frames_of_keys, rotations_at, values_at
from spark.rotation import (
    quat_conj,
    quat_from_yaw,
    quat_mul,
    quat_relative,
    rotvec_from_quat,
    yaw_from_quat,
)
from spark.transfer.canonical import CanonicalMotion

AROUND = 1.0  # [s] that are seen before and after a loop: what ends do reaches no further
_LEAST_TIME = 0.4  # [s] from the first to the last frame: a cycle of a fast run has 0.6
# The pose that goes on differs from the first one by no more than this: [rad] of any joint, and
_OFF = np.radians(1.0)
_OFF_HEIGHT = 0.01  # [hip heights]. Recorded people don't come back as near.
_MOST = 0.9  # of the largest jump: what hangs on a joint jumps with it
_SAME = 0.05  # [frames] nearer, the last frame is the first one

Ints: TypeAlias = Int[np.ndarray, "S"]


class Loop(NamedTuple):
    """A motion that goes on after `period` frames, turned by `yaw` [rad] and, after that, moved by
    `move` [m] over the floor, as x + iy."""

    period: float
    yaw: float
    move: complex


def loop_of(source: CanonicalMotion) -> Loop | None:
    """How `source` goes on where it ends, if its first frame follows its last one as any frame does
    the one before; or is that one again, as animators close loops. Else None."""
    count = len(source)
    if count < 3 or (count - 1) * source.frame_time < _LEAST_TIME:
        return None
    before, gap, after = _steps(source, [count - 2, count - 1, 0], [count - 1, 0, 1])
    pace = (before + after) / 2
    way = float((gap * pace).sum() / max(float(np.square(pace).sum()), 1e-12))
    way = 0.0 if way < _SAME else min(way, 1.0)
    off = np.append(np.full(len(gap) - 1, _OFF), _OFF_HEIGHT * source.rig.hip_height)
    if (np.abs(gap - way * pace) > off).any():
        return None
    jolts = _jolts(source)
    jolts[:-1] = jolts[:-1].max()  # of any joint: where loops are closed, one may halt
    if (np.abs(after - before) > jolts + off).any():
        return None
    ends = [0, 1, count - 2, count - 1]
    headings = np.unwrap(yaw_from_quat(source.rotations[ends, source.rig.pelvis]))
    places = source.hips[ends, 0] + 1j * source.hips[ends, 1]
    turn = headings[3] - headings[0] + way * (np.diff(headings)[[0, 2]]).mean()
    # The first step, seen from there as it begins at the end.
    ahead = np.exp(1j * turn)
    end = places[3] + way * (ahead * (places[1] - places[0]) + places[3] - places[2]) / 2
    return Loop(count - 1 + way, float(turn), complex(end - ahead * places[0]))


def continued(source: CanonicalMotion) -> tuple[CanonicalMotion, slice]:
    """`source` with what comes in the seconds before and after it (`AROUND`), and its own frames
    among these; as it is if it is no loop."""
    loop, count = loop_of(source), len(source)
    if loop is None:
        return source, slice(0, count)
    around = round(AROUND / source.frame_time)
    time = np.arange(-around, count + around)
    rounds = np.floor(time / loop.period)
    rounds[around : around + count] = 0.0  # the last frame of its own stays what it is
    keys, key_times = source, np.arange(count, dtype=np.float64)
    if loop.period > count - 1:
        rotations, hips = _gone_on(loop, np.ones(1), source.rotations[:1], source.hips[:1])
        keys = replace(
            source,
            rotations=np.concatenate([source.rotations, rotations]),
            hips=np.concatenate([source.hips, hips]),
        )
        key_times = np.append(key_times, loop.period)
    at = frames_of_keys(key_times, time - rounds * loop.period)
    rotations, hips = rotations_at(keys.rotations, at), values_at(keys.hips, at)
    rotations, hips = _gone_on(loop, rounds, rotations, hips)
    return replace(source, rotations=rotations, hips=hips), slice(around, around + count)


def leap(ends: CanonicalMotion, loop: Loop, count: int) -> tuple[float, int]:
    """By how much [rad] joints jump at most where a motion goes on that should as a `loop` of
    `count` frames, and the first joint that does. `ends` are its first two and last two frames."""
    before, gap, after = _steps(ends, [2, 3, 0], [3, 0, 1])
    beyond = gap - (loop.period - (count - 1)) * (before + after) / 2
    angles = np.linalg.norm(beyond[:-1].reshape(-1, 3), axis=1)
    most, held = float(angles.max()), ends.rig.roles.held
    return most, min(held[k] for k in np.flatnonzero(angles >= _MOST * most))


def _gone_on(
    loop: Loop,
    rounds: Float[np.ndarray, "T"],
    rotations: Float[np.ndarray, "T J 4"],
    hips: Float[np.ndarray, "T 3"],
) -> tuple[Float[np.ndarray, "T J 4"], Float[np.ndarray, "T 3"]]:
    """Frames of the first round as those of others, before it (below 0) and after it."""
    turns = np.exp(1j * loop.yaw * rounds)
    straight = abs(np.exp(1j * loop.yaw) - 1) < 1e-9
    moves = loop.move * (rounds if straight else (turns - 1) / (np.exp(1j * loop.yaw) - 1))
    places = turns * (hips[:, 0] + 1j * hips[:, 1]) + moves
    turned = quat_mul(quat_from_yaw(loop.yaw * rounds)[:, None], rotations)
    return turned, np.column_stack([places.real, places.imag, hips[:, 2]])


def _jolts(source: CanonicalMotion) -> Float[np.ndarray, "D"]:
    """By how much steps from frame to frame change at most."""
    spans = (np.arange(b.start, b.stop + 2) for b in blocks(len(source) - 2))
    steps = (_steps(source, frames[:-1], frames[1:]) for frames in spans)
    jolts: Float[np.ndarray, D] = np.max(
        [np.abs(np.diff(some, axis=0)).max(axis=0) for some in steps], axis=0
    )
    return jolts


def _steps(
    source: CanonicalMotion, starts: Sequence[int] | Ints, stops: Sequence[int] | Ints
) -> Float[np.ndarray, "S D"]:
    """From some frames to others: the turns [rad] of joints with roles in the heading of the hips,
    as rotation vectors, and how far the hips rise [m]."""
    held, pelvis = source.rig.roles.held, source.rig.pelvis

    def turns(frames: Sequence[int] | Ints) -> Float[np.ndarray, "S K 4"]:
        back = quat_conj(quat_from_yaw(yaw_from_quat(source.rotations[frames, pelvis])))
        return quat_mul(back[:, None], source.rotations[frames][:, held])

    turned = rotvec_from_quat(quat_relative(turns(starts), turns(stops)))
    rise = source.hips[stops, 2] - source.hips[starts, 2]
    return np.column_stack([turned.reshape(len(turned), -1), rise])
