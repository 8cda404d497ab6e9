"""The lean of a trunk that cannot bend, or not as far as the source's."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model.known import known
from robots.solver.targets import targets_of
from robots.solver.trunk import (
    bends,
    beyond_lean,
    leaning,
    max_flexion,
    max_lean,
    within_flexion,
)
from spark.demo.sample import sample_motion, sample_rig
from spark.kinematics import world_positions
from spark.rig.roles import Role
from spark.rotation import (
    quat_angle,
    quat_conj,
    quat_from_rotvec,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
    yaw_from_quat,
)
from spark.transfer.canonical import to_canonical

RIG = sample_rig("walker")
FLOOR = -RIG.hip_height  # the T-pose's hips are at 0
LEGS = "upper_leg", "lower_leg", "foot", "toe"
TURNS = [[0.0, 0.0, 1.2], [0.0, 0.5, 0.0], [0.3, 0.0, 0.0]]


def trunk(positions: np.ndarray) -> np.ndarray:
    shoulders = [RIG.roles.require(role) for role in (Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM)]
    along = positions[shoulders].mean(0) - positions[RIG.hips].mean(0)
    return along / np.linalg.norm(along)


@pytest.mark.parametrize("rotvec", TURNS)
def test_a_stiff_source_is_followed(rotvec: list[float]) -> None:
    turn = quat_from_rotvec(np.array([rotvec]))
    positions = quat_rotate(turn, RIG.tpose_positions)
    found = leaning(RIG, turn, positions[None])
    assert quat_angle(turn, found)[0] < np.radians(2)


def test_a_tilted_pelvis_under_an_upright_trunk_bows_nobody() -> None:
    heading = quat_from_yaw(np.array([2.0]))
    pelvis = quat_mul(heading, quat_from_rotvec(np.array([[0.0, 0.6, 0.0]])))
    positions = quat_rotate(heading, RIG.tpose_positions)
    found = leaning(RIG, pelvis, positions[None])
    np.testing.assert_allclose(
        quat_rotate(found, trunk(RIG.tpose_positions)[None])[0], trunk(positions), atol=1e-9
    )
    assert yaw_from_quat(found)[0] == pytest.approx(2.0, abs=0.02)


def test_only_what_cannot_bend_leans_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, source = known("robot"), to_canonical(sample_motion("walk", RIG, 30.0), RIG)
    assert bends(robot)
    bent = targets_of(source, robot).world[:, robot.rig.pelvis]
    monkeypatch.setattr("robots.solver.trunk.bends", lambda _: False)
    stiff = targets_of(source, robot).world[:, robot.rig.pelvis]
    own = quat_mul(source.rotations[:, RIG.pelvis], robot.rig.tpose[robot.rig.pelvis])
    np.testing.assert_allclose(bent, own, atol=1e-9)
    positions = world_positions(RIG.skeleton, quat_mul(source.rotations, RIG.tpose), source.hips)
    along = np.stack([trunk(frame) for frame in positions])
    turned = quat_mul(stiff, quat_conj(robot.rig.tpose[robot.rig.pelvis]))
    np.testing.assert_allclose(quat_rotate(turned, trunk(RIG.tpose_positions)), along, atol=1e-6)


@pytest.mark.parametrize(("name", "bend"), [("booster_t1", False), ("unitree_g1", True)])
def test_waists_are_told_apart(name: str, bend: bool) -> None:
    assert bends(known(name)) is bend


def test_a_waist_is_the_same_where_a_file_has_the_robot_lie(tmp_path: Path) -> None:
    ember = known("ember")
    spec = ember.mjcf.spec.copy()
    spec.worldbody.first_body().quat = [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]
    path = tmp_path / "lying.xml"
    path.write_text(spec.to_xml())
    lying = known(str(path))
    assert bends(lying)
    np.testing.assert_allclose(max_lean(lying), max_lean(ember), atol=0.02)


@pytest.mark.parametrize(
    ("bow", "most", "left"),
    [
        (1.2, (0.3, 0.4), 0.8),
        (-0.4, (0.1, 0.4), -0.3),
        (0.6, (0.0, 0.4), 0.2),
        (0.25, (0.3, 0.4), 0.0),
        (-0.15, (0.3, 0.4), 0.0),
    ],
)
def test_a_pelvis_bows_by_what_a_waist_lacks(
    bow: float, most: tuple[float, float], left: float
) -> None:
    """A spine bends over a pelvis that stands upright, and heads where it likes."""
    heading = quat_from_yaw(np.array([2.0]))
    positions = quat_rotate(heading, bent(bow))[None]
    found = beyond_lean(RIG, heading, positions, most)
    expected = quat_mul(heading, quat_from_rotvec(np.array([[0.0, left, 0.0]])))
    assert quat_angle(expected, found)[0] < 0.01


def test_a_pelvis_that_somersaults_bows_without_jumps() -> None:
    """It heads as before while it has a heading, and rolls over from one frame to the next."""
    angles = np.linspace(0, 2 * np.pi, 721)
    rolls = np.radians(5.0) * np.eye(3)[:1]
    pelvis = quat_mul(quat_from_rotvec(np.outer(angles, np.eye(3)[1])), quat_from_rotvec(rolls))
    positions = quat_rotate(pelvis[:, None], bent(1.2)[None])
    bowed = beyond_lean(RIG, pelvis, positions, (0.3, 0.4))
    assert quat_angle(bowed[1:], bowed[:-1]).max() < 4 * np.radians(0.5)
    upright = angles < np.radians(20)
    np.testing.assert_allclose(
        yaw_from_quat(bowed)[upright], yaw_from_quat(pelvis)[upright], atol=1e-6
    )


def test_a_waist_leans_by_its_limits_above_its_hinge() -> None:
    """A line from the hips to the shoulders leans less than the chest: only from the hinge on."""
    robot = known("unitree_g1")
    model, data = robot.mjcf.model, mujoco.MjData(robot.mjcf.model)
    mujoco.mj_forward(model, data)
    height = {
        name: data.joint(name).xanchor[2]
        for name in ("left_hip_roll_joint", "waist_pitch_joint", "left_shoulder_roll_joint")
    }
    hips, waist, shoulders = height.values()
    low, high = np.abs(model.joint("waist_pitch_joint").range)
    share = (shoulders - waist) / (shoulders - hips)
    np.testing.assert_allclose(max_lean(robot), share * np.array([low, high]), rtol=0.12)


def bent(bow: float) -> np.ndarray:
    """The T-pose with all above its hips bowed by so much [rad]."""
    positions = RIG.tpose_positions.copy()
    upper = [j for j, role in enumerate(RIG.roles.roles) if role and role.part not in LEGS]
    turn = quat_from_rotvec(np.array([0.0, bow, 0.0]))
    middle = positions[RIG.hips].mean(0)
    positions[upper] = middle + quat_rotate(turn, positions[upper] - middle)
    return positions


def crouching(bow: float, ahead: float = 0.0) -> np.ndarray:
    """The T-pose with its trunk bowed by so much [rad] over thighs that are level and shanks that
    are upright; the feet are so far [m] behind those places."""
    positions = bent(bow)
    for side in ("left", "right"):
        hip, knee, foot = (RIG.roles.require(Role(f"{side}_{part}")) for part in LEGS[:3])
        positions[knee] = positions[hip] + [0.4, 0.0, 0.0]
        for joint in (foot, *RIG.roles.joints(Role(f"{side}_toe"))):
            positions[joint] += [0.3 - ahead, 0.0, 0.4]
    return positions


@pytest.mark.parametrize(("flexion", "left"), [(2.0, 2.0 - np.pi / 2), (3.0, 1.2)])
def test_a_trunk_bows_no_further_than_hips_flex(flexion: float, left: float) -> None:
    """Thighs that are level are at right angles to an upright trunk."""
    upright, bowed = np.array([[1.0, 0, 0, 0]]), quat_from_rotvec(np.array([[0.0, 1.2, 0.0]]))
    found = within_flexion(RIG, bowed, crouching(1.2)[None], FLOOR + 0.4, flexion)
    assert quat_angle(upright, found)[0] == pytest.approx(left, abs=0.01)


def test_who_leans_on_the_arms_bows_all_the_same() -> None:
    bowed = quat_from_rotvec(np.array([[0.0, 1.2, 0.0]]))
    found = within_flexion(RIG, bowed, crouching(1.2, ahead=0.8)[None], FLOOR + 0.4, 2.0)
    np.testing.assert_allclose(found, bowed)


@pytest.mark.parametrize(
    ("name", "degrees"), [("robot", np.degrees(2.4)), ("booster_t1", 103.0), ("unitree_h1", 90.0)]
)
def test_hips_flex_as_their_limits_say(name: str, degrees: float) -> None:
    """To within how the T-pose stands beside the zero of the file."""
    assert np.degrees(max_flexion(known(name))) == pytest.approx(degrees, abs=4)
