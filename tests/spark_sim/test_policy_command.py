"""`spark-sim play --physics --policy`: a toy follows a walk, and what is wrong is said."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper, save_model

import spark_sim
from spark_sim.clips import RobotClip
from tests.helpers.program import Program

SPEC = """
rate_hz = 50
[joints]
names = {names}
default = 0
kp = 300
kd = 10
[action]
[groups]
all = [{{ term = "reference_joint_offsets" }}]
[[observation]]
groups = ["all"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk on Ember, a policy that asks for the reference's angles, and its spec."""
    folder = tmp_path_factory.mktemp("policy")
    spark_sim.sample(folder)
    walked = spark_sim.retarget(folder / "walker_walk.bvh", "robot", method="copy")
    assert isinstance(walked, RobotClip)
    walked.save(folder / "walk.npz")
    names, count = json.dumps(walked.joint_names), len(walked.joint_names)
    (folder / "toy.toml").write_text(SPEC.format(names=names))
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["obs", "W"], ["action"])],
        "toy",
        [helper.make_tensor_value_info("obs", TensorProto.FLOAT, [1, count])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, [1, count])],
        [numpy_helper.from_array(np.eye(count, dtype=np.float32), "W")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    save_model(model, str(folder / "toy.onnx"))
    return folder


@pytest.fixture(scope="module")
def program(folder: Path) -> Iterator[Program]:
    with Program(folder) as program:
        yield program


POLICY = ["play", "walk.npz", "--physics", "--policy", "toy.onnx", "--spec", "toy.toml"]


def test_a_toy_follows_a_walk(program: Program, folder: Path) -> None:
    done = program(*POLICY, "--seeds", "2", "--json", "--html", "walk.html")
    assert done.code == 0, done.stderr
    found = json.loads(done.stdout)
    assert [each["seed"] for each in found["seeds"]] == [1, 2]
    assert found["falls"] == sum(each["falls"] for each in found["seeds"])
    assert found["rate_hz"] == 50
    assert all(row["peak_nm"] <= row["limit_nm"] + 1e-3 for row in found["joints"])
    assert "by toy" in (folder / "walk.html").read_text()
    text = program(*POLICY, "--seeds", "1").stdout
    assert text.startswith("walk: followed by toy in simulation, 50 Hz")
    again = program(*POLICY, "--seeds", "2", "--json")
    assert json.loads(again.stdout) == found


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (POLICY[:5], "goes with --physics and --spec"),
        ([*POLICY[:2], *POLICY[3:]], "goes with --physics and --spec"),
        ([*POLICY, "--assist"], "go without it"),
        ([*POLICY, "--no-balance"], "go without it"),
        (["play", "walk.npz", "--no-balance"], "--no-balance and --json go with --physics"),
        (["play", "walk.npz", "--physics", "--seeds", "2"], "--seeds goes with --policy"),
        ([*POLICY, "--seeds", "0"], "expected 1 to 1000"),
        ([*POLICY[:-1], "gone.toml"], "gone.toml: no such file"),
        (["play", "walker_walk.bvh", *POLICY[2:]], "is no robot's motion"),
    ],
)
def test_what_does_not_fit_is_refused(program: Program, arguments: list[str], message: str) -> None:
    done = program(*arguments)
    assert done.code == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
