"""Motions tracked in simulation, against mechanics worked by hand."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model.mjcf import read_mjcf
from robots.model.understand import understand_robot
from robots.registry import find
from sim.physics.simulation import Assist
from sim.physics.summary import render, summarize
from sim.physics.tracking import TrackingResult, track
from sim.trajectory import ModelTrajectory, model_trajectory
from spark.demo.sample import sample_motion, sample_rig
from spark.errors import SkeletonError
from tests.helpers.stick import standing, stick_rig

FPS, HEIGHT, G = 60.0, 1.7, 9.81
MACHINE = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="base" pos="0 0 0.1">
      <freejoint/>
      <geom type="box" size="0.5 0.5 0.1" mass="200"/>
      <body name="arm" pos="0 0 1">
        <joint name="elbow" {joint}/>
        <inertial pos="0.5 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>
      </body>
    </body>
  </worldbody>
  <actuator>{actuator}</actuator>
</mujoco>"""
BARE = '<inertial pos="0 0 0" mass="200" diaginertia="1 1 1"/>'
HINGE = 'type="hinge" axis="0 1 0"'


def still(seconds: float, *, up: float = 0.0) -> ModelTrajectory:
    """The stick man in its T-pose, `up` metres above the floor."""
    rig = stick_rig()
    body = model_trajectory(rig, standing(rig, int(seconds * FPS) + 1, FPS))
    body.qpos[:, 2] += up
    return body


def machine(actuator: str, frames: int, *, joint: str = HINGE) -> ModelTrajectory:
    """A heavy box with an arm of 2 kg, whose centre lies 0.5 m ahead, held level."""
    spec = mujoco.MjSpec.from_string(MACHINE.format(actuator=actuator, joint=joint))
    model = spec.compile()
    return ModelTrajectory(spec, model, 1, np.tile(model.qpos0, (frames, 1)))


def follow(body: ModelTrajectory, *, assist: Assist | None = None) -> TrackingResult:
    return track(body, 1 / FPS, height=HEIGHT, assist=assist)


def center_of_mass(tracked: TrackingResult) -> np.ndarray:
    model, root = tracked.model, tracked.target.root
    data, out = mujoco.MjData(model), np.zeros((len(tracked.rollout.qpos), 3))
    for t, qpos in enumerate(tracked.rollout.qpos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        out[t] = data.subtree_com[root]
    return out


def test_a_tpose_stands_without_help() -> None:
    tracked = follow(still(2.0))
    found = summarize(tracked)
    assert found["fall_frame"] is None
    assert found["assist"] is None
    assert found["error"]["mpjpe_cm"] < 1.0
    assert found["error"]["joints_deg"] < 1.0
    # The floor carries the whole weight, with nothing but the feet on it.
    assert tracked.rollout.loads[-30:].sum(1).mean() == pytest.approx(tracked.mass * G, rel=0.01)
    assert {each["body"].split("_")[1] for each in found["floor"]} <= {"foot", "toe"}


def test_a_walk_is_tracked_with_help() -> None:
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, FPS)
    found = summarize(follow(model_trajectory(rig, motion), assist=Assist()))
    assert found["fall_frame"] is None
    assert found["error"]["mpjpe_cm"] < 5.0
    assert found["error"]["joints_deg"] < 3.0
    assert found["assist"]["carried"] < 0.5, "the legs carry most of it"
    assert found["assist"]["force"]["max"] <= 1.0 + 1e-9


def test_free_fall_is_gravity_alone() -> None:
    tracked = follow(still(0.6, up=3.0))
    t = np.arange(len(tracked.rollout.qpos)) / FPS
    np.testing.assert_allclose(
        center_of_mass(tracked)[:, 2] - center_of_mass(tracked)[0, 2],
        -G * t * (t + tracked.model.opt.timestep) / 2,  # the integrator's own sum
        atol=1e-4,
    )
    assert not tracked.rollout.loads.any()
    assert np.sqrt(tracked.rollout.square).max() < 1.0, "nothing to hold"
    assert summarize(tracked)["fall_frame"] is None, "it is still above where it would stand"


def test_who_stands_while_the_target_flies_has_not_fallen() -> None:
    """A target far above the floor asks for a pose; one on the floor, for its height too."""
    standing, t = still(1.5), np.arange(91) / FPS
    flight = np.clip((t - 0.5) * (1.3 - t), 0.0, None)
    standing.qpos[:, 2] += 5 * flight  # by up to 0.8 m
    assert summarize(follow(standing))["verdict"] == "stays_up"
    kneeling = still(0.1)
    kneeling.qpos[1:, 2] -= 0.5 * HEIGHT  # the body is higher than this, and so has not fallen
    assert summarize(follow(kneeling))["fall_frame"] is None


def leaning(seconds: float) -> ModelTrajectory:
    """The stick man, as it leans forwards by 0.4 rad, on its feet."""
    body = still(seconds)
    body.qpos[:, 3:7] = [np.cos(0.2), 0.0, np.sin(0.2), 0.0]
    return body


def test_a_body_that_tips_over_falls_when_it_is_too_low() -> None:
    """It is an inverted pendulum: from where it counts as fallen on, it does until it lies."""
    tracked = follow(leaning(1.5))
    fallen = tracked.rollout.fallen
    fall = int(np.flatnonzero(fallen)[0])
    drop = tracked.target_points[:, 0, 2] - tracked.rollout.points[:, 0, 2]
    assert drop[fall - 1] < 0.2 * HEIGHT < drop[fall] + 0.03
    assert fallen[fall:].all()


def test_held_in_the_air_the_assist_is_the_whole_weight() -> None:
    tracked = follow(still(3.0, up=2.0), assist=Assist(force=2.0))
    weight = tracked.mass * G
    force, torque = np.split(tracked.rollout.wrench[-60:].mean(0), 2)
    np.testing.assert_allclose(force / weight, [0, 0, 1], atol=0.005)
    # It hangs below its target where the spring of 10 rad/s carries it: g / 10².
    sag = tracked.target.qpos[-1, 2] - tracked.rollout.qpos[-1, 2]
    assert sag == pytest.approx(G / 100, rel=0.01)
    # A force at the pelvis holds a body whose centre of mass is elsewhere only with a torque.
    arm = center_of_mass(tracked)[-60:].mean(0) - tracked.rollout.points[-60:, 0].mean(0)
    np.testing.assert_allclose(torque, np.cross(arm, [0, 0, weight]), atol=0.01 * weight)


def test_a_body_that_hangs_does_not_stay_up() -> None:
    """On its feet it is helped; held 5 cm above where it could stand, it hangs by half."""
    alone = summarize(follow(still(2.0)))
    assert (alone["verdict"], alone["stays_up_s"], alone["upright_s"]) == ("stays_up", 2.0, 2.0)
    standing = summarize(follow(still(2.0), assist=Assist()))
    assert (standing["verdict"], standing["stays_up_s"]) == ("helped", 2.0)
    assert standing["assist"]["carried"] < 0.02
    held = summarize(follow(still(2.0, up=0.05), assist=Assist()))
    # The spring of (10 rad/s)² m x 5 cm lifts 5 m/s² of 9.81; the feet stand with the rest.
    assert held["assist"]["carried"] == pytest.approx(0.05 * 10**2 / G, abs=0.05)
    assert (held["verdict"], held["stays_up_s"], held["upright_s"]) == ("carried", None, 2.0)
    text = render(held, "x")
    assert "does not stay up" in text
    assert "  stays up  " not in text
    assert "  stays up  all 2.00 s, at most 0 cm from the motion" in render(alone, "x")


def test_who_stays_up_elsewhere_is_said_to() -> None:
    """The target hovers 0.5 m above the floor on which the body stands after a short fall."""
    tracked = follow(still(1.0, up=0.5))
    found = summarize(tracked)
    assert found["verdict"] == "stays_up"
    apart = np.linalg.norm(tracked.rollout.points - tracked.target_points, axis=2).mean(axis=1)
    assert found["error"]["furthest_cm"] == pytest.approx(100 * apart.max(), abs=1e-3)
    assert 50 < found["error"]["furthest_cm"] < 55
    furthest = f"at most {found['error']['furthest_cm']:.0f} cm from the motion"
    assert f"stays up  all 1.00 s, {furthest}" in render(found, "x")


def test_a_fall_is_said_with_its_time() -> None:
    found = summarize(follow(leaning(1.5)))
    assert found["verdict"] == "falls"
    assert found["stays_up_s"] == found["upright_s"] < 1.5
    assert f"falls     after {found['upright_s']:.2f} s of 1.50 s" in render(found, "x")


def test_the_assist_reported_is_what_moves_the_body() -> None:
    """Force and gravity change the momentum: the body follows a target that accelerates."""
    body = still(1.0, up=2.0)
    t = np.arange(len(body.qpos)) / FPS
    body.qpos[:, 0] += 0.8 * t**2
    tracked = follow(body, assist=Assist(force=3.0))
    com = center_of_mass(tracked)
    momentum = tracked.mass * (np.diff(com[-2:], axis=0) - np.diff(com[5:7], axis=0))[0] * FPS
    force = tracked.rollout.wrench[6:, :3] - [0, 0, tracked.mass * G]
    impulse = ((force[1:] + force[:-1]) / 2).sum(0) / FPS
    np.testing.assert_allclose(momentum, impulse, atol=0.02 * tracked.mass)
    assert momentum[0] > 0.5 * tracked.mass


def test_the_assist_is_cut_off() -> None:
    tracked = follow(still(0.5, up=2.0), assist=Assist(force=0.3, torque=0.02))
    force = np.linalg.norm(tracked.rollout.wrench[:, :3], axis=1)
    assert force.max() == pytest.approx(0.3 * tracked.mass * G)
    com = center_of_mass(tracked)[:, 2]
    fallen = com[0] - com[-1]
    assert fallen > 0.7 * G * 0.5**2 / 2, "three tenths of the weight don't hold it"


def test_torque_is_what_the_arm_weighs() -> None:
    strong = follow(machine('<motor joint="elbow" gear="20" ctrlrange="-2 2"/>', 121))
    found = {row["name"]: row for row in summarize(strong)["joints"]}["elbow"]
    assert np.sqrt(strong.rollout.square[-30:, 1].mean()) == pytest.approx(2 * G * 0.5, rel=0.02)
    assert found["peak_nm"] < 40
    assert found["saturated"] < 0.05
    weak = follow(machine('<motor joint="elbow" gear="2" ctrlrange="-2 2"/>', 61))
    found = {row["name"]: row for row in summarize(weak)["joints"]}["elbow"]
    assert found["peak_nm"] == pytest.approx(4.0)
    assert found["saturated"] > 0.9
    assert "servos of ours" in weak.notes[0]


def test_own_servos_stay_as_they_are() -> None:
    tracked = follow(machine('<position joint="elbow" kp="200" kv="20"/>', 121))
    assert tracked.notes == ()
    sag = abs(float(tracked.rollout.qpos[-1, 7]))
    assert 200 * sag == pytest.approx(2 * G * 0.5 * np.cos(sag), rel=0.01)


def test_a_ball_is_followed_round_and_round() -> None:
    """A rotation vector jumps at half a turn; the servos must not."""
    axes = "".join(
        f'<position joint="elbow" kp="300" kv="20" gear="{g}"/>'
        for g in ("1 0 0", "0 1 0", "0 0 1")
    )
    body = machine(axes, 121, joint='type="ball"')
    turn = np.linspace(0, 4 * np.pi, 121)
    body.qpos[:, 7], body.qpos[:, 10] = np.cos(turn / 2), np.sin(turn / 2)
    found = summarize(follow(body))
    assert found["error"]["joints_deg"] < 5.0


def test_the_same_input_gives_the_same_output() -> None:
    first, second = (follow(still(0.5), assist=Assist()) for _ in range(2))
    assert first.rollout.qpos.tobytes() == second.rollout.qpos.tobytes()
    assert json.dumps(summarize(first)) == json.dumps(summarize(second))


def test_divergence_is_said_and_nothing_is_nan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    body = machine('<position joint="elbow" kp="1e12"/>', 31)
    body.qpos[1:, 7] = 1.0
    tracked = follow(body)
    assert tracked.diverged is not None
    for values in vars(tracked.rollout).values():
        assert np.isfinite(values).all()
    found = summarize(tracked)
    json.dumps(found, allow_nan=False)
    assert f"diverged  at frame {tracked.diverged}" in render(found, "arm")
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir()), "MuJoCo keeps its warnings to itself"


def test_a_robot_stands_on_its_own_servos() -> None:
    robot = understand_robot(find("robot"))
    model = read_mjcf(find("robot"))
    qpos = np.tile(robot.to_qpos(robot.tpose), (91, 1))
    body = ModelTrajectory(model.spec, model.model, model.root, qpos)
    found = summarize(track(body, 1 / FPS, height=1.32, assist=Assist()))
    assert found["fall_frame"] is None
    assert found["notes"] == []
    assert len(found["joints"]) == 29
    assert found["error"]["mpjpe_cm"] < 3.0


def test_a_first_frame_of_another_pose_is_no_velocity() -> None:
    """Many files begin with a T-pose, and with the motion in the next frame."""
    body = still(1.0)
    body.qpos[0, 7:11] = [np.sqrt(0.5), 0, np.sqrt(0.5), 0]
    tracked = follow(body, assist=Assist())
    assert "begins at rest" in tracked.notes[0]
    assert tracked.diverged is None
    assert not tracked.rollout.fallen.any()


def test_one_frame_and_bad_input() -> None:
    found = summarize(follow(still(0.0), assist=Assist()))
    assert (found["frames"], found["fall_frame"], found["stays_up_s"]) == (1, None, 0.0)
    assert found["assist"]["work_j"] == 0
    json.dumps(found, allow_nan=False)
    body = still(0.1)
    body.qpos[2, 3] = np.nan
    with pytest.raises(SkeletonError, match="finite"):
        follow(body)
    bare = MACHINE.replace('<geom type="box" size="0.5 0.5 0.1" mass="200"/>', BARE)
    spec = mujoco.MjSpec.from_string(bare.format(actuator="", joint=HINGE))
    model = spec.compile()
    with pytest.raises(SkeletonError, match="no shapes"):
        follow(ModelTrajectory(spec, model, 1, np.tile(model.qpos0, (3, 1))))


def test_a_model_that_leaves_contacts_to_its_scene_stands() -> None:
    ghost = MACHINE.replace("<geom ", '<geom contype="0" conaffinity="0" group="3" ')
    spec = mujoco.MjSpec.from_string(ghost.format(actuator="", joint=HINGE))
    model = spec.compile()
    tracked = follow(ModelTrajectory(spec, model, 1, np.tile(model.qpos0, (61, 1))))
    assert tracked.rollout.loads[-1].sum() == pytest.approx(tracked.mass * G, rel=0.02)
    assert any("set to collide" in note for note in tracked.notes)


def supported(model: str, change: str) -> TrackingResult:
    """A box that is to stay 1 m above the floor, on a model that is changed so that it does."""
    text = MACHINE.format(actuator="", joint=HINGE).replace('pos="0 0 0.1"', 'pos="0 0 1"')
    assert model in text
    spec = mujoco.MjSpec.from_string(text.replace(model, change, 1))
    held = spec.compile()
    base = int(held.body("base").id)
    return follow(ModelTrajectory(spec, held, base, np.tile(held.qpos0, (31, 1))))


@pytest.mark.parametrize(
    ("model", "change", "said"),
    [
        ("<worldbody>", '<option><flag gravity="disable"/></option><worldbody>', "off gravity"),
        ('"base"', '"base" gravcomp="1.01"', "gravcomp"),
        ("<actuator>", '<equality><weld body1="base"/></equality><actuator>', "ties"),
        ("<actuator>", '<equality><weld body1="world" body2="arm"/></equality><actuator>', "ties"),
        (
            "<worldbody>",
            '<worldbody><body name="hook" mocap="true" pos="0 0 1"/></worldbody><equality>'
            '<connect body1="hook" body2="base" anchor="0 0 0"/></equality><worldbody>',
            "ties",
        ),
    ],
)
def test_what_holds_a_body_in_its_model_alone_is_not_there(
    model: str, change: str, said: str
) -> None:
    """It falls as freely as it does without."""
    free, tracked = supported("<worldbody>", "<worldbody>"), supported(model, change)
    fallen = free.rollout.points[0, 0, 2] - free.rollout.points[-1, 0, 2]
    assert fallen > 0.7
    np.testing.assert_allclose(tracked.rollout.points[:, 0, 2], free.rollout.points[:, 0, 2])
    assert any(said in note for note in tracked.notes)
    assert not any(said in note for note in free.notes)


def test_a_floor_that_the_options_switch_off_is_there() -> None:
    off = '<option><flag contact="disable" constraint="disable"/></option><worldbody>'
    tracked = supported("<worldbody>", off)
    assert tracked.rollout.points[-1, 0, 2] == pytest.approx(0.1, abs=0.02)
    assert any("switch off contacts, constraints: on here" in note for note in tracked.notes)


def test_ties_within_a_body_stay() -> None:
    tracked = supported(
        "<actuator>", '<equality><weld body1="base" body2="arm"/></equality><actuator>'
    )
    assert tracked.model.eq_active0.all()
    assert not any("ties" in note for note in tracked.notes)


def test_a_servo_with_a_constant_push_is_none_of_the_models_own() -> None:
    push = '<general joint="elbow" gainprm="200" biastype="affine" biasprm="30 -200 -20"/>'
    tracked = follow(machine(push, 61))
    assert "servos of ours" in tracked.notes[0]


NESTED = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="base" pos="0 0 0.1">
      <freejoint/>
      <geom type="box" size="0.5 0.5 0.1" mass="200"/>
      <body name="link" pos="0 0 0.3">
        <joint name="shoulder" type="hinge" axis="0 1 0"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
        <body name="ball">
          <joint name="elbow" type="hinge" axis="0 1 0"/>
          <geom type="sphere" size="0.1" pos="0.3 0 {height}" mass="1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""


def test_parts_that_are_in_each_other_in_the_tpose_do_not_push() -> None:
    """A ball 8 cm deep in the box on which it turns keeps its angle; one beside it is stopped."""

    def nested(height: float, angle: float) -> TrackingResult:
        spec = mujoco.MjSpec.from_string(NESTED.format(height=height))
        model = spec.compile()
        qpos = np.tile(model.qpos0, (61, 1))
        qpos[:, -1] = angle * np.linspace(0, 1, 61)
        return follow(ModelTrajectory(spec, model, 1, qpos, tpose=model.qpos0.copy()))

    inside = nested(-0.18, 0.0)
    assert abs(inside.rollout.qpos[:, -2:]).max() < 0.01
    (note,) = [note for note in inside.notes if "T-pose" in note]
    assert "one pair of the model's parts" in note
    assert "'base' and 'ball' by 8.0 cm" in note
    apart = nested(0.0, 1.0)  # on the box it stands at sin(angle) = 0.1 / 0.3
    assert not any("T-pose" in note for note in apart.notes)
    assert apart.rollout.qpos[-1, -2:].sum() == pytest.approx(np.arcsin(1 / 3), abs=0.1)


def on_plane(plane: str, contact: str = "") -> TrackingResult:
    """A box that is told to rest on z = 0, in a world with a plane."""
    text = MACHINE.format(actuator="", joint=HINGE)
    text = text.replace("<geom ", '<geom name="box" ').replace("<actuator>", f"{contact}<actuator>")
    text = text.replace("<worldbody>", f"<worldbody>{plane}")
    spec = mujoco.MjSpec.from_string(text)
    model = spec.compile()
    base = int(model.body("base").id)
    return follow(ModelTrajectory(spec, model, base, np.tile(model.qpos0, (61, 1))))


@pytest.mark.parametrize(
    ("plane", "where"),
    [
        ('<geom type="plane" size="1 1 1" pos="0 0 -1"/>', "z = -1 m"),
        ('<geom type="plane" size="1 1 1" pos="0 0 0.3"/>', "z = 0.3 m"),
        ('<geom type="plane" size="1 1 1" euler="0.2 0 0"/>', "tilted by 11.5 degrees"),
        ('<body euler="0 1.57 0"><geom type="plane" size="1 1 1"/></body>', "tilted by 90 degrees"),
    ],
)
def test_a_plane_that_is_not_the_motions_floor_is_not_stood_on(plane: str, where: str) -> None:
    tracked = on_plane(plane)
    assert tracked.rollout.points[-1, 0, 2] == pytest.approx(0.1, abs=0.01)
    assert tracked.rollout.loads[-1].sum() == pytest.approx(tracked.mass * G, rel=0.02)
    (note,) = [note for note in tracked.notes if "plane" in note]
    assert where in note
    assert "a floor at z = 0 m" in note


def test_a_plane_that_a_contact_pair_names_is_put_away_too() -> None:
    pair = '<contact><pair geom1="ground" geom2="box"/></contact>'
    tracked = on_plane('<geom name="ground" type="plane" size="1 1 1" pos="0 0 0.3"/>', pair)
    assert tracked.rollout.points[-1, 0, 2] == pytest.approx(0.1, abs=0.01)


def test_a_plane_at_the_motions_floor_is_the_floor() -> None:
    """Ice stays ice: its friction is the model's."""
    ice = '<geom type="plane" size="1 1 1" friction="0.01 0 0" priority="1"/>'
    tracked = on_plane(ice)
    assert tracked.model.ngeom == 2
    assert not any("plane" in note for note in tracked.notes)


def test_a_plane_that_touches_nothing_is_no_floor() -> None:
    tracked = on_plane('<geom type="plane" size="1 1 1" contype="0" conaffinity="0"/>')
    assert tracked.rollout.points[-1, 0, 2] == pytest.approx(0.1, abs=0.01)
