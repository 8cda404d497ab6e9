"""The rest pose of a glTF file: its skin's, where its nodes stand at some frame of a motion."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.io.glb_skin import write_on_skin
from spark.io.gltf import read_gltf
from spark.io.gltf_file import GltfFile
from spark.io.gltf_rest import rest_maps
from spark.io.gltf_skin import read_gltf_skin
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import understand
from spark.rotation import quat_from_rotvec, quat_mul
from spark.transfer.canonical import to_canonical
from tests.helpers.gltf import Gltf, animated, stand_as


@pytest.fixture(scope="module")
def waving() -> Motion:
    """Arms that bend, and hips that lean."""
    motion = sample_motion("wave", sample_rig("walker"), 30.0).frames(0, 40)
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_mul(quat_from_rotvec(np.array([0.15, 0.25, 0.5])), rotations[:, 0])
    return replace(motion, rotations=rotations)


def told(gltf: Gltf, path: Path) -> bool:
    return any("skin was bound in" in note for note in read_gltf(gltf.write(path)).notes)


@pytest.mark.parametrize("frame", [0, 20])
@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_nodes_that_stand_in_a_pose_change_nothing(
    waving: Motion, frame: int, scale: float, tmp_path: Path
) -> None:
    plain = read_gltf(animated(waving, scale=scale).write(tmp_path / "rest.glb"))
    gltf = animated(waving, scale=scale)
    stand_as(gltf, frame)
    posed = read_gltf(gltf.write(tmp_path / "posed.glb"))
    np.testing.assert_allclose(forward(posed.motion)[0], forward(plain.motion)[0], atol=1e-5)
    turns = [to_canonical(m, understand(m)).rotations for m in (posed.motion, plain.motion)]
    same = np.abs((turns[0] * turns[1]).sum(-1))
    np.testing.assert_allclose(same, 1, atol=1e-6)
    assert told(gltf, tmp_path / "posed.glb")
    assert not told(animated(waving, scale=scale), tmp_path / "rest.glb")


def test_a_skin_on_nodes_in_a_pose_is_bound_as_it_was(waving: Motion, tmp_path: Path) -> None:
    """And a motion that is written on it is read as it was."""
    gltf = animated(waving)
    gltf.json["meshes"] = [{"primitives": [{"attributes": {}}]}]
    corners = waving.skeleton.rest_positions[[0, 1, -1]] + [[0.1, 0, 0], [0, 0, 0], [0, 0, 0]]
    gltf.json["meshes"][0]["primitives"][0] = {
        "attributes": {
            "POSITION": gltf.accessor(corners),
            "JOINTS_0": _whole(gltf, np.zeros((3, 4))),
            "WEIGHTS_0": gltf.accessor(np.array([[1.0, 0, 0, 0]] * 3)),
        }
    }
    gltf.json["nodes"].append({"name": "body", "mesh": 0, "skin": 0})
    gltf.json["scenes"][0]["nodes"].append(len(gltf.json["nodes"]) - 1)
    skins = []
    for name in ("rest", "posed"):
        if name == "posed":
            stand_as(gltf, 20)
        path = gltf.write(tmp_path / f"{name}.glb")
        recording = read_gltf(path)
        skin, _ = read_gltf_skin(path, recording.convention)
        assert skin is not None
        skins.append(skin)
        write_on_skin(recording.motion, path, tmp_path / "out.glb")
        again = read_gltf(tmp_path / "out.glb").motion
        np.testing.assert_allclose(forward(again)[0], forward(recording.motion)[0], atol=1e-5)
    # Where each joint has the vertices, in its own axes.
    on_joints = [
        np.einsum("bij,vj->bvi", skin.inverse_bind, np.c_[skin.vertices, np.ones(3)])
        for skin in skins
    ]
    np.testing.assert_allclose(on_joints[1], on_joints[0], atol=1e-5)


def test_of_two_poses_the_straighter_one_is_the_rest_pose(waving: Motion, tmp_path: Path) -> None:
    """Twin: nodes in a T, on which the skin was bound with bent arms."""
    bent = animated(waving)
    stand_as(bent, 20)
    count, joints = len(waving.skeleton), bent.json["skins"][0]["joints"]
    binds = np.zeros((count, 4, 4))
    del bent.json["skins"][0]["inverseBindMatrices"]
    maps = rest_maps(GltfFile(bent.write(tmp_path / "bent.glb")))
    for b, node in enumerate(joints):
        binds[b] = np.eye(4)
        binds[b, :3, 3], binds[b, :3, :3] = maps[node]
    straight = animated(waving)
    columns = np.linalg.inv(binds).swapaxes(1, 2).reshape(count, 16)
    straight.json["skins"][0]["inverseBindMatrices"] = straight.accessor(columns)
    assert not told(straight, tmp_path / "straight.glb")


def test_binds_of_another_body_are_left_alone(waving: Motion, tmp_path: Path) -> None:
    """As of a file whose inverse bind matrices are all the identity."""
    gltf = animated(waving)
    stand_as(gltf, 20)
    columns = np.tile(np.eye(4).reshape(16), (len(waving.skeleton), 1))
    gltf.json["skins"][0]["inverseBindMatrices"] = gltf.accessor(columns)
    assert not told(gltf, tmp_path / "a.glb")


def test_what_is_hidden_by_a_scale_of_zero_is_no_hindrance(waving: Motion, tmp_path: Path) -> None:
    gltf = animated(waving)
    stand_as(gltf, 20)
    nodes = gltf.json["nodes"]
    nodes += [{"name": "hidden", "scale": [0, 0, 0], "children": [len(nodes) + 1]}, {"name": "hat"}]
    nodes[0]["children"].append(len(nodes) - 2)
    assert told(gltf, tmp_path / "a.glb")


def _whole(gltf: Gltf, numbers: np.ndarray) -> int:
    """An accessor of whole numbers, which `Gltf.accessor` would normalise."""
    view = gltf.view(numbers.astype("<u2").tobytes())
    gltf.json["accessors"].append(
        {"bufferView": view, "componentType": 5123, "type": "VEC4", "count": len(numbers)}
    )
    return len(gltf.json["accessors"]) - 1
