"""Policies in simulation: what they see, against answers by hand; what toys of them do."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper, save_model
from scipy.spatial.transform import Rotation

from robots import registry
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.model.understand import understand_robot
from sim.physics.policy_network import PolicyNetwork
from sim.physics.policy_observation import Observer
from sim.physics.policy_spec import PolicySpec, read_spec
from sim.physics.policy_summary import render, summarize
from sim.physics.policy_terms import TERMS, Seen, State
from sim.physics.policy_tracking import PolicyTracker
from spark.errors import DependencyError, FileFormatError, SkeletonError, SparkSimError
from spark.rig.feet import sole_positions
from spark.rotation import quat_from_rotvec

DOCS = Path(__file__).parents[3] / "docs" / "policies.md"
TRACKER = Path(__file__).parents[4] / "shared" / "trackers" / "twist2"
FPS = 50.0

SPEC = """
rate_hz = 50
timestep = 0.002

[joints]
names = {names}
default = 0
kp = {kp}
kd = {kd}
{limit}

[action]
scale = 0.5

[groups]
all = [{{ term = "reference_joint_offsets" }}, {{ term = "roll_pitch" }}]

[[observation]]
groups = ["all"]
"""


def wxyz(rotation: Rotation) -> np.ndarray:
    return rotation.as_quat()[..., [3, 0, 1, 2]]


def scipy_of(wxyz: np.ndarray) -> Rotation:
    return Rotation.from_quat(wxyz[..., [1, 2, 3, 0]])


def some_state(rng: np.random.Generator, count: int = 2) -> State:
    q = wxyz(Rotation.from_rotvec(rng.normal(size=3)))
    place, velocity, turning = rng.normal(size=(3, 3))
    angles, speeds = rng.normal(size=(2, count))
    turns = wxyz(Rotation.from_rotvec(rng.normal(size=(2, 3))))
    return State(place, q, velocity, turning, angles, speeds, rng.normal(size=(2, 3)), turns)


def test_terms_are_what_scipy_makes_of_the_state() -> None:
    rng = np.random.default_rng(0)
    own, reference = some_state(rng), some_state(rng)
    default, last = rng.normal(size=2), rng.normal(size=2)
    seen = Seen(own, reference, default, last, 0.25)
    for state, prefix in ((own, ""), (reference, "reference_")):
        R = Rotation.from_quat(state.rotation[[1, 2, 3, 0]])
        expected = {
            "root_velocity": R.inv().apply(state.velocity),
            "root_angular_velocity": state.turning,
            "root_height": state.position[2:],
            "roll_pitch": R.as_euler("ZYX")[[2, 1]],
            "projected_gravity": R.as_matrix()[2] * -1,
            "joint_positions": state.angles,
            "joint_offsets": state.angles - default,
            "joint_velocities": state.speeds,
        }
        for name, value in expected.items():
            np.testing.assert_allclose(TERMS[prefix + name].read(seen), value, atol=1e-12)
            assert TERMS[prefix + name].reference == bool(prefix)
    Rs = [Rotation.from_quat(s.rotation[[1, 2, 3, 0]]) for s in (own, reference)]
    turn = (Rs[0].inv() * Rs[1]).as_matrix()
    np.testing.assert_allclose(TERMS["rotation_to_reference"].read(seen), turn[:, :2].ravel())
    way = Rs[0].inv().apply(reference.position - own.position)
    np.testing.assert_allclose(TERMS["position_to_reference"].read(seen), way)
    np.testing.assert_array_equal(TERMS["last_action"].read(seen), last)
    assert TERMS["phase"].read(seen) == [0.25]


@pytest.mark.parametrize("anchor", [None, 1])
def test_terms_of_bodies_are_seen_from_their_anchor(anchor: int | None) -> None:
    rng = np.random.default_rng(2)
    own, reference = some_state(rng), some_state(rng)
    nothing = np.zeros(2)
    seen = Seen(own, reference, nothing, nothing, 0.0, anchor, (1, 0))

    def anchored(state: State) -> tuple[np.ndarray, Rotation]:
        if anchor is None:
            return state.position, scipy_of(state.rotation)
        return state.places[anchor], scipy_of(state.turns[anchor])

    for state, prefix in ((own, ""), (reference, "reference_")):
        place, turn = anchored(state)
        away = [turn.inv().apply(state.places[b] - place) for b in (1, 0)]
        columns = [(turn.inv() * scipy_of(state.turns[b])).as_matrix()[:, :2] for b in (1, 0)]
        read = TERMS[f"{prefix}body_positions"].read(seen)
        np.testing.assert_allclose(read, np.ravel(away), atol=1e-12)
        read = TERMS[f"{prefix}body_rotations"].read(seen)
        np.testing.assert_allclose(read, np.ravel(columns), atol=1e-12)
    R = scipy_of(own.rotation)
    at = replace(seen, at=(0.1, -0.2, 0.3))
    moved = R.inv().apply(own.velocity + np.cross(R.apply(own.turning), R.apply([0.1, -0.2, 0.3])))
    np.testing.assert_allclose(TERMS["root_velocity"].read(at), moved, atol=1e-12)
    (place, turn), (goal, wanted) = anchored(own), anchored(reference)
    way = TERMS["position_to_reference"].read(seen)
    np.testing.assert_allclose(way, turn.inv().apply(goal - place), atol=1e-12)
    rotation = TERMS["rotation_to_reference"].read(seen)
    expected = (turn.inv() * wanted).as_matrix()[:, :2].ravel()
    np.testing.assert_allclose(rotation, expected, atol=1e-12)


def written(folder: Path, text: str) -> PolicySpec:
    path = folder / "spec.toml"
    path.write_text(text)
    return read_spec(path)


TWO = """
rate_hz = 50
[joints]
names = ["a", "b"]
default = [0.5, 0.25]
kp = 1
kd = 1
[action]
[groups]
g = [{ term = "joint_velocities", scale = [2, 3], zero = ["b"] },
     { term = "reference_root_height", ahead = [0, 2] }]
"""


def observed(folder: Path, block: str) -> list[list[float]]:
    """What is seen in three steps: speeds (1, .), (2, .), (3, .), heights of the reference 10 t."""
    spec = written(folder, TWO + f'[[observation]]\ngroups = ["g"]\n{block}')
    rng = np.random.default_rng(1)

    def state(height: float, speed: float) -> State:
        base = some_state(rng)
        place = np.array([0.0, 0.0, height])
        speeds = np.array([speed, 7.0])
        return replace(base, position=place, speeds=speeds)

    observer = Observer(spec, [state(10.0 * t, 0.0) for t in range(4)])
    out = [observer(state(0.0, t + 1.0), np.zeros(2), t).tolist() for t in range(3)]
    assert {len(row) for row in out} == {spec.width}
    return out


def test_an_observation_has_its_terms_in_order_with_scales_and_looks_ahead(tmp_path: Path) -> None:
    # Twice the speed of a, b at 0; the height now and two steps ahead, the last one held.
    assert observed(tmp_path, "") == [[2, 0, 0, 20], [4, 0, 10, 30], [6, 0, 20, 30]]


def test_history_has_the_order_that_the_spec_says(tmp_path: Path) -> None:
    one, two, three = [2, 0, 0, 20], [4, 0, 10, 30], [6, 0, 20, 30]
    nothing = [0, 0, 0, 0]
    assert observed(tmp_path, "history = 2") == [nothing + nothing, nothing + one, one + two]
    assert observed(tmp_path, "history = 2\norder = 'newest_first'")[2] == two + one
    assert observed(tmp_path, "history = 2\npresent = true")[2] == one + two + three
    repeated = observed(tmp_path, "history = 2\nstart = 'repeat'\npresent = true")
    assert repeated == [one + one + one, one + one + two, one + two + three]
    by_term = observed(tmp_path, "history = 2\nlayout = 'by_term'")
    assert by_term[2] == [2, 0, 4, 0, 0, 20, 10, 30]


def test_a_block_looks_ahead_step_by_step(tmp_path: Path) -> None:
    text = TWO.replace('{ term = "joint_velocities", scale = [2, 3], zero = ["b"] }', "HEIGHT")
    text = text.replace("HEIGHT", '{ term = "reference_root_velocity", axes = "x" }')
    spec = written(tmp_path, text + '[[observation]]\ngroups = ["g"]\nahead = [1, 3]')
    rng = np.random.default_rng(1)
    own, still = some_state(rng), np.array([1.0, 0, 0, 0])
    steps = [
        replace(own, position=np.full(3, 10.0 * t), rotation=still, velocity=np.full(3, float(t)))
        for t in range(4)
    ]
    seen = Observer(spec, steps)(own, np.zeros(2), 0)
    assert seen.tolist() == [1, 10, 3, 30]
    assert spec.width == 4
    own_terms = '{ term = "joint_velocities" }, { term = "reference_root_height" }'
    wrong = text.replace('{ term = "reference_root_velocity", axes = "x" }', own_terms)
    with pytest.raises(FileFormatError, match=r"observation\[0\]\.ahead is for terms of the ref"):
        written(tmp_path, wrong + '[[observation]]\ngroups = ["g"]\nahead = 2')


WRONG = {
    "rate_hz = 50\n": ("rate_hz = 60\n", "timestep is 0.002 s"),
    "kp = 1\n": ("kp = [1, 2, 3]\n", r"joints\.kp has 3 numbers; expected 2"),
    "kd = 1\n": ("kd = -1\n", r"joints\.kd has -1; expected 0 or more"),
    "[action]": (
        "[action]\nskale = 2",
        r"action\.skale is not known here; available: around, clip, scale",
    ),
    '["a", "b"]': ('["a", "a"]', r"joints\.names has a name twice"),
    "joint_velocities": (
        "joint_speed",
        r"g\[0\]\.term is 'joint_speed'; available: .*joint",
    ),
    'zero = ["b"]': ('zero = ["c"]', r"groups\.g\[0\]\.zero names 'c', no joints of the spec"),
    "ahead = [0, 2]": ("ahead = 0.5", "no whole number of control steps"),
    '["g"]': ('["h"]', r"observation\[0\]\.groups names 'h'; \[groups\] has 'g'"),
    "reference_root_height": ("body_positions", r"g\[1\]\.bodies is missing"),
    "scale = [2, 3]": ('anchor = "hip"', r"groups\.g\[0\]\.anchor is not known here"),
    "[action]\n": ("[action]\naround = 'ref'\n", "action.around is 'ref'; expected 'default'"),
    "[groups]\n": ("[network]\nobservation = 'x'\nstep = 'x'\n[groups]\n", "has another use, too"),
    "[groups]": ("[[observation]]\n[groups", "TOML|Expected"),
}


@pytest.mark.parametrize("old", WRONG)
def test_a_spec_that_says_something_else_is_refused(old: str, tmp_path: Path) -> None:
    new, message = WRONG[old]
    text = TWO + '[[observation]]\ngroups = ["g"]\n'
    written(tmp_path, text)
    with pytest.raises(FileFormatError, match=message):
        written(tmp_path, text.replace(old, new))


def toy(path: Path, weights: np.ndarray, bias: np.ndarray | None = None) -> Path:
    """A network of one layer: action = observation @ weights + bias."""
    width, count = weights.shape
    offset = np.zeros(count) if bias is None else bias
    graph = helper.make_graph(
        [helper.make_node("Gemm", ["obs", "W", "b"], ["action"])],
        "toy",
        [helper.make_tensor_value_info("obs", TensorProto.FLOAT, ["batch", width])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["batch", count])],
        [
            numpy_helper.from_array(weights.astype(np.float32), "W"),
            numpy_helper.from_array(offset.astype(np.float32), "b"),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    save_model(model, str(path))
    return path


@pytest.fixture(scope="module")
def robot() -> Morphology:
    return understand_robot(registry.find("robot"))


def toy_with_memory(path: Path, joints: str = "", count: int = 2) -> Path:
    """Action = observation + step + 100 * (steps since it began); a second output beside it."""
    tensor = helper.make_tensor_value_info
    numbers = {"one": 1.0, "hundred": 100.0}
    graph = helper.make_graph(
        [
            helper.make_node("Add", ["obs", "time_step"], ["with_step"]),
            helper.make_node("Mul", ["h_in", "hundred"], ["times"]),
            helper.make_node("ReduceSum", ["times", "axes"], ["past"], keepdims=0),
            helper.make_node("Add", ["with_step", "past"], ["actions"]),
            helper.make_node("Add", ["h_in", "one"], ["h_out"]),
        ],
        "memory",
        [
            tensor("obs", TensorProto.FLOAT, [1, count]),
            tensor("time_step", TensorProto.FLOAT, [1, 1]),
            tensor("h_in", TensorProto.FLOAT, [1, 1, 1]),
        ],
        [
            tensor("h_out", TensorProto.FLOAT, [1, 1, 1]),
            tensor("with_step", TensorProto.FLOAT, [1, count]),
            tensor("actions", TensorProto.FLOAT, [1, count]),
        ],
        [
            *(numpy_helper.from_array(np.full(1, v, np.float32), k) for k, v in numbers.items()),
            numpy_helper.from_array(np.array([0]), "axes"),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    if joints:
        helper.set_model_props(model, {"joint_names": joints})
    save_model(model, str(path))
    return path


MEMORY = """
[network]
observation = "obs"
action = "actions"
step = "time_step"
state = { h_in = "h_out" }
"""


def of_two(folder: Path, network: str = "") -> PolicySpec:
    text = TWO.replace("joint_velocities", "projected_gravity").replace('zero = ["b"]', "")
    text = text.replace('projected_gravity", scale = [2, 3],', 'phase"').replace("[0, 2]", "0")
    return written(folder, text + network + '[[observation]]\ngroups = ["g"]\n')


def test_a_network_gets_the_step_and_its_own_state(tmp_path: Path) -> None:
    spec = of_two(tmp_path, MEMORY)
    network = PolicyNetwork(toy_with_memory(tmp_path / "m.onnx", "a, b"), spec)
    seen = np.array([0.25, 0.5])
    for step in range(3):
        np.testing.assert_allclose(network(seen, step), seen + step + 100 * step)
    network.forget()
    np.testing.assert_allclose(network(seen, 7), seen + 7)


NOT_FITTING = {
    "": "has 3 inputs \\(obs, time_step, h_in\\); expected one, or .network. in spec.toml",
    MEMORY.replace('state = { h_in = "h_out" }', ""): "inputs that get nothing: 'h_in'",
    MEMORY.replace('"actions"', '"action"'): "has no output 'action', which .network. of spec",
    MEMORY.replace('action = "actions"\n', ""): "has 3 outputs .*; expected one, or",
    MEMORY.replace("h_in =", "c_in ="): "has no input 'c_in'",
    MEMORY.replace('"h_out"', '"with_step"'): r"'h_in' is tensor.* of shape \[1, 1, 1\], and",
}


@pytest.mark.parametrize("network", NOT_FITTING)
def test_a_network_with_other_inputs_and_outputs_is_refused(network: str, tmp_path: Path) -> None:
    path = toy_with_memory(tmp_path / "m.onnx")
    with pytest.raises(FileFormatError, match=NOT_FITTING[network]):
        PolicyNetwork(path, of_two(tmp_path, network))


def test_a_network_that_tells_another_order_of_joints_is_refused(tmp_path: Path) -> None:
    spec = of_two(tmp_path, MEMORY)
    path = toy_with_memory(tmp_path / "m.onnx", "b,a")
    with pytest.raises(FileFormatError, match="its joint 1 is 'b', that of the spec 'a'"):
        PolicyNetwork(path, spec)


def standing(robot: Morphology, seconds: float = 1.0) -> RobotMotion:
    qpos = np.tile(robot.to_qpos(robot.tpose)[0], (round(seconds * FPS) + 1, 1))
    soles = [sole_positions(s, robot.rig.tpose_positions, robot.rig.tpose) for s in robot.rig.soles]
    lowest = np.concatenate(soles)[:, 2].min()
    qpos[:, 2] += -lowest - robot.motion(robot.from_qpos(qpos[:1]), 1.0).root_pos[0, 2]
    return RobotMotion(robot, robot.from_qpos(qpos), 1 / FPS)


def spec_of(
    robot: Morphology, folder: Path, *, kp: float = 300.0, kd: float = 10.0, limit: str = ""
) -> PolicySpec:
    names = str(list(robot.joint_names)).replace("'", '"')
    return written(folder, SPEC.format(names=names, kp=kp, kd=kd, limit=limit))


def tracker(
    robot: Morphology, folder: Path, motion: RobotMotion, *, gain: float = 2.0, **options: Any
) -> PolicyTracker:
    """With a toy that asks for the reference's angles: 1 / scale times their offsets."""
    spec = spec_of(robot, folder, **options)
    count = len(spec.joints)
    network = toy(folder / "toy.onnx", gain * np.eye(spec.width, count))
    return PolicyTracker(
        motion.body,
        motion.frame_time,
        spec,
        PolicyNetwork(network, spec),
        height=robot.rig.standing_height,
    )


def test_a_toy_that_holds_the_pose_stands(robot: Morphology, tmp_path: Path) -> None:
    follower = tracker(robot, tmp_path, standing(robot))
    run = follower.run(1)
    assert run.falls == ()
    assert run.apart.max() < 0.05
    assert np.degrees(run.angles[10:].mean()) < 3
    # Once it stands, the root's servo-less weight is on legs whose torques are those of the pose.
    np.testing.assert_array_equal(follower.run(1).qpos, run.qpos)
    assert not np.array_equal(follower.run(2).qpos, run.qpos)
    metrics = summarize(follower, [run])
    assert metrics["falls"] == 0
    assert "stays up for all 1.00 s in 1 run" in render(metrics, "still", "toy")


def test_a_plane_of_the_model_that_is_not_at_zero_is_not_stood_on(
    robot: Morphology, tmp_path: Path
) -> None:
    text = registry.find("robot").read_text()
    model = tmp_path / "pit.xml"
    pit = '<worldbody><geom type="plane" size="9 9 1" pos="0 0 -1"/>'
    model.write_text(text.replace("<worldbody>", pit, 1))
    over = understand_robot(model)
    follower = tracker(over, tmp_path, standing(over))
    assert any("at z = -1 m" in note for note in follower.notes)
    np.testing.assert_allclose(
        follower.run(1).qpos, tracker(robot, tmp_path, standing(robot)).run(1).qpos, atol=1e-6
    )


def test_a_limp_robot_falls_and_is_put_back(robot: Morphology, tmp_path: Path) -> None:
    follower = tracker(robot, tmp_path, standing(robot, 3.0), kp=0.0, kd=1.0)
    run = follower.run(1)
    assert len(run.falls) >= 2
    # Nothing falls faster than freely: 0.196 heights take this long.
    least = np.sqrt(2 * 0.196 * robot.rig.standing_height / 9.81)
    assert np.diff([0, *run.falls]).min() / FPS >= 0.9 * least
    for step in run.falls:
        assert run.apart[step + 1] < 0.1 if step + 1 < len(run.apart) else True
    metrics = summarize(follower, [run, follower.run(2)])
    assert metrics["runs_without_fall"] == 0
    text = render(metrics, "limp", "toy")
    assert f"falls {metrics['falls']} times in 2 runs" in text


def test_torques_are_the_gains_cut_off_at_the_lower_limit(
    robot: Morphology, tmp_path: Path
) -> None:
    follower = tracker(robot, tmp_path, standing(robot, 0.2), limit="torque_limit = 25")
    model = robot.mjcf.model
    for name, limit in zip(robot.joint_names, follower.limits, strict=True):
        own = model.actuator_forcerange[model.actuator_trnid[:, 0] == model.joint(name).id]
        assert limit == min(25, float(own.max()))
    run = follower.run(3)
    assert (run.peak <= follower.limits + 1e-9).all()
    # In the first step of the simulation nothing has moved: kp (target - angle) - kd speed.
    rng = np.random.default_rng(3)
    off = rng.normal(0, 0.02, len(follower.limits))
    first = np.clip(-300 * off, -follower.limits, follower.limits)
    assert (run.peak[1] >= np.abs(first) - 1e-6).all()


def test_another_width_is_refused_and_never_run(
    robot: Morphology, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import onnxruntime

    def run(*_: Any) -> None:
        raise AssertionError("it ran")

    monkeypatch.setattr(onnxruntime.InferenceSession, "run", run)
    spec = spec_of(robot, tmp_path)
    count = len(spec.joints)
    for shape, message in (
        ((spec.width + 1, count), f"is {spec.width + 1} wide, .* an observation of {spec.width}"),
        (
            (spec.width, count - 1),
            f"is {count - 1} wide, but spec.toml has {count} joints",
        ),
    ):
        with pytest.raises(FileFormatError, match=message):
            PolicyNetwork(toy(tmp_path / "toy.onnx", np.zeros(shape)), spec)
    nothing = tmp_path / "text.onnx"
    nothing.write_text("no network")
    with pytest.raises(FileFormatError, match="is no ONNX network that runs"):
        PolicyNetwork(nothing, spec)
    with pytest.raises(FileFormatError, match="no such file"):
        PolicyNetwork(tmp_path / "gone.onnx", spec)


def test_actions_that_are_no_numbers_are_refused(robot: Morphology, tmp_path: Path) -> None:
    spec = spec_of(robot, tmp_path)
    count = len(spec.joints)
    bias = np.full(count, np.nan)
    network = PolicyNetwork(toy(tmp_path / "t.onnx", np.zeros((spec.width, count)), bias), spec)
    with pytest.raises(SparkSimError, match=f"gave {count} numbers of which 0 are finite"):
        network(np.zeros(spec.width))


def test_actions_around_the_reference_are_added_to_its_angles(
    robot: Morphology, tmp_path: Path
) -> None:
    """A network that says nothing then does what the toy does that asks for these angles."""
    qpos = standing(robot, 0.2).qpos.copy()
    qpos[:, -1] += 0.3 * np.sin(20 * np.arange(len(qpos)) / FPS)
    motion = RobotMotion(robot, robot.from_qpos(qpos), 1 / FPS)
    asked = tracker(robot, tmp_path, motion).run(1)
    spec = spec_of(robot, tmp_path)
    text = spec.path.read_text().replace("scale = 0.5", 'around = "reference"')
    spec = written(tmp_path, text)
    silent = toy(tmp_path / "silent.onnx", np.zeros((spec.width, len(spec.joints))))
    height = robot.rig.standing_height
    follower = PolicyTracker(
        motion.body, motion.frame_time, spec, PolicyNetwork(silent, spec), height=height
    )
    np.testing.assert_allclose(follower.run(1).qpos, asked.qpos, atol=2e-3)


def test_bodies_of_the_spec_are_where_the_model_has_them(robot: Morphology, tmp_path: Path) -> None:
    model = robot.mjcf.model
    name = model.body(model.nbody - 1).name
    text = spec_of(robot, tmp_path).path.read_text()
    way = '{ term = "position_to_reference", anchor = "NAME" }, '
    spec = written(tmp_path, text.replace("all = [", "all = [" + way.replace("NAME", name)))
    network = PolicyNetwork(
        toy(tmp_path / "t.onnx", np.zeros((spec.width, len(spec.joints)))), spec
    )
    motion = standing(robot, 0.2)
    follower = PolicyTracker(motion.body, 1 / FPS, spec, network, height=1.7)
    data = mujoco.MjData(model)
    data.qpos[:] = motion.qpos[3]
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(follower.reference[3].places[0], data.body(name).xpos, atol=1e-9)
    np.testing.assert_allclose(follower.reference[3].turns[0], data.body(name).xquat, atol=1e-9)
    other = written(tmp_path, spec.path.read_text().replace(name, "tail"))
    with pytest.raises(SkeletonError, match="the robot has no bodies 'tail'; it has"):
        PolicyTracker(motion.body, 1 / FPS, other, network, height=1.7)


def test_joints_of_another_robot_are_refused(robot: Morphology, tmp_path: Path) -> None:
    spec = spec_of(robot, tmp_path)
    text = spec.path.read_text()
    first = robot.joint_names[0]
    for new, message in ((f'"{first}x", ', f"no joints '{first}x'"), ("", f"leaves out '{first}'")):
        other = written(tmp_path, text.replace(f'"{first}", ', new))
        count = len(other.joints)
        network = PolicyNetwork(toy(tmp_path / "t.onnx", np.zeros((other.width, count))), other)
        with pytest.raises(SkeletonError, match=message):
            PolicyTracker(standing(robot).body, 1 / FPS, other, network, height=1.7)


def test_without_onnxruntime_it_says_what_to_install(
    robot: Morphology, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = spec_of(robot, tmp_path)
    network = toy(tmp_path / "t.onnx", np.zeros((spec.width, len(spec.joints))))
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(DependencyError, match=r"pip install 'spark-sim\[policy\]'"):
        PolicyNetwork(network, spec)


def specs_of_docs() -> list[str]:
    """Those of BeyondMimic and of TWIST2 in docs/policies.md."""
    return re.findall(r"```toml\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.S)


def documented(folder: Path) -> PolicySpec:
    """The whole spec of docs/policies.md."""
    return written(folder, specs_of_docs()[1])


def test_the_spec_of_beyondmimic_is_as_wide_as_its_observation(tmp_path: Path) -> None:
    """Motion 2 n, anchor 3 + 6, velocities 3 + 3, the robot's joints 2 n and last action n."""
    joints = '[joints]\nnames = ["a", "b"]\ndefault = 0\nkp = 1\nkd = 1\n[action]\n[network]'
    spec = written(tmp_path, specs_of_docs()[0].replace("[network]", joints, 1))
    assert spec.width == 5 * 2 + 15
    assert (spec.ports.step, spec.bodies) == ("time_step", ("torso_link",))


def test_the_spec_of_the_docs_is_as_wide_as_they_say(tmp_path: Path) -> None:
    spec = documented(tmp_path)
    assert (spec.width, len(spec.joints), spec.steps) == (127 + 10 * 127 + 35, 29, 20)
    text = DOCS.read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+)`", text))
    assert {name for name in TERMS if not name.startswith("reference_")} <= named


@pytest.mark.skipif(not TRACKER.is_dir(), reason="needs ../shared/trackers")
def test_the_tracker_of_the_docs_stands(tmp_path: Path) -> None:
    """On its author's robot."""
    spec = documented(tmp_path)
    robot = understand_robot(TRACKER / "g1_29dof.xml")
    qpos = np.tile(np.concatenate([[0, 0, 0.793, 1, 0, 0, 0], spec.default]), (51, 1))
    still = RobotMotion(robot, robot.from_qpos(qpos), 1 / FPS)
    network = PolicyNetwork(TRACKER / "twist2_1017_20k.onnx", spec)
    follower = PolicyTracker(still.body, 1 / FPS, spec, network, height=robot.rig.standing_height)
    metrics = summarize(follower, [follower.run(1)])
    assert metrics["falls"] == 0
    assert metrics["body_error_cm"] < 4


def test_a_turning_reference_has_the_velocity_of_its_turn(
    robot: Morphology, tmp_path: Path
) -> None:
    """A reference that turns about Z at 1 rad/s and moves at 0.5 m/s: velocities by hand."""
    motion = standing(robot)
    qpos = motion.qpos.copy()
    times = np.arange(len(qpos)) / FPS
    turned = quat_from_rotvec(np.stack([0 * times, 0 * times, times], axis=1))
    qpos[:, 3:7] = turned
    qpos[:, 0] += 0.5 * times
    body = RobotMotion(robot, robot.from_qpos(qpos), 1 / FPS)
    follower = tracker(robot, tmp_path, body)
    for state in follower.reference[1:-1]:
        np.testing.assert_allclose(state.turning, [0, 0, 1], atol=1e-6)
        np.testing.assert_allclose(state.velocity, [0.5, 0, 0], atol=1e-6)
