"""Velocity and acceleration over a fixed time, so that the frame rate does not change them."""

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import make_interp_spline

# [frames] Cubic splines are bent by frames further away less and less: by one so far by less than
# rounding does (0.27 to this power).
SPLINE = 32
# Sample times within the window, in halves of it: so dense that their number does not matter.
_OFFSETS = np.linspace(-1.0, 1.0, 11)
_ROUNDING = 1e-6  # [frames] a window is whole though it misses the clip's end by less


def whole_windows(count: int, frame_time: float, window: float) -> Int[np.ndarray, "T"]:
    """For each frame the nearest one whose window of derivatives lies within the clip."""
    margin = min(int(np.ceil(window / frame_time - _ROUNDING)), (count - 1) // 2)
    return np.clip(np.arange(count), margin, count - 1 - margin)


def derivative(
    values: Float[np.ndarray, "T *n"], frame_time: float, order: int, window: float
) -> Float[np.ndarray, "T *n"]:
    """The first or second time derivative of `values`, per second or per second squared; of order 0
    the values of the fit itself.

    At each frame a parabola is fitted to the `window` seconds before and after it, with Gaussian
    weights (Savitzky and Golay 1964, weighted); between frames the values are those of a cubic
    spline. Exact for parabolas. Nearer to the clip's ends than the window, the value is that of the
    nearest frame with a whole window; a clip shorter than two windows has one that fits. One frame
    stands still.
    """
    count = len(values)
    duration = (count - 1) * frame_time
    if count < 2:
        return np.zeros_like(values) if order else values.copy()
    half = min(window, 0.5 * duration)
    times = np.arange(count) * frame_time
    centres = np.clip(times, half, duration - half)
    spline = make_interp_spline(times, values.reshape(count, -1), k=min(3, count - 1))
    weights = _WEIGHTS[order] / half**order
    total = sum(w * spline(centres + half * x) for w, x in zip(weights, _OFFSETS, strict=True))
    return np.asarray(total).reshape(values.shape)


def _fit_weights() -> Float[np.ndarray, "3 K"]:
    """Weights whose sums over the samples are the fitted parabola's derivatives at its centre."""
    basis = _OFFSETS[:, None] ** np.arange(3) / np.array([1.0, 1.0, 2.0])
    gauss = np.exp(-0.5 * (2 * _OFFSETS) ** 2)[:, None]
    weights: Float[np.ndarray, "3 K"] = np.linalg.solve(
        basis.T @ (gauss * basis), (gauss * basis).T
    )
    return weights


_WEIGHTS = _fit_weights()
