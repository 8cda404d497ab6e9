"""What is written, as programs of others have it: Khronos' validator, and three.js in a browser.

Without node, npm's packages or chromium these tests are skipped, by name.
"""

from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.io.gltf_file import GltfFile
from spark.kinematics import forward
from spark_sim import Clip
from tests.helpers.fbx_arm import arm, placed, png, skin_of
from tests.helpers.fbx_text import Surface
from tests.helpers.glb import write_glb as skinned
from tests.helpers.gltf import animated
from tests.helpers.node import in_three, needs, validated
from tests.helpers.recordings import recording
from tests.helpers.stick import stick_rig
from tests.helpers.vrm import avatar

TIMES = (0.1, 0.5, 0.9)  # [s]


def test_khronos_validator_finds_no_error(walk: Clip, tmp_path: Path) -> None:
    """None of ours: a target's own, which stay, are those that its file has."""
    needs("gltf-validator")
    bodies = [
        skinned(tmp_path / "body.gltf", stick_rig(), embed=False),
        skinned(tmp_path / "body.glb", stick_rig()),
        animated(walk.motion, scale=0.01).write(tmp_path / "bare.glb"),
        avatar(walk.motion).write(tmp_path / "body.vrm"),
    ]
    arm_file = arm(surfaces=[Surface(picture=png())]).write(tmp_path / "arm.fbx")
    made = [walk.save(tmp_path / "walk.glb"), spark_sim.load(arm_file).save(tmp_path / "arm.glb")]
    for path, messages in zip(made, validated(*made), strict=True):
        assert not [m for m in messages if m["severity"] < 2], (path, messages)
    for body in bodies:
        out = spark_sim.retarget(walk, body).save(tmp_path / f"{body.name}_out.glb")
        before, after = validated(body, out)
        known = {m["code"] for m in before}
        assert not [m for m in after if m["severity"] == 0 and m["code"] not in known], after


def test_the_validator_finds_what_is_wrong(walk: Clip, tmp_path: Path) -> None:
    needs("gltf-validator")
    path = walk.save(tmp_path / "walk.glb")
    path.write_bytes(path.read_bytes().replace(b'"VEC4"', b'"VEC3"'))
    (messages,) = validated(path)
    assert any(message["severity"] == 0 for message in messages)


def test_joints_are_in_three_where_they_are_here(walk: Clip, tmp_path: Path) -> None:
    needs("three")
    path = walk.save(tmp_path / "walk.glb")
    seen = in_three("three.html", tmp_path, file="walk.glb", times=",".join(map(str, TIMES)))
    assert seen["length"] == pytest.approx(walk.duration, abs=1e-5)
    positions, _ = forward(walk.resampled(100.0).motion)
    for time, frame in zip(TIMES, seen["frames"], strict=True):
        there = positions[round(100 * time)][:, [1, 2, 0]]
        for j, name in enumerate(walk.joint_names):
            np.testing.assert_allclose(frame["joints"][name], there[j], atol=1e-4)
    assert GltfFile(path).json["animations"][0]["name"] == walk.name


def test_a_skin_is_in_three_where_it_is_here(tmp_path: Path) -> None:
    needs("three")
    path = arm(surfaces=[Surface(picture=png())]).write(tmp_path / "arm.fbx")
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    clip.save(tmp_path / "arm.glb")
    times = [k * clip.frame_time for k in (0, 9, 21)]
    seen = in_three("three.html", tmp_path, file="arm.glb", times=",".join(map(str, times)))
    skin = skin_of(path)
    expected = placed(skin, skin.meshes[0], clip)[[0, 9, 21]][..., [1, 2, 0]]
    got = np.array([frame["vertices"] for frame in seen["frames"]])
    np.testing.assert_allclose(got, expected, atol=1e-4)
    assert seen["pictures"] == [8]


def test_a_mixamo_character_dances(tmp_path: Path) -> None:
    """Two files in, a character that dances: its skin goes with the joints, and Khronos' validator
    has nothing to say."""
    needs("three", "gltf-validator")
    dance = recording("mixamo/Amy/hip_hop_dancing_101f.fbx")
    body = recording("mixamo/XBot/silly_dancing_115f.fbx")
    moved = spark_sim.retarget(spark_sim.load(dance), body)
    assert isinstance(moved, Clip)
    path = moved.save(tmp_path / "dance.glb")
    (messages,) = validated(path)
    assert not [m for m in messages if m["severity"] < 2]
    seen = in_three("three.html", tmp_path, file="dance.glb", times="1.0")
    vertices = np.array(seen["frames"][0]["vertices"])
    skin = skin_of(body)
    frame = round(1.0 / moved.frame_time)
    part = moved.part(1.0, 1.0)
    expected = np.concatenate([placed(skin, mesh, part)[0] for mesh in skin.meshes])
    assert frame == 30
    np.testing.assert_allclose(vertices, expected[:, [1, 2, 0]], atol=1e-4)
