"""Interpolation in time against numpy's and scipy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from spark.resample import frames_at_rate, frames_of_keys, rotations_at, values_at
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


@pytest.mark.parametrize(
    ("count", "written", "fps", "wanted", "expected"),
    [
        (64, "0.0333333", 30, 60, 127),
        (786, "0.0333333", 30, 24, 629),
        (786, "0.033333", 30, 30, 786),
        (1001, ".03333", 30, 15, 501),
        (3001, "0.016666", 60, 30, 1501),
        (5001, ".0083333", 120, 30, 1251),
        (101, "0.041667", 24, 60, 251),
    ],
)
def test_the_last_frame_stays_however_few_digits_a_frame_time_has(
    count: int, written: str, fps: int, wanted: int, expected: int
) -> None:
    assert expected == (count - 1) * wanted // fps + 1
    at = frames_at_rate(count, float(written), 1 / wanted)
    assert len(at) == expected
    assert at[-1] == pytest.approx(count - 1, abs=0.1 * fps / wanted)
    assert at.max() <= count - 1


@pytest.mark.parametrize("count", [2, 64, 1001, 100_001])
def test_a_clip_grows_by_no_frame_that_it_lacks(count: int) -> None:
    for share in (0.15, 0.5, 0.85):  # of a new frame, beyond the last whole one
        at = frames_at_rate(count, 1.0, (count - 1) / (count - 1 + share))
        assert len(at) == count
        assert at[-1] == pytest.approx(count - 1, abs=1.0)
