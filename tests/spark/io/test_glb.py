"""GLBs that are written: read again, and by their own words."""

import json
import struct
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spark_sim
from spark.errors import OutputError
from spark.io.glb import write_glb
from spark.io.glb_skin import write_on_skin
from spark.kinematics import forward
from spark_sim.clips import Clip
from tests.helpers.glb import write_glb as skinned
from tests.helpers.gltf import animated
from tests.helpers.stick import stick_rig


def parts(path: Path) -> tuple[dict[str, Any], bytes]:
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert (kind, size % 4) == (b"JSON", 0)
    rest = data[20 + size :]
    binary, kind = struct.unpack_from("<I4s", rest)
    assert (kind, binary, len(rest)) == (b"BIN\0", len(rest) - 8, 8 + binary)
    return json.loads(data[20 : 20 + size]), rest[8:]


def assert_same(back: Clip, motion: Any) -> None:
    """The joints of one motion are where those of the other are."""
    assert len(back.motion) == len(motion)
    assert back.fps == pytest.approx(motion.fps, rel=1e-3)
    theirs, _ = forward(back.motion)
    ours, _ = forward(motion)
    order = [back.motion.skeleton.names.index(name) for name in motion.skeleton.names]
    np.testing.assert_allclose(theirs[:, order], ours, atol=2e-5)


def test_a_character_is_read_again_as_it_was(walk: Clip, tmp_path: Path) -> None:
    back = spark_sim.load(walk.save(tmp_path / "walk.glb"))
    assert isinstance(back, Clip)
    assert_same(back, walk.motion)


def test_numbers_are_laid_out_as_gltf_wants_them(walk: Clip, tmp_path: Path) -> None:
    gltf, binary = parts(walk.save(tmp_path / "walk.glb"))
    assert gltf["asset"]["version"] == "2.0"
    assert gltf["buffers"] == [{"byteLength": len(binary)}]
    assert [node["name"] for node in gltf["nodes"]][:3] == list(walk.joint_names)[:3]
    (animation,) = gltf["animations"]
    assert len(animation["channels"]) == len(walk.joint_names) + 1  # one place: the root's
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        times, values = (gltf["accessors"][sampler[key]] for key in ("input", "output"))
        assert (times["count"], times["min"], values["count"]) == (31, [0], 31)
        wide = {"rotation": "VEC4", "translation": "VEC3"}
        assert values["type"] == wide[channel["target"]["path"]]
        view = gltf["bufferViews"][values["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        if values["type"] == "VEC4":
            start = view["byteOffset"]
            q = np.frombuffer(binary[start : start + view["byteLength"]], "<f4").reshape(-1, 4)
            np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-6)
    feet = [node for node in gltf["nodes"] if "mesh" in node]
    assert len(feet) >= len(walk.joint_names) - 1


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_a_glb_target_keeps_its_skin(scale: float, walk: Clip, tmp_path: Path) -> None:
    """Below an armature that is scaled and turned, with joints in any axes, in reverse order."""
    gltf = animated(walk.motion, scale=scale)
    before = json.loads(json.dumps(gltf.json))
    body = gltf.write(tmp_path / "body.glb")
    other = spark_sim.load(walk.recording.bvh.path.parent / "dancer_wave.bvh").part(0.0, 1.0)
    assert isinstance(other, Clip)
    out = spark_sim.retarget(other, body)
    assert isinstance(out, Clip)
    path = out.save(tmp_path / "out.glb")
    after, _ = parts(path)
    assert after["skins"] == before["skins"]
    assert len(after["nodes"]) == len(before["nodes"])
    assert len(after["animations"]) == 1
    back = spark_sim.load(path)
    assert isinstance(back, Clip)
    assert_same(back, out.motion)


@pytest.mark.parametrize("embed", [True, False])
def test_meshes_stay_as_they_are(embed: bool, walk: Clip, tmp_path: Path) -> None:
    """A mesh bound in one pose whose nodes rest in another; its buffer may lie beside it."""
    body = skinned(tmp_path / f"body.{'glb' if embed else 'gltf'}", stick_rig(), embed=embed)
    out = spark_sim.retarget(walk, body)
    assert isinstance(out, Clip)
    path = out.save(tmp_path / "out.glb")
    gltf, binary = parts(path)
    assert gltf["meshes"]
    assert gltf["skins"]
    for accessor in gltf["accessors"]:
        view = gltf["bufferViews"][accessor["bufferView"]]
        assert view["buffer"] == 0
        assert view["byteOffset"] + view["byteLength"] <= len(binary)
    back = spark_sim.load(path)
    assert isinstance(back, Clip)
    assert_same(back, out.motion)


def test_other_endings_are_refused(walk: Clip, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"written as \.bvh, \.glb or \.vrma, not as"):
        walk.save(tmp_path / "walk.fbx")


@pytest.mark.parametrize("value", [np.nan, 1e39])
@pytest.mark.parametrize("skin", [False, True])
def test_numbers_that_are_none_are_not_written(
    walk: Clip, value: float, skin: bool, tmp_path: Path
) -> None:
    """1e39 is more than single precision holds."""
    worn, out = animated(walk.motion).write(tmp_path / "skin.glb"), tmp_path / "out.glb"
    motion = spark_sim.load(worn).motion
    place = motion.root_pos.copy()
    place[3, 1] = value
    motion = replace(motion, root_pos=place)
    write = partial(write_on_skin, motion, worn) if skin else partial(write_glb, motion)
    with pytest.raises(OutputError, match="not written: a place or a rotation is no number"):
        write(out)
    assert not out.exists()
