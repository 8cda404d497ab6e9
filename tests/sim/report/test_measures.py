"""Each measure of the report against an answer worked out by hand."""

import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from sim.report.derivatives import derivative
from sim.report.limits import limit_excess, swing_and_twist
from sim.report.measures import (
    contact_match,
    distance_outside_hull,
    floating,
    floor_height,
    floor_slope,
    horizontal_speed,
    penetration_depth,
    root_drift,
    windowed_min,
)
from sim.report.self_penetration import Capsules, segment_distance, self_penetration
from sim.report.smoothness import joint_rates
from sim.report.thresholds import PLAUSIBILITY
from spark.kinematics import forward
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_mul
from tests.helpers.stick import joint, standing, stick_rig


@pytest.mark.parametrize("fps", [15, 24, 29.97, 60, 120])
def test_derivatives_are_exact_for_parabolas_at_any_frame_rate(fps: float) -> None:
    times = np.arange(int(3 * fps)) / fps
    values = 1 + 2 * times - 4 * times**2
    inside = (times > 0.1) & (times < times[-1] - 0.1)
    velocity = derivative(values, 1 / fps, 1, 0.05)
    acceleration = derivative(values, 1 / fps, 2, 0.05)
    np.testing.assert_allclose(velocity[inside], (2 - 8 * times)[inside], atol=1e-9)
    np.testing.assert_allclose(acceleration, -8, atol=1e-6)


def test_derivatives_of_one_two_and_three_frames() -> None:
    assert derivative(np.array([5.0]), 0.1, 1, 0.05) == [0]
    np.testing.assert_allclose(derivative(np.array([5.0, 6.0]), 0.1, 1, 0.05), [10, 10])
    np.testing.assert_allclose(derivative(np.array([0.0, 1.0, 4.0]), 1.0, 2, 0.05), [2, 2, 2])


def test_the_floor_is_the_fifth_percentile_so_a_few_deep_frames_do_not_lower_it() -> None:
    lowest = np.full(100, 0.02)
    lowest[:4] = -0.5
    assert floor_height(lowest) == pytest.approx(0.02)


def test_depth_is_how_far_a_point_is_under_the_floor() -> None:
    heights = np.array([[0.03, -0.02], [0.0, 0.5]])
    np.testing.assert_array_equal(penetration_depth(heights), [[0, 0.02], [0, 0]])


def test_floating_needs_height_and_no_free_fall() -> None:
    clearance = np.array([0.03, 0.05, 0.05])
    fall_error = np.array([9.81, 9.81, 3.9])
    np.testing.assert_array_equal(floating(clearance, fall_error, 0.04, 4.0), [False, True, False])


@pytest.mark.parametrize("frame_time", [1.0, 0.5, 0.25])
def test_the_least_of_a_slope_within_a_window_lies_at_its_edge(frame_time: float) -> None:
    slope = 2.0 * np.arange(int(10 / frame_time)) * frame_time
    least = windowed_min(slope, frame_time, 0.6)
    np.testing.assert_allclose(least, np.maximum(slope - 2 * 0.6, 0))
    np.testing.assert_allclose(windowed_min(-slope, frame_time, 0.6)[0], -2 * 0.6)


def test_speed_is_horizontal_and_per_second() -> None:
    times = np.arange(60) / 60
    points = np.stack([0.3 * times, 0.4 * times, 5 * times], axis=-1)[:, None]
    np.testing.assert_allclose(horizontal_speed(points, 1 / 60, 0.05), 0.5, rtol=1e-9)


def test_drift_compares_scaled_paths_from_a_common_start() -> None:
    # The source walks 3 m along X; a body half its size should walk 1.5 m, and walks 1.5 m along Y.
    ahead = np.linspace(0, 3, 4)
    source = np.stack([ahead, 0 * ahead, 0 * ahead + 0.9], axis=-1)
    path = np.stack([0 * ahead + 7, 0.5 * ahead, 0 * ahead + 0.45], axis=-1)
    turned = np.full(4, 2 * np.pi + 0.1)
    drift = root_drift(path, turned, source, np.zeros(4), 0.5, frame_time=1.0)
    assert drift.path_length == pytest.approx(1.5)
    np.testing.assert_allclose(drift.distance, 0.5 * ahead * np.sqrt(2))
    np.testing.assert_allclose(drift.heading, 0.1)


def test_a_t_pose_elsewhere_before_the_source_is_no_drift_of_the_rest() -> None:
    ahead = np.linspace(0, 3, 60)
    source = np.stack([ahead, 0 * ahead, 0 * ahead + 0.9], axis=-1)
    path, heading = source - source[1], np.zeros(60)
    source[0], heading[0] = [40.0, -2.0, 0.9], 4.0
    drift = root_drift(path, np.zeros(60), source, heading, 1.0, frame_time=1 / 60)
    np.testing.assert_allclose(drift.distance, 0.0, atol=1e-12)
    np.testing.assert_allclose(drift.heading, 0.0)
    assert drift.path_length == pytest.approx(3.0, rel=0.02)


def test_a_frame_that_faces_back_does_not_turn_all_that_follow() -> None:
    """Without jumps, the heading of what follows is a whole turn off."""
    path, heading = np.zeros((60, 3)), np.zeros(60)
    heading[30], heading[31:] = np.pi, 2 * np.pi
    drift = root_drift(path, heading, path, np.zeros(60), 1.0, frame_time=1 / 60)
    assert np.abs(drift.heading[30]) == pytest.approx(np.pi)
    np.testing.assert_allclose(np.delete(drift.heading, 30), 0.0, atol=1e-12)


def test_swing_and_twist_add_up_for_a_turn_about_one_axis() -> None:
    for axis, expected in (("x", [0.4, 0, 0]), ("y", [0, 0.4, 0]), ("z", [0, 0, 0.4])):
        turn = quat_about(axis, np.array([0.4]))
        for bone in range(3):
            np.testing.assert_allclose(swing_and_twist(turn, bone)[0], expected, atol=1e-12)


def test_distance_from_a_square_of_support() -> None:
    square = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [9.0, 9.0]]] * 4)
    use = np.array([[True, True, True, True, False]] * 4)
    place = np.array([[0.5, 0.5], [1.3, 0.5], [2.0, 2.0], [0.5, -0.2]])
    expected = [0, 0.3, np.sqrt(2), 0.2]
    np.testing.assert_allclose(distance_outside_hull(place, square, use), expected, rtol=1e-3)
    assert distance_outside_hull(place[:1], square[:1], ~use[:1] & False) == [np.inf]


def test_the_slope_of_the_floor_and_how_far_it_rises() -> None:
    ground = np.random.default_rng(2).uniform(0, [3.0, 1.0], (50, 2))
    ground[:2] = [[0, 0], [3, 1]]
    height = 0.02 * ground[:, 0]  # 2 cm a metre along X, from 0 to 6 cm
    slope = floor_slope(np.column_stack([ground, height]))
    np.testing.assert_allclose(slope.gradient, [0.02, 0.0], atol=1e-12)
    assert slope.angle == pytest.approx(np.arctan(0.02))
    assert slope.rise == pytest.approx(0.06)
    stairs = np.column_stack([ground, 0.1 * (np.arange(50) % 2)])
    for places in (stairs, np.zeros((2, 3)), np.ones((9, 3))):
        level = floor_slope(places)
        assert (level.angle, level.rise) == (0, 0)


def test_contacts_precision_recall_and_f1() -> None:
    ours = np.array([[1, 1], [1, 0], [0, 0], [1, 0]], dtype=bool)
    theirs = np.array([[1, 0], [1, 0], [1, 0], [0, 1]], dtype=bool)
    match = contact_match(ours, theirs)  # 2 right of 4 found and of 4 true
    assert (match.precision, match.recall, match.f1) == (0.5, 0.5, 0.5)
    nothing = contact_match(~ours & False, ~ours & False)
    assert (nothing.precision, nothing.recall, nothing.f1) == (None, None, None)


# Each: two segments, their distance.
SEGMENTS = [
    (((0, 0, 0), (2, 0, 0)), ((1, 1, 0), (1, 3, 0)), 1.0),
    (((0, 0, 0), (2, 0, 0)), ((1, -1, 0.5), (1, 1, 0.5)), 0.5),
    (((0, 0, 0), (2, 0, 0)), ((3, 0, 4), (9, 0, 4)), np.sqrt(17)),
    (((0, 0, 0), (2, 0, 0)), ((5, 1, 0), (4, 1, 0)), np.sqrt(5)),
    (((1, 1, 1), (1, 1, 1)), ((1, 1, 3), (1, 1, 3)), 2.0),
    (((0, 0, 0), (0, 0, 4)), ((3, 0, 2), (3, 0, 2)), 3.0),
    (((3, 0, 2), (3, 0, 2)), ((0, 0, 0), (0, 0, 4)), 3.0),
]


@pytest.mark.parametrize(("one", "other", "expected"), SEGMENTS)
def test_distances_of_segments(one: object, other: object, expected: float) -> None:
    first, second = np.array([one], dtype=float), np.array([other], dtype=float)
    assert segment_distance(first, second) == pytest.approx(expected)
    assert segment_distance(second, first) == pytest.approx(expected)


def test_segment_distance_is_the_least_over_all_pairs_of_points() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=(2, 50, 2, 3))
    s, t = np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101))
    points = one[:, :1] + s.reshape(-1, 1) * (one[:, 1:] - one[:, :1])
    others = other[:, :1] + t.reshape(-1, 1) * (other[:, 1:] - other[:, :1])
    sampled = np.linalg.norm(points - others, axis=-1).min(axis=1)
    exact = segment_distance(one, other)
    assert (exact <= sampled + 1e-9).all()
    np.testing.assert_allclose(exact, sampled, atol=0.03)


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_speed_and_jerk_of_a_swinging_elbow(fps: float) -> None:
    # angle = 0.5 sin 6t: speed 3 |cos 6t|, jerk 0.5 · 6³ |cos 6t| = 108 |cos 6t|.
    rig = stick_rig()
    motion = standing(rig, int(4 * fps), fps)
    times = np.arange(len(motion)) / fps
    motion.rotations[:, joint(Role.LEFT_FOREARM)] = quat_about("z", 0.5 * np.sin(6 * times))
    names, speed, jerk, turns = joint_rates(forward(motion)[1], rig, 1 / fps, 0.05)
    elbow = names.index("left forearm")
    inside = slice(len(times) // 10, -len(times) // 10)
    # The window damps 6 rad/s by a percent or two, in both derivatives.
    cosine = np.abs(np.cos(6 * times))[inside]
    np.testing.assert_allclose(speed[inside, elbow], 3 * cosine, atol=0.06)
    np.testing.assert_allclose(jerk[inside, elbow], 108 * cosine, atol=4)
    between = 0.5 * np.abs(np.diff(np.sin(6 * times)))
    np.testing.assert_allclose(turns[:, elbow], [0, *between], atol=1e-9)
    assert speed[:, [k for k in range(len(names)) if k != elbow]].max() < 1e-9


# Turns of one joint away from the T-pose, and the only excess they give [deg].
BENDS = [
    (Role.LEFT_LOWER_LEG, "y", 120, None, 0),
    (Role.RIGHT_LOWER_LEG, "y", 120, None, 0),
    (Role.LEFT_LOWER_LEG, "y", -60, "left knee bends backwards", 35),
    (Role.RIGHT_LOWER_LEG, "y", -60, "right knee bends backwards", 35),
    (Role.LEFT_LOWER_LEG, "x", 60, "left knee bends sideways", 15),
    (Role.LEFT_UPPER_LEG, "y", -120, None, 0),
    (Role.LEFT_UPPER_LEG, "y", 100, "left hip extends", 40),
    (Role.LEFT_FOREARM, "z", -140, None, 0),
    (Role.LEFT_FOREARM, "z", 70, "left elbow bends backwards", 30),
    (Role.RIGHT_FOREARM, "z", 140, None, 0),
    (Role.RIGHT_FOREARM, "z", -70, "right elbow bends backwards", 30),
    (Role.LEFT_UPPER_ARM, "x", -90, None, 0),
    (Role.HEAD, "z", 140, "neck twists", 20),
    (Role.SPINE, "y", 90, None, 0),
    (Role.SPINE, "y", -90, "trunk bends backwards", 25),
]


@pytest.mark.parametrize(("role", "axis", "degrees", "movement", "excess"), BENDS)
def test_limits_name_the_joint_the_movement_and_the_excess(
    role: Role, axis: str, degrees: float, movement: str | None, excess: float
) -> None:
    rig = stick_rig()
    turn = quat_about(axis, np.radians(degrees))
    since_tpose = standing(rig, 1).rotations.copy()
    below = list(rig.skeleton.subtree(joint(role)))
    since_tpose[:, below] = turn
    # The pelvis's own orientation must not matter.
    since_tpose = quat_mul(quat_about("z", np.array(2.0)), since_tpose)
    found = {
        f"{limit.joint} {name}": np.degrees(value)
        for limit in limit_excess(since_tpose, rig)
        for name, value in zip(limit.movements, limit.excess[0], strict=True)
        if value > 0
    }
    if movement is None:
        assert found == {}
    else:
        assert found == {movement: pytest.approx(excess)}


def test_parts_are_as_deep_in_each_other_as_their_flesh_overlaps() -> None:
    """Shanks of 5 and 4 cm radius, 6 cm apart: 3 cm. A thigh of 6 cm, above one of them, is 4 cm in
    the other; its own shank it touches by nature."""
    shank = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.1]])
    thigh = np.array([[0.0, 0.0, 0.9], [0.0, 0.0, 0.5]])
    aside = np.array([0.0, 0.06, 0.0])
    body = Capsules(
        ("left lower leg", "right lower leg", "left upper leg"),
        np.array([[shank, shank + aside, thigh]]),
        np.array([0.05, 0.04, 0.06]),
    )
    pairs, depth = self_penetration(body)
    assert pairs == (("left lower leg", "right lower leg"), ("right lower leg", "left upper leg"))
    np.testing.assert_allclose(depth, [[0.03, 0.04]], atol=1e-12)


def test_the_documents_tell_the_thresholds() -> None:
    text = (Path(__file__).parents[3] / "docs" / "report.md").read_text(encoding="utf-8")
    told = {
        name: float(value) for name, value in re.findall(r"^\| `(\w+)` \| ([\d.]+) ", text, re.M)
    }
    used = asdict(PLAUSIBILITY)
    assert used.pop("version") in text
    assert told == used
