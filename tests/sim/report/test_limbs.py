"""Limbs that are thrown about, on a stick man whose arm turns: answers by hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float

from sim.report import Report, Subject, assess
from sim.report.thresholds import PLAUSIBILITY
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_about
from tests.helpers.stick import joint, scaled, standing, stick_rig, without

Times = Float[np.ndarray, "T"]
ELBOW, HAND = 0.3, 0.55  # [m] from the shoulder
LEAST = PLAUSIBILITY.limb_least


def turning(rate: float, *, rig: Rig | None = None, fps: float = 60.0) -> Subject:
    """The left arm goes round in a level circle at `rate` [rad/s] for 4 s."""
    return swinging(lambda times: rate * times, rig=rig, fps=fps)


def swinging(
    angle: Callable[[Times], Times],
    *,
    rig: Rig | None = None,
    fps: float = 60.0,
    seconds: float = 4.0,
) -> Subject:
    """The left arm points to `angle` [rad] of each time [s], level."""
    rig = stick_rig() if rig is None else rig
    motion = standing(rig, round(seconds * fps) + 1, fps)
    times = np.arange(len(motion)) / fps
    motion.rotations[:, joint(Role.LEFT_UPPER_ARM)] = quat_about("z", angle(times))
    return Subject(motion, rig)


def thrown(times: Times) -> Times:
    """To one side by 0.3 rad and back within 0.2 s, at 2 s."""
    there = (times >= 2.0) & (times < 2.2)
    return np.where(there, 0.15 - 0.15 * np.cos(2 * np.pi * (times - 2.0) / 0.2), 0.0)


def peaks(subject: Subject) -> dict[str, float]:
    clip = assess(subject).clip
    return dict(zip(clip.limb_names, clip.limb_peaks.tolist(), strict=True))


def sentences(report: Report) -> list[str]:
    return [f.sentence for f in report.findings if f.measure == "limb_acceleration"]


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0, 240.0])
def test_an_arm_on_a_circle_is_accelerated_towards_its_shoulder(fps: float) -> None:
    for rate in (2.0, 4.0):
        found = peaks(turning(rate, fps=fps))
        assert found.pop("left hand") == pytest.approx(HAND * rate**2, rel=0.02)
        assert found.pop("left elbow") == pytest.approx(ELBOW * rate**2, rel=0.02)
        assert found.keys() == {"right hand", "right elbow", "left foot", "right foot", "head"}
        assert max(found.values()) < 1e-6


def test_in_the_world_a_body_that_is_shaken_shakes_all_its_limbs() -> None:
    rig = stick_rig()
    motion = standing(rig, 241)
    motion.root_pos[:, 0] += 0.05 * np.sin(8 * np.arange(241) / 60)
    found = assess(Subject(motion, rig)).clip
    np.testing.assert_allclose(found.limb_peaks, found.base_acceleration_p99, rtol=1e-9)


@pytest.mark.parametrize("rate", [0.0, 1.0, 5.0])
def test_a_clip_is_its_own_source(rate: float) -> None:
    subject = turning(rate)
    report = assess(subject, source=subject)
    assert report.limbs is not None
    np.testing.assert_allclose(report.limbs.ratios, 1.0, rtol=1e-9)
    assert not report.limbs.thrown.any()
    assert sentences(report) == []


def test_the_worst_limb_is_named_beside_its_source() -> None:
    report = assess(turning(6.0), source=turning(3.0))
    limbs = report.limbs
    assert limbs is not None
    ratios = dict(zip(limbs.names, limbs.ratios.tolist(), strict=True))
    assert ratios["left hand"] == pytest.approx(4, rel=0.02)
    # 2.7 m/s² of the source's elbow count as `LEAST`.
    assert ratios["left elbow"] == pytest.approx(ELBOW * 36 / LEAST, rel=0.02)
    assert ratios["right hand"] == ratios["head"] == 1
    assert limbs.names[limbs.worst] == "left hand"
    (row,) = (row for row in report.rows() if row["measure"] == "limb_acceleration")
    assert row["value"] == pytest.approx(limbs.ratio)
    assert row["unit"] == "x"
    told = report.json()["limbs"]
    assert told["worst"] == "left hand"
    assert told["acceleration_of_source"] == pytest.approx(4, rel=0.02)
    assert told["scaled_source_p99_m_s2"]["left hand"] == pytest.approx(HAND * 9, rel=0.02)
    (line,) = (line for line in report.text().splitlines() if "limb acceleration" in line)
    assert line.split()[2:7] == [f"{limbs.ratio:.2f}", "of", "the", "source's:", "left"]


@pytest.mark.parametrize("rate", [0.5, 3.0, 6.0])
def test_of_a_larger_body_more_is_no_more(rate: float) -> None:
    small, big = stick_rig(), scaled(stick_rig(), 2.0)
    report = assess(turning(rate, rig=big), source=turning(rate))
    assert report.limbs is not None
    np.testing.assert_allclose(report.limbs.ratios, 1.0, rtol=1e-9)
    # What counts as a throw beside a source that stands still grows with the body.
    fast = [
        assess(turning(8.0, rig=rig), source=turning(0.0, rig=rig)).limbs for rig in (small, big)
    ]
    assert fast[0] is not None
    assert fast[1] is not None
    np.testing.assert_allclose(fast[0].ratios, fast[1].ratios, rtol=1e-9)
    assert fast[0].ratio == pytest.approx(HAND * 64 / LEAST, rel=0.03)


@pytest.mark.parametrize(("fps", "source_fps"), [(30.0, 60.0), (60.0, 24.0), (120.0, 60.0)])
def test_the_frame_rates_do_not_matter(fps: float, source_fps: float) -> None:
    report = assess(turning(4.0, fps=fps), source=turning(2.5, fps=source_fps))
    assert report.limbs is not None
    assert report.limbs.ratio == pytest.approx(HAND * 16 / (HAND * 2.5**2), rel=0.03)


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_an_arm_that_is_thrown_once_is_to_be_mended(fps: float) -> None:
    still = swinging(np.zeros_like, fps=fps, seconds=30.0)
    report = assess(swinging(thrown, fps=fps, seconds=30.0), source=still)
    assert report.implausible == 0
    found = [f for f in report.findings if f.measure == "limb_acceleration"]
    # Within 30 s one throw is less than 1 % of the frames, and a finding none the less.
    assert {f.where for f in found} == {"left hand", "left elbow"}
    assert all(f.start / fps >= 1.9 and f.stop / fps <= 2.3 for f in found)
    assert found[0].sentence.startswith("left hand is thrown by ")
    assert found[0].sentence.endswith("m/s², the source's by 0.0")
    assert "nothing to mend" not in report.text()


def test_what_the_source_does_a_moment_later_is_no_throw() -> None:
    def found(late: float) -> list[str]:
        moved = swinging(lambda times: thrown(times - late), seconds=30.0)
        return sentences(assess(moved, source=swinging(thrown, seconds=30.0)))

    assert found(-0.08) == found(0.0) == found(0.08) == []
    assert len(found(1.0)) >= 2  # hand and elbow


def test_a_forearm_without_a_wrist_ends_at_its_end_site() -> None:
    rig = without(stick_rig(), Role.LEFT_HAND)
    assert "left hand" not in peaks(turning(3.0, rig=rig))
    forearm = joint(Role.LEFT_FOREARM)
    skeleton = replace(
        rig.skeleton,
        end_parents=np.append(rig.skeleton.end_parents, forearm),
        end_offsets=np.vstack([rig.skeleton.end_offsets, [0.0, 0.4, 0.0]]),
    )
    found = peaks(turning(3.0, rig=replace(rig, skeleton=skeleton)))
    assert found["left hand"] == pytest.approx((ELBOW + 0.4) * 9, rel=0.02)


def test_a_body_without_hands_and_head_is_asked_for_its_feet() -> None:
    gone = (Role.LEFT_HAND, Role.RIGHT_HAND, Role.LEFT_FOREARM, Role.RIGHT_FOREARM, Role.HEAD)
    report = assess(turning(2.0, rig=without(stick_rig(), *gone)), source=turning(2.0))
    assert report.limbs is not None
    assert report.limbs.names == ("left foot", "right foot")


def test_a_still_picture_throws_nothing() -> None:
    still = turning(0.0)
    one = Subject(still.motion.frames(0, 1), still.rig)
    report = assess(one, source=still)
    assert report.limbs is not None
    assert report.limbs.ratio == 1


def test_a_base_that_is_thrown_takes_its_limbs_along() -> None:
    still = swinging(np.zeros_like, seconds=30.0)
    root = still.motion.root_pos.copy()
    root[:, 0] += thrown(np.arange(len(root)) / 60)
    report = assess(replace(still, motion=replace(still.motion, root_pos=root)), source=still)
    assert report.limbs is not None
    assert report.limbs.excess.max() == pytest.approx(1, abs=1e-6)
    assert sentences(report) == []


def test_longer_arms_are_faster_by_their_length() -> None:
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    for role in (Role.LEFT_FOREARM, Role.LEFT_HAND):
        offsets[joint(role)] *= 3
    apish = replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))
    limbs = assess(turning(5.0, rig=apish), source=turning(5.0)).limbs
    assert limbs is not None
    np.testing.assert_allclose(limbs.ratios, 1.0, rtol=1e-9)
    # Shorter arms may be as fast as the body is large.
    back = assess(turning(5.0), source=turning(5.0, rig=apish)).limbs
    assert back is not None
    assert back.peaks[back.names.index("left hand")] == pytest.approx(HAND * 25, rel=0.02)
    assert back.source_peaks[back.names.index("left hand")] == pytest.approx(
        3 * HAND * 25, rel=0.02
    )
