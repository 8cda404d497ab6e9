"""What frames of a person can't be: in another unit, with another axis up, quaternions as xyzw.

A source says how tall it is and where its floor is. Who lies, leaps, squats, stands on a box or far
away is none of this; heights that no one comes to are.
"""

import numpy as np
from jaxtyping import Float

from robots.stream.frame_targets import Frame, FrameReader, FrameTargets
from spark.errors import FrameError
from spark.rotation import quat_conj, quat_mul

# Hips' heights of who stands: how far hips may be above where they stood or were in the frame
# before, and a body below the floor or where it was.
_MOST_UP, _MOST_DOWN = 2.0, 0.5
_UNITS = {"feet": 3.281, "inches": 39.37, "centimetres": 100.0, "millimetres": 1000.0}
_SQUAT = 0.6  # of their standing height are the hips, at least, of whom the unit is told
_STRETCH = 5.0  # times its length: more than half of the bones are never so long, or short
# |cos| of half an angle by which most joints are turned from the T-pose: never by 90 degrees, and
# surely by xyzw where those are within 60.
_TURNED, _NEAR = np.cos(np.radians([45.0, 30.0]))


class FrameCheck:
    """Refuses frames of a stream that `reader` reads which can't be the person's."""

    def __init__(self, reader: FrameReader) -> None:
        source = reader.source
        self._scale, self._floor = float(reader.scale), float(reader.ground.z)
        self._hip_height = float(source.hip_height)
        self._has_feet = reader.has_feet
        parents = source.skeleton.parents[1:]
        self._tpose = quat_mul(quat_conj(source.tpose[parents]), source.tpose[1:])
        self._lengths = np.linalg.norm(source.skeleton.offsets[1:], axis=1)
        self.reset()

    def reset(self) -> None:
        """Forget what has been seen: the next frame is a first one."""
        self._hips, self._lowest = self._hip_height, 0.0

    def check(self, frame: Frame, targets: FrameTargets) -> None:
        """Raises `FrameError` where a frame can't be the person's."""
        self._check_turns(np.asarray(frame.rotations))
        if frame.translations is not None:
            self._check_lengths(np.asarray(frame.translations))
        hips, lowest = self._heights(targets)
        self._check_heights(hips, lowest)
        self._hips, self._lowest = hips, lowest

    def _heights(self, targets: FrameTargets) -> tuple[float, float]:
        """Of the hips and the lowest part over the floor [m]."""
        hips = float(targets.hips[2]) / self._scale
        feet, parts = targets.feet[self._has_feet, :, 2], targets.parts[:, 2]
        lowest = min(feet.min(initial=np.inf), parts.min(initial=np.inf)) - self._floor
        return hips, min(float(lowest), hips)

    def _check_heights(self, hips: float, lowest: float) -> None:
        height = self._hip_height
        floor = f"the floor at z = {self._floor:.2f} m"
        if hips > max(self._hips, height) + _MOST_UP * height:
            raise FrameError(
                f"root_pos has the hips {hips:.2f} m over {floor}, {hips / height:.4g} times as "
                f"high as where this person stands ({height:.2f} m); {_advice(hips / height)}"
            )
        if lowest < min(self._lowest, 0.0) - _MOST_DOWN * height:
            raise FrameError(
                f"root_pos has the body {-lowest:.2f} m under {floor}, its hips at {hips:.2f} m, "
                f"{height:.2f} m where this person stands; {_advice(0.0)}"
            )

    def _check_turns(self, rotations: Float[np.ndarray, "N 4"]) -> None:
        most = len(self._tpose) / 2
        near = np.abs((rotations[1:] * self._tpose).sum(1))
        if np.count_nonzero(near < _TURNED) <= most:
            return
        near = np.abs((rotations[1:, [3, 0, 1, 2]] * self._tpose).sum(1))
        if np.count_nonzero(near > _NEAR) > most:
            raise FrameError(
                "rotations turn most joints by more than 90 degrees from the T-pose, and as xyzw "
                "by less than 60; expected wxyz: give rotations[:, [3, 0, 1, 2]]"
            )

    def _check_lengths(self, translations: Float[np.ndarray, "N 3"]) -> None:
        most = np.count_nonzero(self._lengths) / 2
        lengths = np.linalg.norm(translations[1:], axis=1)
        long = np.count_nonzero(lengths > _STRETCH * self._lengths)
        short = np.count_nonzero(_STRETCH * lengths < self._lengths)
        if max(long, short) > most:
            times = float(lengths.sum() / self._lengths.sum())
            raise FrameError(
                f"translations make the bones {times:.3g} times as long as the source's; "
                "expected metres: give them so, or leave them out"
            )


def _advice(times: float) -> str:
    """What to do with a root that is so many times as high as it should be."""
    unit = next((u for u, size in _UNITS.items() if _SQUAT < times / size < 1 / _SQUAT), None)
    if unit is not None:
        return f"expected metres, it seems to be in {unit}: divide it by {_UNITS[unit]:g}"
    return (
        "expected metres, Z up: give it so, or a source whose floor is that of the frames; "
        "reset() where the person was put elsewhere"
    )
