"""Walks in place: motions whose travel was taken out, as of a game's walk cycles and Mixamo's "In
Place" downloads.

Their feet pass over the floor as over a treadmill's belt: those that stand all go back at one
velocity, which the body lacks. What was taken out may be an even pace, about which the hips still
sway (Mixamo), or the hips' own path, so that it changes within a step.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.ndimage import gaussian_filter1d

from spark.constants import GRAVITY
from spark.rig.contacts import (
    ADULT_HEIGHT,
    PLANTED_HEIGHT,
    PLANTED_SPEED,
    above,
    lower_ends,
    planted_points,
    velocities,
)
from spark.rotation import yaw_from_quat
from spark.runs import true_runs
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.hip_sway import center_of_mass
from spark.transfer.loops import continued
from spark.transfer.noise import without_noise
from spark.transfer.pressure import NOISE, acceleration
from spark.transfer.soles import sole_paths

_LEAST_TIME = 0.4  # [s] from the first to the last frame: in less, any foot that slips tells one
# All speeds [m/s] are of an adult.
_LEAST_PACE = 2 * PLANTED_SPEED  # that a body lacks: feet that tremble have less,
_MOST_WAY = 0.4  # and of that, at which its hips go: who slides or skates goes with the feet
MOST_STANDS = 0.5  # of the frames, in which a foot stands on the floor: slow walkers halt
_LEAST_STANDS = 0.15  # of the frames, in which one would stand: runners have no more,
_LEAST_HELD = 0.8  # and in which one would, or the body falls freely, but for
_GAP = 0.2  # [s] at most in between: feet that come down and leave tell another velocity
_EXACT = 0.1  # of its speed, to which a fast belt's is known: feet on it may seem as fast
_FALLS = 0.35  # [body weights] of push below which nothing holds the body up
_LEVEL = 0.3  # up or down, of a foot that hardly tells the belt's velocity
_TELLS = 0.1  # how much of what a level one does it tells at least
_ABOUT = 0.35  # from the belt's velocity to that of a foot on it, at most: it is not known better
_SPANS = (0.5, 0.25, 0.12, 0.06)  # [s] of Gaussians, first over strides, last within steps
_FEW = 1e-3  # feet as many as which the velocity over longer spans counts: in flight it stays
_STARTS, _SHIFTS, _MOST_POINTS = 60, 15, 4000  # of mean shift

Paths = Float[np.ndarray, "T S 2 3"]
Velocities = Float[np.ndarray, "T 2"]


def with_travel(source: CanonicalMotion) -> tuple[CanonicalMotion, tuple[str, ...]]:
    """`source` with the way over the ground that was taken out, if it walks in place, and a note
    that says how fast it is then; else as it is, and no note."""
    way = way_taken_out(source)
    if way is None:
        return source, ()
    note = (
        f"the source walks in place, as on a treadmill: it is taken to go over the ground "
        f"at {pace_of(way, source.frame_time):.2f} m/s, as its feet tell"
    )
    return replace(source, hips=source.hips + way), (note,)


def belt_note(way: Float[np.ndarray, "T 3"], frame_time: float, travel: float) -> str:
    """That feet stand on a belt under a source which lacks a `way` [m, world], and under a body
    which goes `travel` times as far: the speed at which a game has to move that."""
    pace = pace_of(way, frame_time)
    return (
        f"the source walks in place, as on a treadmill at {pace:.2f} m/s: feet stand on its belt, "
        f"which goes at {travel * pace:.2f} m/s under this body"
    )


def pace_of(way: Float[np.ndarray, "T 3"], frame_time: float) -> float:
    """The mean speed along a way [m/s]."""
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).mean() / frame_time)


def way_lacked(source: CanonicalMotion) -> Float[np.ndarray, "T 3"] | None:
    """`way_taken_out` of a motion as it is retargeted: without noise, as a loop that goes on."""
    longer, own = continued(source)
    way = way_taken_out(without_noise(longer)[0])
    return None if way is None else way[own] - way[own][0]


def way_taken_out(source: CanonicalMotion) -> Float[np.ndarray, "T 3"] | None:
    """The way over the ground [m, world] that a walk in place lacks, from 0 in its first frame on.

    None for any other motion: if feet stand, if no velocity of the body lets them, or if the hips
    go over the ground themselves; and for what is too short to tell.
    """
    rig, frame_time = source.rig, source.frame_time
    count = len(source)
    if len(rig.soles) < 2 or count < 3 or (count - 1) * frame_time < _LEAST_TIME:
        return None
    paths, height = sole_paths(source)[1], rig.standing_height
    if _stand(paths, height, frame_time).mean() > MOST_STANDS:
        return None
    yaw = np.unwrap(yaw_from_quat(source.rotations[:, rig.pelvis]))
    lacks = _lacking(paths, _smooth(yaw, _SPANS[0], frame_time), height, frame_time)
    if lacks is None:
        return None
    pace = slow_speed(lacks, frame_time)
    hips = slow_speed(velocities(source.hips, frame_time)[:, :2], frame_time)
    if pace < _LEAST_PACE * height / ADULT_HEIGHT or hips > _MOST_WAY * pace:
        return None
    way = np.zeros((count, 3))
    way[1:, :2] = np.cumsum(lacks[1:] + lacks[:-1], axis=0) * frame_time / 2
    return way if _explains(source, paths + way[:, None, None], pace) else None


def _explains(source: CanonicalMotion, paths: Paths, pace: float) -> bool:
    """Whether feet that go on their `paths` at a body's `pace` [m/s] carry it."""
    height, frame_time = source.rig.standing_height, source.frame_time
    exact = max(1.0, _EXACT * pace / (PLANTED_SPEED * height / ADULT_HEIGHT))
    stands = _stand(paths / [exact, exact, 1.0], height, frame_time)
    lost = [stop - start for start, stop in true_runs(~stands & ~_falls(source))]
    held = 1 - sum(frames for frames in lost if frames * frame_time > _GAP) / len(source)
    return bool(stands.mean() > _LEAST_STANDS and held > _LEAST_HELD)


def slow_speed(velocity: Velocities, frame_time: float) -> float:
    """The RMS of what of a velocity is slower than steps [m/s]."""
    return float(np.sqrt(np.square(_smooth(velocity, _SPANS[0], frame_time)).sum(axis=1).mean()))


def _lacking(
    paths: Paths, yaw: Float[np.ndarray, "T"], height: float, frame_time: float
) -> Velocities | None:
    """The velocity over the ground [m/s] that a body lacks for the feet that are low and level to
    stand: first the one that most of them tell, seen by who turns by `yaw` [rad], then the mean of
    those near it, over ever shorter times. None where none is low."""
    scale = height / ADULT_HEIGHT
    low = (above(paths, height) < PLANTED_HEIGHT * scale) & lower_ends(paths, height)
    moves = velocities(paths, frame_time)
    tells = low * np.exp(-((moves[..., 2] / (_LEVEL * scale)) ** 2))
    back, some = -moves[..., :2], tells > _TELLS
    if not some.any():
        return None
    turned = np.exp(1j * yaw)
    ahead = (back[..., 0] + 1j * back[..., 1]) / turned[:, None, None]
    commonest = turned * _commonest(ahead[some], tells[some], PLANTED_SPEED * scale)
    lacks = np.column_stack([commonest.real, commonest.imag])
    for span in _SPANS:
        near = tells * _bell(np.linalg.norm(back - lacks[:, None, None], axis=-1), _ABOUT * scale)
        told = _smooth(np.einsum("tse,tsex->tx", near, back), span, frame_time)
        many = _smooth(near.sum(axis=(1, 2)), span, frame_time)[:, None]
        lacks = (told + _FEW * lacks) / (many + _FEW)
    return lacks


def _commonest(
    told: Complex[np.ndarray, "N"], weights: Float[np.ndarray, "N"], width: float
) -> complex:
    """The velocity that most are near (mean shift: Fukunaga and Hostetler 1975)."""
    every = -(-len(told) // _MOST_POINTS)
    told, weights = told[::every], weights[::every]
    modes = told[:: -(-len(told) // _STARTS)]
    for _ in range(_SHIFTS):
        near = weights * _bell(np.abs(told - modes[:, None]), width)
        modes = near @ told / near.sum(axis=1)
    return complex(modes[near.sum(axis=1).argmax()])


def _bell(away: Float[np.ndarray, "*n"], width: float) -> Float[np.ndarray, "*n"]:
    return np.asarray(np.exp(-((away / width) ** 2) / 2))


def _smooth(
    values: Float[np.ndarray, "T *n"], span: float, frame_time: float
) -> Float[np.ndarray, "T *n"]:
    return np.asarray(gaussian_filter1d(values, span / frame_time, axis=0, mode="nearest"))


def _stand(paths: Paths, height: float, frame_time: float) -> Bool[np.ndarray, "T"]:
    """When a heel or toe stands."""
    stand = planted_points(paths, frame_time, height) & lower_ends(paths, height)
    return np.asarray(stand.any(axis=(1, 2)))


def _falls(source: CanonicalMotion) -> Bool[np.ndarray, "T"]:
    """When nothing holds the body up."""
    weight = _smooth(center_of_mass(source), NOISE, source.frame_time)
    return np.less(acceleration(weight, source.frame_time)[:, 2], (_FALLS - 1) * GRAVITY)
