"""Skins of glTF files against three.js, against what a glTF loader does, and spoilt."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import spark_sim
from spark.errors import FileFormatError, SparkSimError
from spark.io import gltf_skin
from spark.io.skins import read_skin
from spark.kinematics import forward
from spark.skin import Skin, skinned
from spark_sim.clips import Clip
from tests.helpers.glb import box_of, posed, write_glb
from tests.helpers.gltf import Gltf
from tests.helpers.hostile import damaged, edits
from tests.helpers.skins import character, checked_picture, write_character
from tests.helpers.stick import stick_rig


def skin_of(path: Path) -> tuple[Clip, Skin]:
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    skin, _ = read_skin(path, clip.recording.convention)
    assert skin is not None
    return clip, skin


def seen(clip: Clip, skin: Skin) -> Any:
    return skinned(skin, clip.motion.skeleton, *forward(clip.motion))


# What three.js 0.160 gives for these vertices (SkinnedMesh.getVertexPosition, matrixWorld): mesh,
# vertex, and glTF's x, y, z [m] at 0 and 0.5 s.
THREE = [
    (0, 0, (0.065519, 0.936122, -0.000000), (0.037424, 0.926776, 0.614634)),
    (0, 40, (-0.003687, 1.004442, 0.047553), (-0.022436, 1.002404, 0.663781)),
    (0, 333, (-0.011877, 1.299948, -0.040981), (-0.011450, 1.296497, 0.574690)),
    (0, 700, (0.078792, 0.918691, 0.047553), (0.049807, 0.907888, 0.661869)),
    (1, 0, (0.037768, 1.338552, 0.008609), (0.036933, 1.334719, 0.625790)),
    (1, 40, (0.130260, 1.401430, 0.059347), (0.127801, 1.397396, 0.679617)),
    (1, 333, (0.001298, 0.056285, -0.036878), (0.004877, 0.204779, 0.329303)),
]


def test_vertices_are_where_three_js_has_them(walk: Clip, tmp_path: Path) -> None:
    path = write_character(walk.motion, tmp_path / "tubes.glb", scale=100.0, picture=False)
    clip, skin = skin_of(path)
    vertices = seen(clip, skin)
    starts = [0, int(skin.faces[skin.material_of == 1].min())]
    for mesh, vertex, first, later in THREE:
        for frame, (x, y, z) in ((0, first), (15, later)):
            np.testing.assert_allclose(vertices[frame, starts[mesh] + vertex], [z, x, y], atol=5e-6)


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_a_mesh_bound_in_another_pose_than_the_files(scale: float, tmp_path: Path) -> None:
    rig = stick_rig()
    bind, shown = (20.0, 10.0), (45.0, 5.0)
    path = write_glb(tmp_path / "boxes.glb", rig, scale=scale, bind=bind, shown=shown)
    clip, skin = skin_of(path)
    corners = np.array([box_of(rig.skeleton, j) for j in range(len(rig.skeleton))])
    corners = np.append(corners, np.ones((*corners.shape[:2], 1)), axis=-1)
    bound, now = posed(rig, *bind), posed(rig, *shown)
    at_bind = np.einsum("jik,jvk->jvi", bound, corners)
    moved = now @ np.linalg.inv(bound)  # each joint, from where it was bound to where it is
    own = np.einsum("jik,jvk->jvi", moved, at_bind)
    root = np.einsum("ik,jvk->jvi", moved[0], at_bind)
    expected = (0.7 * own + 0.3 * root)[..., :3].reshape(-1, 3)
    # The file has no faces: its corners are taken in threes.
    used = len(expected) // 3 * 3
    np.testing.assert_allclose(seen(clip, skin)[0], expected[:used], atol=1e-5)


def test_pictures_and_colours(walk: Clip, tmp_path: Path) -> None:
    _, skin = skin_of(write_character(walk.motion, tmp_path / "tubes.glb"))
    picture, green = skin.materials
    np.testing.assert_array_equal(picture.image, np.asarray(checked_picture()))
    assert green.image is None
    # 0.6 in linear light is 0.798 on a screen (IEC 61966-2-1).
    np.testing.assert_allclose(green.rgb, (0.2478, 0.7977, 0.3492), atol=1e-3)
    assert {0, 1} == set(skin.material_of.tolist())


def test_what_is_clear_is_left_out(walk: Clip, tmp_path: Path) -> None:
    gltf = character(walk.motion)
    whole = len(skin_of(gltf.write(tmp_path / "whole.glb"))[1].faces)
    green = gltf.json["materials"][1]
    green["pbrMetallicRoughness"]["baseColorFactor"][3] = 0.1
    assert len(skin_of(gltf.write(tmp_path / "opaque.glb"))[1].faces) == whole
    green["alphaMode"] = "BLEND"
    _, skin = skin_of(gltf.write(tmp_path / "clear.glb"))
    assert 0 < len(skin.faces) < whole
    assert set(skin.material_of.tolist()) == {0}


def test_a_mesh_on_a_joint_as_a_whole(walk: Clip, tmp_path: Path) -> None:
    gltf = character(walk.motion)
    head = next(n for n in gltf.json["nodes"] if n["name"].endswith("Head"))
    hat = np.array([[0.0, 0, 0.1], [0.1, 0, 0.1], [0, 0.1, 0.1]])
    gltf.json["meshes"].append({"primitives": [{"attributes": {"POSITION": gltf.accessor(hat)}}]})
    gltf.json["nodes"].append({"name": "hat", "mesh": 1, "translation": [0.0, 0.0, 0.2]})
    head.setdefault("children", []).append(len(gltf.json["nodes"]) - 1)
    clip, skin = skin_of(gltf.write(tmp_path / "hat.glb"))
    at = seen(clip, skin)[:, -3:]
    head_at = forward(clip.motion)[0][:, clip.joint_names.index(head["name"])]
    distance = np.linalg.norm(at - head_at[:, None], axis=-1)
    expected = np.linalg.norm(hat + np.array([0, 0, 0.2]), axis=1)
    np.testing.assert_allclose(distance, np.tile(expected, (len(at), 1)), atol=1e-5)


def test_a_file_without_a_skin_has_none(walk: Clip, tmp_path: Path) -> None:
    bones = walk.save(tmp_path / "bones.glb")  # a mesh on each joint, to see bones by
    for path in (bones, walk.save(tmp_path / "walk.bvh")):
        assert read_skin(path, walk.recording.convention) == (None, ())


def test_a_skin_beyond_bounds_is_refused(
    walk: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_character(walk.motion, tmp_path / "tubes.glb")
    monkeypatch.setattr(gltf_skin, "MAX_FACES", 100)
    with pytest.raises(FileFormatError, match=r"more than .* 100 faces"):
        skin_of(path)


def test_a_picture_that_cannot_be_read_is_said(walk: Clip, tmp_path: Path) -> None:
    gltf = character(walk.motion)
    gltf.json["images"] = [{"uri": "missing.png"}]
    path = gltf.write(tmp_path / "tubes.glb")
    skin, notes = read_skin(path, walk.recording.convention)
    assert skin is not None
    assert "can't be read" in notes[0]
    assert skin.materials[0].image is None


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (("skins", 0, "joints"), [1, 2], "bone"),
        (("meshes", 0, "primitives", 0, "attributes", "WEIGHTS_0"), 0, "weights"),
        (("meshes", 0, "primitives", 0, "indices"), "far", "face"),
        (("meshes", 0, "primitives", 0, "material"), 7, "no valid"),
        (("meshes", 0, "primitives", 0, "attributes", "POSITION"), 10**6, "no valid"),
    ],
)
def test_broken_skins_are_refused(
    place: tuple[str | int, ...], value: Any, words: str, walk: Clip, tmp_path: Path
) -> None:
    gltf: Gltf = character(walk.motion)
    *way, last = place
    entry: Any = gltf.json
    for step in way:
        entry = entry[step]
    entry[last] = gltf.accessor(np.full((3, 1), 1e6)) if value == "far" else value
    path = gltf.write(tmp_path / "broken.glb")
    with pytest.raises(FileFormatError, match=words):
        read_skin(path, walk.recording.convention)


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(changes=edits)
def test_spoilt_files_end_in_a_typed_error(
    changes: list[tuple[str, int, int]], walk: Clip, tmp_path: Path
) -> None:
    whole = tmp_path / "whole.glb"
    if not whole.is_file():
        write_character(walk.part(0.0, 0.1).motion, whole)
    spoilt = tmp_path / "spoilt.glb"
    spoilt.write_bytes(damaged(whole.read_bytes(), changes))
    try:
        skin, _ = read_skin(spoilt, walk.recording.convention)
    except SparkSimError:
        return
    assert skin is None or skin.faces.max() < len(skin.vertices)
