"""Interpolation in time against numpy's and scipy's."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from spark.resample import frames_of_keys, rotations_at, values_at
from spark.rotation import quat_angle, quat_normalize

AT = np.array([-1.0, 0.0, 0.25, 1.0, 2.5, 3.0, 9.0])


def test_values_are_numpys_interpolation_column_by_column() -> None:
    values = np.random.default_rng(0).normal(size=(4, 2, 3))
    expected = [np.interp(AT, np.arange(4), column) for column in values.reshape(4, -1).T]
    np.testing.assert_allclose(values_at(values, AT).reshape(len(AT), -1).T, expected)


def test_rotations_are_scipys_slerp() -> None:
    q = quat_normalize(np.random.default_rng(1).normal(size=(4, 2, 4)))
    for j in range(2):
        slerp = Slerp(np.arange(4), Rotation.from_quat(np.roll(q[:, j], -1, axis=-1)))
        expected = np.roll(slerp(np.clip(AT, 0, 3)).as_quat(), 1, axis=-1)
        assert quat_angle(rotations_at(q, AT)[:, j], expected).max() < 1e-7


def test_whole_frames_come_out_as_they_went_in() -> None:
    rng = np.random.default_rng(2)
    values = rng.normal(size=(5, 3))
    np.testing.assert_array_equal(values_at(values, np.arange(5.0)), values)
    q = quat_normalize(np.array([1.0, 0, 0, 0]) + 0.2 * rng.normal(size=(5, 2, 4)))
    np.testing.assert_array_equal(rotations_at(q, np.arange(5.0)), q)


def test_a_single_frame_holds_for_ever() -> None:
    np.testing.assert_array_equal(values_at(np.array([[1.0, 2.0]]), AT), [[1.0, 2.0]] * len(AT))


def test_times_among_keys_are_fractional_frames() -> None:
    keys = np.array([0.0, 0.1, 0.4])
    np.testing.assert_allclose(
        frames_of_keys(keys, np.array([-1.0, 0.05, 0.1, 0.3, 7.0])), [0, 0.5, 1, 1 + 2 / 3, 2]
    )
