"""The white noise of estimated motion, measured and taken away.

Motion estimated frame by frame, from video or by cheap trackers, trembles: each frame is off by
itself. Feet then seem too fast to stand. How far they tremble is seen in what bodies can't do, to
go to and fro from each frame to the next. Beyond what contacts bear, the motion is smoothed, no
more than until what is left moves a foot no faster than one that stands may move; recordings that
tremble less, as of markers or inertial sensors, stay as they are.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve_banded, cholesky_banded

from spark.blocks import in_blocks
from spark.rig.contacts import (
    ADULT_HEIGHT,
    PLANTED_SPEED,
    SPEED_WINDOW,
    floor_under,
)
from spark.rotation import quat_continuous, quat_normalize
from spark.second_differences import second_differences
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.soles import lowest_soles

# The product of a second difference with the next is of white noise -4 times its variance an axis
# in the mean, and of motion above 0. Its median, which no impact moves, is less far from 0:
_MEDIAN = 0.749  # of the mean, in three axes
LEAST_FRAMES = 24  # that tell noise from motion
BORNE_SPEED = PLANTED_SPEED / 3  # [m/s, of an adult] of noise (RMS, an axis) that contacts bear
LEAST_NOISE = BORNE_SPEED * SPEED_WINDOW / np.sqrt(2)  # [m, of an adult] that moves feet so fast
_LEAST_STEP_RATE = 2.5  # [Hz] below which steps would be smoothed away: they last half a second
_MAX_JOLT = 1.5  # [m/s², of an adult] of noise that hips are left with: walking ones reach 4
LEEWAY = 2.0  # standard deviations of what noise is left, by which standing feet may be faster
_ALL_BUT = 3.0  # standard deviations an axis, beyond which 1 % lies in two


@dataclass(frozen=True)
class Noise:
    """White noise of an adult's `feet` and `hips` [m], RMS an axis, every `frame_time` [s]."""

    feet: float
    hips: float
    frame_time: float

    @property
    def motion_cutoff(self) -> float:
        """Up to which frequency [Hz] a motion is worth following."""
        jolt = self.hips * np.sqrt(4 * np.pi**5 / np.sqrt(2) * self.frame_time)  # as in `_speed`
        by_hips = np.inf if jolt == 0 else (_MAX_JOLT / jolt) ** (2 / 5)
        return float(min(self._cutoff(PLANTED_SPEED), by_hips))

    @property
    def contact_cutoff(self) -> float:
        """Up to which frequency [Hz] feet are followed to tell whether they stand."""
        return max(self._cutoff(BORNE_SPEED), _LEAST_STEP_RATE)

    @property
    def stray(self) -> float:
        """Within what [m, of an adult] smoothed feet stray along the floor, but for a hundredth of
        the time. Their variance is the integral over frequency f of the noise's density,
        2 `frame_time` `feet`², times 1 / (1 + (f / cutoff)⁴)²."""
        band = 3 * np.pi / (8 * np.sqrt(2)) * self.motion_cutoff
        return float(_ALL_BUT * self.feet * np.sqrt(2 * self.frame_time * band))

    def slowed(self, paths: Float[np.ndarray, "T *n 3"]) -> Float[np.ndarray, "T *n 3"]:
        """Paths of feet, smoothed at `contact_cutoff`, with so much less of their way along the
        floor that limits for clean ones judge their speeds: noise makes up a part of these."""
        slowness = 1 / np.hypot(1.0, LEEWAY * self._speed(self.contact_cutoff) / PLANTED_SPEED)
        return paths * np.array([slowness, slowness, 1.0])

    def _cutoff(self, speed: float) -> float:
        """That leaves noise of a speed [m/s, RMS an axis]: see `_speed`."""
        return float((speed / self._speed(1.0)) ** (2 / 3))

    def _speed(self, cutoff: float) -> float:
        """[m/s, RMS an axis] of the noise that `smoothed` leaves: the integral over frequency f
        of its density, (2 pi f)² 2 `frame_time` `feet`², times 1 / (1 + (f / cutoff)⁴)²."""
        return float(self.feet * np.sqrt(np.pi**3 / np.sqrt(2) * self.frame_time * cutoff**3))


def without_noise(
    source: CanonicalMotion,
) -> tuple[CanonicalMotion, Noise | None, tuple[str, ...]]:
    """`source` smoothed as far as it trembles, how far that is, and a note that says so; as it is,
    None and no note where contacts bear it.

    Everything is smoothed alike: feet that stood while hips moved still stand.
    """
    noise = noise_of(source)
    if noise.feet < LEAST_NOISE:
        return source, None, ()
    smoother = _Smoother(len(source), noise.motion_cutoff, source.frame_time)
    rotations = np.empty_like(source.rotations)
    for j in range(rotations.shape[1]):
        rotations[:, j] = quat_normalize(smoother(quat_continuous(source.rotations[:, j])))
    quiet = replace(source, rotations=rotations, hips=smoother(source.hips))
    note = (
        f"the source's feet tremble by {1000 * noise.feet:.0f} mm of white noise (of an adult), as "
        f"of estimated motion: it is smoothed above {noise.motion_cutoff:.1f} Hz, and whether feet "
        f"stand is told from what is below {noise.contact_cutoff:.1f} Hz"
    )
    return replace(quiet, floor_z=floor_under(lowest_soles(quiet))), noise, (note,)


def noise_of(source: CanonicalMotion) -> Noise:
    """0 where bodies could move so."""
    rig = source.rig
    if not rig.contact_joints:
        return Noise(0.0, 0.0, source.frame_time)

    def places(block: slice) -> Float[np.ndarray, "T K 3"]:
        return canonical_positions(source.picked(block), rig.contact_joints)

    feet = in_blocks(places, len(source))
    return noise_in(feet, source.hips, rig.standing_height, source.frame_time)


def noise_in(
    feet: Float[np.ndarray, "T K 3"],
    hips: Float[np.ndarray, "T 3"],
    height: float,
    frame_time: float,
) -> Noise:
    """That of the paths of feet and hips [m] of a body of a standing height [m]."""
    size = height / ADULT_HEIGHT
    if len(feet) < LEAST_FRAMES or not feet.shape[1]:
        return Noise(0.0, 0.0, frame_time)
    return Noise(white_noise(feet / size), white_noise(hips[:, None] / size), frame_time)


def white_noise(paths: Float[np.ndarray, "T K 3"]) -> float:
    """RMS an axis, in the paths' unit."""
    bends = np.diff(paths, 2, axis=0)
    to_and_fro = -np.einsum("tkc,tkc->tk", bends[1:], bends[:-1])
    variance = np.maximum(np.median(to_and_fro, axis=0), 0.0) / (3 * 4 * _MEDIAN)
    return float(np.sqrt(variance.mean()))


def smoothed(
    values: Float[np.ndarray, "T *n"], cutoff: float, frame_time: float
) -> Float[np.ndarray, "T *n"]:
    """By a cubic smoothing spline, which halves what swings at the cutoff [Hz]."""
    return _Smoother(len(values), cutoff, frame_time)(values)


class _Smoother:
    """Least squares of what is taken away and, weighed, of second differences (Whittaker 1923,
    Henderson 1924): the discrete cubic smoothing spline."""

    def __init__(self, count: int, cutoff: float, frame_time: float) -> None:
        weight = (2 * np.sin(np.pi * min(cutoff * frame_time, 0.5))) ** -4
        bands = weight * second_differences(count)
        bands[2] += 1.0
        self._factor = cholesky_banded(bands)

    def __call__(self, values: Float[np.ndarray, "T *n"]) -> Float[np.ndarray, "T *n"]:
        columns = values.reshape(len(values), -1)
        return np.asarray(cho_solve_banded((self._factor, False), columns)).reshape(values.shape)
