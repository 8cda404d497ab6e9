"""How far a result is from its ground truth, and what is no ground truth of it."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import Subject, assess, compare
from sim.report.page import report_page
from spark.errors import SkeletonError
from spark.rig.roles import Role
from spark.rotation import quat_about
from tests.helpers.stick import joint, standing, stick_rig

# The stick man from the hips to the end of a toe and to the crown:
# 0.1 + 0.4 + 0.4 + hypot(0.13, 0.08) + 0.07 and 0.2 + 0.3 + 0.1 + 0.2.
HEIGHT = 1.77 + np.hypot(0.13, 0.08)


def test_the_truth_itself_is_right() -> None:
    rig = stick_rig()
    still = standing(rig, 30)
    record = assess(Subject(still, rig), truth=still).json()["ground_truth"]
    assert record == {
        "mse": 0,
        "root_relative_mse": 0,
        "mpjpe_percent_of_height": 0,
        "largest_error_percent_of_height": 0,
    }
    assert assess(Subject(still, rig)).json()["ground_truth"] is None


def test_a_body_three_centimetres_beside_the_truth() -> None:
    rig = stick_rig()
    still = standing(rig, 30)
    beside = replace(still, root_pos=still.root_pos + np.array([0.0, 0.03, 0.0]))
    report = assess(Subject(beside, rig), truth=still)
    assert report.truth is not None
    assert report.truth.mpjpe == pytest.approx(3 / HEIGHT)
    assert report.truth.mse == pytest.approx((0.03 / HEIGHT) ** 2 / 3)
    assert report.truth.relative_mse == pytest.approx(0)
    np.testing.assert_allclose(report.truth.errors, 3 / HEIGHT)
    assert f"{3 / HEIGHT:.2f} %        of the height" in report.text()
    page = report_page(report, Subject(beside, rig), title="t")
    assert "distance from the truth" in page


def test_one_bent_elbow_moves_one_hand() -> None:
    # The hand is 0.25 m from the elbow: a quarter turn takes it 0.25 √2 m away; 18 joints.
    rig = stick_rig()
    still, bent = standing(rig, 10), standing(rig, 10)
    bent.rotations[5:, joint(Role.LEFT_FOREARM)] = quat_about("z", np.array(-np.pi / 2))
    truth = assess(Subject(bent, rig), truth=still).truth
    assert truth is not None
    away = 100 * 0.25 * np.sqrt(2) / 18 / HEIGHT
    np.testing.assert_allclose(truth.errors, [0] * 5 + [away] * 5, atol=1e-9)
    assert truth.mpjpe == pytest.approx(away / 2)
    assert truth.relative_mse == truth.mse


def test_it_stands_in_the_table_where_it_is_known() -> None:
    rig = stick_rig()
    still = standing(rig, 30)
    beside = replace(still, root_pos=still.root_pos + np.array([0.0, 0.03, 0.0]))
    known = {
        "good": assess(Subject(still, rig), truth=still),
        "bad": assess(Subject(beside, rig), truth=still),
    }
    rows = {line[:34].strip(): line[34:].split() for line in compare(known).splitlines()}
    assert rows["ground-truth MPJPE [% of height]"] == ["0.00*", f"{3 / HEIGHT:.2f}"]
    assert "ground-truth" not in compare({"good": assess(Subject(still, rig))})


def test_what_is_no_truth_is_refused() -> None:
    rig = stick_rig()
    still = standing(rig, 30)
    skeleton = still.skeleton
    renamed = replace(skeleton, names=("hips", *skeleton.names[1:]))
    long = replace(skeleton, offsets=1.1 * skeleton.offsets)
    for other, message in (
        (standing(rig, 29), "29 frames at 60 fps, the motion 30 at 60"),
        (standing(rig, 30, fps=30.0), "30 frames at 30 fps"),
        (replace(still, skeleton=renamed), "'hips' where the motion has 'pelvis'"),
        (replace(still, skeleton=long), "another build.*4.0 cm"),
    ):
        with pytest.raises(SkeletonError, match=message):
            assess(Subject(still, rig), truth=other)
