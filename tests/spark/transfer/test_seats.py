"""What a body sits on: told from where it rests though its feet can't carry it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.rig.flesh import RADII
from spark.rotation import quat_from_rotvec, quat_from_yaw, quat_mul, quat_rotate
from spark.transfer.canonical import CanonicalMotion, at_frame_time
from spark.transfer.seats import FLESH, SAME_SEAT, seats_of
from spark.transfer.treads import treads_of
from tests.helpers.recordings import recordings
from tests.helpers.sitting import FRAME_TIME, RIG, SITS, sitting


def test_who_sits_is_told_when_and_how_high() -> None:
    source = sitting()
    (seat,) = seats_of(source)
    assert seat.high == pytest.approx(source.hips[SITS, 2].mean(), abs=1e-3)
    assert (seat.start, seat.stop) == pytest.approx((SITS.start, SITS.stop), abs=8)
    near = np.abs(source.hips[seat.start : seat.stop, 2] - seat.high)
    assert near.max() < SAME_SEAT


def test_a_seat_is_below_the_hips() -> None:
    """As far as the report takes a pelvis for thick."""
    source = sitting()
    (top,) = treads_of(source).ground(source.floor_z).tops
    hips = source.hips[SITS].mean(axis=0)
    np.testing.assert_allclose(top[:2], hips[:2], atol=0.02)
    assert top[2] == pytest.approx(hips[2] - FLESH * RIG.standing_height, abs=1e-3)
    assert RADII["pelvis"] == FLESH


@pytest.mark.parametrize(
    "source",
    [
        pytest.param(sitting(lean=70.0), id="who squats leans over the feet"),
        pytest.param(sitting(knees=15.0), id="knees that are bent a little hold the body"),
        pytest.param(sitting().frames(0, 40), id="who is about to sit down does not sit yet"),
        pytest.param(sitting().frames(0, 0), id="nothing"),
    ],
)
def test_who_does_not_sit_is_not_told_to(source: CanonicalMotion) -> None:
    assert seats_of(source) == ()


def test_who_lies_or_sits_on_the_floor_sits_on_nothing() -> None:
    source = sitting()
    down = source.hips[SITS, 2].mean() - 0.1 * RIG.standing_height
    on_floor = replace(source, hips=source.hips - np.array([0, 0, down]))
    assert seats_of(on_floor) == ()
    back = quat_from_rotvec(np.tile([0.0, -np.pi / 2, 0.0], (len(source), len(RIG.skeleton), 1)))
    lying = replace(source, rotations=back, hips=np.tile([0, 0, 0.1], (len(source), 1)))
    assert seats_of(lying) == ()


def test_neither_heading_nor_place_nor_rate_matters() -> None:
    source, turn = sitting(), quat_from_yaw(np.array([2.0]))
    (seat,) = seats_of(source)
    moved = replace(
        source,
        rotations=quat_mul(turn[:, None], source.rotations),
        hips=quat_rotate(turn, source.hips) + np.array([3.0, -2.0, 0.7]),
        floor_z=source.floor_z + 0.7,
    )
    assert seats_of(moved)[0] == pytest.approx(seat, abs=1e-9)
    (fast,) = seats_of(at_frame_time(source, FRAME_TIME / 4))
    assert fast.high == pytest.approx(seat.high, abs=1e-3)
    assert (fast.start / 4, fast.stop / 4) == pytest.approx((seat.start, seat.stop), abs=1)


@pytest.mark.parametrize(
    "path", recordings("cmu_asf/cmu_0[123]*.bvh", "deepmimic/*[lpd].bvh", "reactidle/*.bvh")
)
def test_who_climbs_crawls_or_idles_sits_on_nothing(path: Path) -> None:
    assert seats_of(spark_sim.load(path).canonical) == ()
