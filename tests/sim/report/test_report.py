"""The whole report: a stick man does one thing wrong, and the report names it and nothing else."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.report import Finding, Report, Subject, assess, compare
from sim.report.names import LABELS
from spark.errors import SkeletonError, SparkSimError
from spark.io.recording import read_recording
from spark.motion import Motion
from spark.rig.feet import FOOT_LENGTH
from spark.rig.rig import Rig, understand
from spark.rig.roles import Group, Role, RoleMap
from spark.rotation import quat_about, quat_from_yaw, quat_mul, quat_rotate
from spark.skeleton import Skeleton
from tests.helpers.recordings import recordings
from tests.helpers.stick import joint, scaled, standing, stick_rig

FPS = 60.0


def moved(motion: Motion, path: np.ndarray) -> Motion:
    """The motion with its root displaced by `path` [m] frame by frame."""
    return replace(motion, root_pos=motion.root_pos + path)


def along(motion: Motion, axis: int, values: np.ndarray | float) -> Motion:
    path = np.zeros((len(motion), 3))
    path[:, axis] = values
    return moved(motion, path)


def seconds(motion: Motion) -> np.ndarray:
    return np.arange(len(motion)) * motion.frame_time


def shares(report: Report) -> dict[str, float]:
    return report.clip.shares


def texts(report: Report) -> list[str]:
    return [finding["text"] for finding in report.json()["findings"]]


def test_a_body_that_stands_is_plausible() -> None:
    rig = stick_rig()
    still = standing(rig, 120)
    report = assess(Subject(still, rig), source=Subject(still, rig))
    assert report.implausible == 0
    assert report.findings == ()
    assert "nothing to mend" in report.text()


def test_a_body_held_five_centimetres_up_floats_in_all_frames() -> None:
    rig = stick_rig()
    still = standing(rig, 120)
    report = assess(Subject(along(still, 2, 0.05), rig), source=Subject(still, rig))
    assert shares(report) == {"penetration": 0, "floating": 1, "skating": 0, "root_wrench": 1}
    assert texts(report) == ["the body floats 5.0 cm above the floor in frames 0-119 (0.0-2.0 s)"]


@pytest.mark.parametrize(("height", "told"), [(0.025, True), (0.015, False)])
def test_a_body_that_hovers_a_little_throughout_is_told(height: float, told: bool) -> None:
    rig = stick_rig()
    still = standing(rig, 120)
    source, up = Subject(still, rig), Subject(along(still, 2, height), rig)
    report = assess(up, source=source)
    assert report.implausible == 0
    hovers = "the body hovers: it keeps 2.5 cm above the floor in frames 0-119 (0.0-2.0 s)"
    assert texts(report) == ([hovers] if told else [])


def test_a_jump_is_no_floating() -> None:
    rig = stick_rig()
    still = standing(rig, 120)
    t = seconds(still) - 0.5
    height = np.where((t > 0) & (t < 0.6), 0.5 * 9.81 * t * (0.6 - t), 0.0)
    report = assess(Subject(along(still, 2, height), rig), source=Subject(still, rig))
    assert report.implausible == 0


def test_the_same_path_at_a_quarter_of_gravity_floats() -> None:
    rig = stick_rig()
    still = standing(rig, 180)
    t = seconds(still) - 0.5
    height = np.where((t > 0) & (t < 1.2), 0.125 * 9.81 * t * (1.2 - t), 0.0)
    report = assess(Subject(along(still, 2, height), rig), source=Subject(still, rig))
    assert shares(report)["floating"] == pytest.approx(height[height > 0.04].size / 180, abs=0.03)


def test_a_body_three_centimetres_down_sinks_with_both_feet() -> None:
    rig = stick_rig()
    still = standing(rig, 120)
    deep = np.where(np.arange(120) == 57, -0.032, 0.0)
    report = assess(Subject(along(still, 2, deep), rig), source=Subject(still, rig))
    assert shares(report)["penetration"] == pytest.approx(1 / 120)
    sinks, thrown = texts(report)[:2], texts(report)[2:]
    assert sinks == [
        f"{side} foot sinks 3.2 cm under the floor at frame 57 (0.95 s)"
        for side in ("left", "right")
    ]
    assert len(thrown) == 1
    assert thrown[0].startswith("the base is thrown")
    assert thrown[0].endswith("at frame 57 (0.95 s)")


def test_a_foot_that_slides_at_0_4_metres_a_second_is_reported_at_that() -> None:
    rig = stick_rig()
    still = standing(rig, 120)
    t = np.clip(seconds(still) - 0.5, 0, 1.0)
    report = assess(Subject(along(still, 0, 0.4 * t), rig), source=Subject(still, rig))
    assert report.json()["clip"]["fastest_skate_m_s"] == pytest.approx(0.4, rel=0.01)
    assert shares(report)["skating"] == pytest.approx(0.5, abs=0.02)
    slid = [f.amount for f in report.findings if f.measure == "skating"]
    np.testing.assert_allclose(slid, 0.4, atol=0.02)


@pytest.mark.parametrize(("distance", "told"), [(0.016, False), (0.04, True)])
def test_a_foot_that_is_fast_for_a_moment_is_nothing_to_mend(distance: float, told: bool) -> None:
    """As one that lands or leaves: it moves for 0.05 s."""
    rig = stick_rig()
    still = standing(rig, 120)
    way = distance * np.clip((seconds(still) - 1.0) / 0.05, 0.0, 1.0)
    report = assess(Subject(along(still, 0, way), rig), source=Subject(still, rig))
    assert bool(shares(report)["skating"])
    assert any("slides" in text for text in texts(report)) == told


def test_one_foot_that_slides_flat_is_named_though_the_other_could_carry_the_body() -> None:
    rig = stick_rig()
    still = standing(rig, 120)
    # The hip swings the straight leg by a few degrees, 0.8 m above the ankle, which stays level.
    moving = standing(rig, 120)
    swing = 0.15 * np.sin(0.3 / 0.8 / 0.15 * seconds(still))
    moving.rotations[:, joint(Role.LEFT_UPPER_LEG)] = quat_about("y", -swing)
    moving.rotations[:, joint(Role.LEFT_FOOT)] = quat_about("y", swing)
    report = assess(Subject(moving, rig), source=Subject(still, rig))
    assert report.json()["clip"]["fastest_skate_m_s"] == pytest.approx(0.3, rel=0.05)
    assert {f.where for f in report.findings if f.measure == "skating"} == {"left foot"}


def test_a_slow_slide_is_drift_but_no_skating() -> None:
    rig = stick_rig()
    still = standing(rig, 120)
    report = assess(Subject(along(still, 1, 0.1 * seconds(still)), rig), source=Subject(still, rig))
    assert report.implausible == 0
    assert report.json()["root_drift"]["final_m"] == pytest.approx(0.1 * still.duration)
    assert any("strays 0.20 m" in text for text in texts(report))


def test_a_knee_bent_backwards_is_named() -> None:
    rig = stick_rig()
    bent = standing(rig, 60)
    bent.rotations[20:40, joint(Role.LEFT_LOWER_LEG)] = quat_about("y", np.radians(-60))
    bent.rotations[20:40, joint(Role.LEFT_FOOT)] = quat_about("y", np.radians(60))
    report = assess(Subject(bent, rig))
    assert report.json()["clip"]["joint_limits"]["left knee"] == {
        "share": pytest.approx(20 / 60),
        "at_limit_share": pytest.approx(20 / 60),
        "largest_excess_rad": pytest.approx(np.radians(35)),
    }
    assert "left knee bends backwards 35° beyond its limit in frames 20-39 (0.3-0.7 s)" in texts(
        report
    )


@pytest.mark.parametrize(("degrees", "at", "beyond"), [(22.9, 0, 0), (23.1, 1, 0), (25.3, 1, 1)])
def test_a_joint_is_at_its_limit_within_two_degrees(
    degrees: float, at: float, beyond: float
) -> None:
    """A knee may bend backwards by 25 degrees."""
    rig = stick_rig()
    bent = standing(rig, 60)
    bent.rotations[:, joint(Role.LEFT_LOWER_LEG)] = quat_about("y", np.radians(-degrees))
    clip = assess(Subject(bent, rig)).clip
    assert clip.at_limit_shares["left knee"] == at
    assert (clip.at_limit_share, clip.limit_share) == (at, beyond)


def test_how_long_a_joint_is_at_its_limit_is_told() -> None:
    """0.3 s, and then 0.5 s."""
    rig = stick_rig()
    bent = standing(rig, 120)
    for start, stop in ((10, 28), (60, 90)):
        bent.rotations[start:stop, joint(Role.LEFT_LOWER_LEG)] = quat_about("y", np.radians(-24))
    report = assess(Subject(bent, rig))
    assert report.clip.longest_at_limit("left knee") == pytest.approx(0.5)
    assert report.clip.longest_at_limit("right knee") == 0
    assert "40.0 %        left knee, for 0.5 s on end" in report.text()


def test_a_hand_under_the_floor_is_named_and_a_man_lying_down_does_not_float() -> None:
    rig = stick_rig()
    lying = standing(rig, 60)
    lying.rotations[:, 0] = quat_about("y", np.array(-np.pi / 2))  # on his back
    lying.root_pos[:, 2] = 0.1
    report = assess(Subject(lying, rig), source=Subject(standing(rig, 60), rig))
    assert shares(report)["floating"] == 0
    sunk = along(lying, 2, -0.15)
    assert any(
        text.startswith("right hand sinks")
        for text in texts(assess(Subject(sunk, rig)))
        + texts(assess(Subject(sunk, rig), source=Subject(standing(rig, 60), rig)))
    )


def with_one_more(name: str, high: float) -> Rig:
    """The stick man with a joint below his left hand, at this height [m] where he stands."""
    rig = stick_rig()
    hand, count = joint(Role.LEFT_HAND), len(rig.skeleton)
    down = high - float(rig.tpose_positions[hand, 2]) - 0.9
    skeleton = Skeleton(
        (*rig.skeleton.names, name),
        np.append(rig.skeleton.parents, hand),
        np.concatenate([rig.skeleton.offsets, [[0.0, 0.1, down]]]),
        np.append(rig.skeleton.translating, False),
        rig.skeleton.end_parents,
        rig.skeleton.end_offsets,
    )
    roles = RoleMap((*rig.roles.roles, None), (1.0,) * (count + 1), ("by hand",) * (count + 1))
    tpose = np.tile([1.0, 0.0, 0.0, 0.0], (count + 1, 1))
    groups = (*rig.groups, frozenset[Group]())
    return replace(rig, skeleton=skeleton, roles=roles, tpose=tpose, groups=groups)


def test_fingers_are_part_of_their_hand_under_the_floor_and_nowhere_else() -> None:
    sunk = with_one_more("left_index", -0.2)
    report = assess(Subject(standing(sunk, 60), sunk))
    assert shares(report) == {"penetration": 1, "floating": 0, "skating": 0, "root_wrench": 0}
    assert texts(report) == ["left hand sinks 20.0 cm under the floor in frames 0-59 (0.0-1.0 s)"]
    sword = with_one_more("left_sword", -0.2)
    assert shares(assess(Subject(standing(sword, 60), sword)))["penetration"] == 0
    # Held up, it floats as it does without a finger on the floor.
    touching = with_one_more("left_index", -0.05)
    up = along(standing(touching, 60), 2, 0.05)
    ground = Subject(standing(touching, 60), touching)
    assert shares(assess(Subject(up, touching), source=ground))["floating"] == 1


def test_a_body_that_leans_as_no_one_can_stand_needs_a_hand() -> None:
    rig = stick_rig()
    still = standing(rig, 60)
    for degrees, expected in ((3, 0), (45, 1)):
        tilt = quat_about("y", np.radians(float(degrees)))
        leaning = replace(
            still,
            root_pos=quat_rotate(tilt, still.root_pos),
            rotations=still.rotations.copy(),
        )
        leaning.rotations[:, 0] = tilt
        for foot in (Role.LEFT_FOOT, Role.RIGHT_FOOT):
            leaning.rotations[:, joint(foot)] = quat_about("y", np.radians(-float(degrees)))
        leaning = along(leaning, 2, 0.1 * (1 - np.cos(np.radians(degrees))))
        report = assess(Subject(leaning, rig), source=Subject(still, rig))
        assert shares(report)["root_wrench"] == expected


@pytest.mark.parametrize("fps", [15.0, 30.0, 120.0])
def test_the_frame_rate_changes_no_share(fps: float) -> None:
    rig = stick_rig()

    def clip(rate: float) -> Motion:
        still = standing(rig, int(8 * rate), rate)
        t = seconds(still)
        path = np.stack([0.6 * np.sin(2 * t) / 2, 0 * t, 0.045 + 0.02 * np.sin(3 * t)], axis=-1)
        return moved(still, path - [0, 0, 0.03])

    source = Subject(standing(rig, 60), rig)
    ours, reference = (
        assess(Subject(clip(fps), rig), source=source),
        assess(Subject(clip(60), rig), source=source),
    )
    assert 0.1 < reference.implausible < 0.9
    for name, share in shares(ours).items():
        assert share == pytest.approx(shares(reference)[name], abs=0.02)


def test_turning_and_moving_the_world_changes_nothing() -> None:
    rig = stick_rig()
    rng = np.random.default_rng(3)
    still = standing(rig, 90)
    t = seconds(still)[:, None]
    path = 0.05 * np.sin(t * rng.uniform(1, 9, 3) + rng.uniform(0, 6, 3))
    motion = moved(still, path)
    yaw = quat_from_yaw(np.array(2.2))
    turned = replace(
        motion,
        root_pos=quat_rotate(yaw, motion.root_pos) + np.array([30.0, -8.0, 0.0]),
        rotations=motion.rotations.copy(),
    )
    turned.rotations[:, 0] = quat_mul(yaw, turned.rotations[:, 0])
    before, after = assess(Subject(motion, rig)), assess(Subject(turned, rig))
    assert 0 < before.implausible < 1
    for name in before.clip.flags:
        np.testing.assert_array_equal(before.clip.flags[name], after.clip.flags[name])


def test_thresholds_grow_with_the_body() -> None:
    small, big = stick_rig(), scaled(stick_rig(), 4.0)
    source = Subject(standing(small, 60), small)
    sunk = along(standing(big, 60), 2, -0.03)
    assert assess(Subject(sunk, big), source=source).implausible == 0
    assert assess(Subject(along(sunk, 2, -0.02), big), source=source).implausible == 1
    record = assess(Subject(sunk, big), source=source).json()
    assert record["threshold_values"]["penetration_m"] == 0.04


def test_a_scaled_body_that_walks_the_scaled_path_does_not_drift() -> None:
    small, big = stick_rig(), scaled(stick_rig(), 2.0)
    walk = along(standing(small, 120), 0, 1.3 * np.arange(120) / 60)
    big_walk = along(standing(big, 120), 0, 2.6 * np.arange(120) / 60)
    drift = assess(Subject(big_walk, big), source=Subject(walk, small)).json()["root_drift"]
    assert drift["largest_m"] == pytest.approx(0, abs=1e-9)
    assert drift["source_path_m"] == pytest.approx(2.6 * 119 / 60)


def test_a_source_floor_far_from_zero_is_found_where_the_motion_has_it() -> None:
    rig = stick_rig()
    still = standing(rig, 60)
    upstairs = along(still, 2, 3.0)
    for motion in (still, upstairs):
        report = assess(Subject(motion, rig), source=Subject(upstairs, rig))
        assert report.implausible == 0
        assert any("floor" in note for note in report.notes)


def test_the_floor_of_a_source_that_trembles_is_what_it_trembles_about() -> None:
    rig = stick_rig()
    still = standing(rig, 240)
    shaken = moved(still, 0.02 * np.random.default_rng(0).normal(size=(240, 3)))
    report = assess(Subject(still, rig), source=Subject(shaken, rig))
    below = still.root_pos[0, 2] - np.percentile(shaken.root_pos[:, 2], 5)
    assert abs(report.clip.floor_z) < below / 2
    assert report.clip.shares["floating"] == 0.0
    assert report.source is not None
    assert report.source.implausible_share > 0.5  # as it was given
    assert report.contacts is not None
    assert report.contacts.f1 == pytest.approx(1.0, abs=0.05)
    assert any("tremble by" in note for note in report.notes)


@pytest.mark.parametrize(
    ("step", "told"),
    [
        ((0.0, 0.0), ""),
        ((0.5, 0.025), "the source's floor slopes by 2.9°"),
        ((0.02, 0.025), "the source's feet stand higher step by step: it climbs"),
    ],
)
def test_a_floor_that_slopes_is_told_from_a_climb(step: tuple[float, float], told: str) -> None:
    """Three stands, each so far ahead of the last and above it [m]."""
    rig = stick_rig()
    still = standing(rig, 180)
    stands = along(still, 0, np.repeat(np.arange(3), 60) * step[0])
    stands = along(stands, 2, np.repeat(np.arange(3), 60) * step[1])
    notes = assess(Subject(still, rig), source=Subject(stands, rig)).notes
    assert any(note.startswith(told) for note in notes) if told else not notes


def test_all_of_a_long_slope_is_told() -> None:
    """Five stands, each 0.5 m ahead of the last and 5 cm above it."""
    rig = stick_rig()
    steps = np.repeat(np.arange(5), 60)
    stands = along(along(standing(rig, 300), 0, 0.5 * steps), 2, 0.05 * steps)
    notes = assess(Subject(stands, rig)).notes
    told = "the floor slopes by 5.7°: the feet stand 20 cm higher at one end of it"
    assert any(note.startswith(told) for note in notes)


def test_a_part_of_the_source_is_told_from_a_wrong_rate() -> None:
    rig = stick_rig()
    source = standing(rig, 241)
    part = replace(source, root_pos=source.root_pos[40:152], rotations=source.rotations[40:152])
    (note,) = assess(Subject(part, rig), source=Subject(source, rig)).notes
    assert note.endswith(
        "If it was made from a part of the source, give that part: `clip.part(start, end)`"
    )
    fast = replace(source, frame_time=source.frame_time / 2)
    (note,) = assess(Subject(fast, rig), source=Subject(source, rig)).notes
    assert note.endswith("Is its rate 60 fps, and not 120?")
    # At 13.9 frames a second it would last as long, and no file has that rate.
    (note,) = assess(Subject(standing(rig, 56), rig), source=Subject(source, rig)).notes
    assert "rate" not in note
    assert "Is it another motion?" in note


def test_json_is_json_and_says_what_it_is() -> None:
    rig = stick_rig()
    record = assess(Subject(standing(rig, 30), rig), source=Subject(standing(rig, 30), rig)).json()
    again = json.loads(json.dumps(record, allow_nan=False))
    assert again == record
    assert again["schema"] == "spark-sim report 1"
    assert again["thresholds"] == "plausibility v5"


def test_rows_hold_what_the_record_does_beside_the_source() -> None:
    rig = stick_rig()
    still = standing(rig, 60)
    report = assess(Subject(along(still, 2, 0.05), rig), source=Subject(still, rig))
    rows = {row["measure"]: row for row in report.rows()}
    record = report.json()
    for name, flag in record["clip"]["flags"].items():
        assert rows[name]["value"] == 100 * flag["share"]
        assert rows[name]["source"] == 100 * record["source"]["flags"][name]["share"]
    assert rows["floating"] == {"measure": "floating", "value": 100, "unit": "%", "source": 0}
    assert rows["balance"]["value"] is None  # nothing is near the floor
    assert rows["root_drift"]["source"] is None
    assert rows["ground_truth_mse"]["value"] is None
    assert set(rows) == set(LABELS)
    assert {finding.measure for finding in report.findings} <= set(LABELS)


def test_a_report_shows_itself_in_a_line_and_in_a_notebook() -> None:
    rig = stick_rig()
    report = assess(Subject(standing(rig, 60), rig))
    assert len(repr(report)) < 200
    assert "60 frames, 60 fps, 0.0 % implausible" in repr(report)
    assert "root_wrench 0.0)" in repr(report)
    shown = report._repr_html_()
    assert shown.count("<tr>") == 1 + sum(row["value"] is not None for row in report.rows())
    assert "root wrench [%]" in shown


def test_text_has_colour_only_on_request() -> None:
    rig = stick_rig()
    report = assess(Subject(standing(rig, 30), rig))
    assert "\x1b[" in report.text(color=True)
    assert "\x1b[" not in report.text()
    assert "clip's own" in report.text()


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_the_shortest_clips_are_judged(frames: int) -> None:
    rig = stick_rig()
    source = Subject(standing(rig, 1), rig)
    assert assess(Subject(standing(rig, frames), rig), source=source).implausible == 0


def test_bodies_that_cannot_be_judged_are_refused() -> None:
    rig = stick_rig()
    with pytest.raises(SkeletonError, match="no frames"):
        assess(Subject(standing(rig, 0), rig))
    roles = tuple(None if r and "foot" in r else r for r in rig.roles.roles)
    footless = replace(rig, roles=RoleMap(roles, rig.roles.confidence, rig.roles.reasons))
    with pytest.raises(SkeletonError, match="no foot"):
        assess(Subject(standing(rig, 3), footless))


def test_a_tiptoe_stands_on_its_toes() -> None:
    rig = stick_rig()
    tiptoe = standing(rig, 60)
    # Both feet pitch by 30 degrees about the ankle; the ball's depth under it grows by that turn.
    ball = 0.1 * np.cos(np.pi / 6) + 0.13 * np.sin(np.pi / 6)
    for foot, toe in ((Role.LEFT_FOOT, Role.LEFT_TOE), (Role.RIGHT_FOOT, Role.RIGHT_TOE)):
        tiptoe.rotations[:, joint(foot)] = quat_about("y", np.array(np.pi / 6))
        tiptoe.rotations[:, joint(toe)] = quat_about("y", np.array(-np.pi / 6))
    tiptoe = along(tiptoe, 2, ball - 0.1)
    report = assess(Subject(tiptoe, rig), source=Subject(standing(rig, 60), rig))
    assert report.implausible == 0
    heel = 0.25 * FOOT_LENGTH * rig.standing_height
    flat = along(tiptoe, 2, -heel * 0.3)
    report = assess(Subject(flat, rig), source=Subject(standing(rig, 60), rig))
    assert shares(report)["penetration"] == 1


def test_a_hand_in_the_chest_is_named() -> None:
    rig = stick_rig()
    still = standing(rig, 60)
    pierced = standing(rig, 60)
    # The upper arm points forward and inwards, the forearm folds back onto the breast bone.
    upper = quat_from_yaw(np.array(-np.radians(110.0)))
    pierced.rotations[:, joint(Role.LEFT_UPPER_ARM)] = upper
    pierced.rotations[:, joint(Role.LEFT_FOREARM)] = quat_from_yaw(np.array(-np.radians(150.0)))
    report = assess(Subject(pierced, rig), source=Subject(still, rig))
    assert any(
        {"chest"} < set(f.where.split(", ")) and "left" in f.where
        for f in report.findings
        if f.measure == "self_penetration"
    )
    assert report.json()["clip"]["self_penetration_share"] == 1
    # What the source does too is not held against the motion.
    again = assess(Subject(pierced, rig), source=Subject(pierced, rig))
    assert again.json()["clip"]["self_penetration_share"] == 0
    assert again.json()["source"]["self_penetration_share"] == 1


def test_contacts_are_compared_at_the_same_times_whatever_the_frame_rates() -> None:
    rig = stick_rig()

    def hops(fps: float) -> Motion:
        still = standing(rig, int(4 * fps), fps)
        return along(still, 2, 0.3 * np.maximum(np.sin(2 * np.pi * seconds(still)), 0))

    same = assess(Subject(hops(30), rig), source=Subject(hops(120), rig)).contacts
    assert same is not None
    assert same.f1 == pytest.approx(1, abs=0.05)
    never = assess(
        Subject(along(hops(30), 0, 2 * seconds(hops(30))), rig), source=Subject(hops(120), rig)
    ).contacts
    assert never is not None
    assert never.recall == 0


def test_a_foot_stands_on_any_part_of_its_sole() -> None:
    """On the heel with the toes up, for one second of two; flat in the source."""
    rig = stick_rig()
    source = Subject(standing(rig, 120), rig)
    heels, lift = standing(rig, 120), np.zeros(120)
    angle, heel = np.radians(25.0), 0.25 * FOOT_LENGTH * rig.standing_height
    for side in ("left", "right"):
        heels.rotations[60:, joint(Role(f"{side}_foot"))] = quat_about("y", -angle)
    lift[60:] = heel * np.sin(angle) - 0.1 * (1 - np.cos(angle))  # the ankle is 0.1 m up
    report = assess(Subject(along(heels, 2, lift), rig), source=source)
    assert report.clip.depth.max() < 1e-6
    assert report.contacts is not None
    assert report.contacts.f1 == pytest.approx(1, abs=0.03)  # the heels come down moving
    # One leg swings the foot forward and up: what doesn't stand is not a contact.
    raised = standing(rig, 120)
    raised.rotations[60:, joint(Role.LEFT_UPPER_LEG)] = quat_about("y", np.array(-0.6))
    report = assess(Subject(raised, rig), source=source)
    assert report.contacts is not None
    assert report.contacts.precision == 1
    assert report.contacts.recall == pytest.approx(0.75, abs=0.02)


def test_a_foot_above_the_floor_does_not_stand() -> None:
    rig = stick_rig()
    source = Subject(standing(rig, 60), rig)
    for height, recall in ((0.05, 1), (0.07, 0)):
        contacts = assess(Subject(along(standing(rig, 60), 2, height), rig), source=source).contacts
        assert contacts is not None
        assert contacts.recall == recall
    # By the size of each: on a body four times as large, 20 cm are no more than 5 cm on this one.
    big = scaled(rig, 4.0)
    contacts = assess(Subject(along(standing(big, 60), 2, 0.2), big), source=source).contacts
    assert contacts is not None
    assert contacts.recall == 1


def test_a_statue_beside_its_feet_is_out_of_balance() -> None:
    rig = stick_rig()
    still = standing(rig, 60)
    assert assess(Subject(still, rig)).clip.unbalanced_share == 0
    leaning = standing(rig, 60)
    angle = np.radians(30.0)
    leaning.rotations[:, 0] = quat_about("y", angle)
    for side in ("left", "right"):
        leaning.rotations[:, joint(Role(f"{side}_foot"))] = quat_about("y", -angle)
    leaning = along(leaning, 2, -0.8 * (1 - np.cos(angle)))
    report = assess(Subject(leaning, rig), source=Subject(still, rig))
    assert report.clip.unbalanced_share == 1
    # The ankles lie 0.8 sin 30° behind the hips, the toes 0.2 ahead of them; the centre of mass is
    # a little above the hips.
    height = report.clip.imbalance[0]
    assert height == pytest.approx(0.8 * np.sin(angle) - 0.2 + 0.07 * np.sin(angle), abs=0.05)


@pytest.mark.parametrize(
    ("start", "stop", "place"),
    [
        (57, 58, "at frame 57 (0.95 s)"),
        (148, 150, "in frames 148-149 (2.47-2.48 s)"),
        (212, 241, "in frames 212-240 (3.5-4.0 s)"),
    ],
)
def test_places_are_as_fine_as_they_are_short(start: int, stop: int, place: str) -> None:
    assert Finding("skating", "left foot", start, stop, 0.1, "m", "").place(1 / 60) == place


def test_results_stand_beside_each_other_with_the_least_marked() -> None:
    rig = stick_rig()
    still = standing(rig, 60)
    table = compare(
        {
            "good": assess(Subject(still, rig), source=Subject(still, rig)),
            "floats": assess(Subject(along(still, 2, 0.05), rig), source=Subject(still, rig)),
        }
    ).splitlines()
    assert table[0].split() == ["good", "floats"]
    rows = {line[:34].strip(): line[34:].split() for line in table[1:]}
    assert rows["implausible [%]"] == ["0.0*", "100.0"]
    assert rows["penetration [%]"] == ["0.0", "0.0"]
    assert rows["out of balance [%]"] == ["0.0", "-"]


@pytest.mark.parametrize("path", recordings("zoo/*.bvh", "makehuman/*.bvh", "reactidle/00*.bvh"))
def test_every_recorded_body_is_judged_or_was_refused(path: Path) -> None:
    try:
        motion = read_recording(path).motion.frames(0, 60)
        rig = understand(motion)
    except SparkSimError:
        return
    report = assess(Subject(motion, rig), source=Subject(motion, rig))
    json.dumps(report.json(), allow_nan=False)
    assert report.text()
    assert report.drift is not None
    assert report.drift.distance.max() < 1e-6
    assert report.clip.self_depth.max(initial=0.0) < 1e-9
