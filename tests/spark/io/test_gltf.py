"""glTF: every variant gives the motion that it was made from; trimesh agrees on where nodes are."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

import spark_sim
from spark.demo.sample import sample_motion, sample_rig
from spark.errors import ConventionError, FileFormatError, SparkSimError
from spark.io.gltf import read_gltf
from spark.io.reading import read_motion
from spark.kinematics import forward
from spark.motion import Motion
from tests.helpers.gltf import Gltf, animated
from tests.helpers.hostile import damaged, edits
from tests.helpers.recordings import recordings


@pytest.fixture(scope="module")
def walking() -> Motion:
    return sample_motion("walk", sample_rig("walker"), 30.0)


def joints(motion: Motion) -> np.ndarray:
    return forward(motion)[0]


@pytest.mark.parametrize(
    ("variant", "within"),
    [
        ({}, 1e-5),
        ({"scale": 100.0}, 1e-5),
        ({"skin": False}, 1e-5),
        ({"sparse": True}, 1e-5),
        ({"stride": 24}, 1e-5),
        ({"kind": "i2"}, 1e-3),
        ({"kind": "i1"}, 0.1),
    ],
    ids=str,
)
@pytest.mark.parametrize("buffer", ["glb", "inside", "beside"])
def test_every_variant_gives_the_motion_back(
    walking: Motion, tmp_path: Path, variant: dict[str, Any], within: float, buffer: str
) -> None:
    ending = "glb" if buffer == "glb" else "gltf"
    path = animated(walking, **variant).write(tmp_path / f"a.{ending}", buffer=buffer)
    clip = spark_sim.load(path)
    motion = clip.motion
    assert motion.fps == pytest.approx(30)
    assert len(motion) == len(walking)
    order = [motion.skeleton.names.index(name) for name in walking.skeleton.names]
    np.testing.assert_allclose(joints(motion)[:, order], joints(walking), atol=within)
    rest = walking.skeleton.rest_positions
    np.testing.assert_allclose(motion.skeleton.rest_positions[order], rest, atol=1e-5)
    assert "unit 100 cm, as glTF has it" in clip.notes
    assert clip.canonical.rotations.shape[0] == len(walking)


@pytest.mark.parametrize("path", recordings("zoo/m2m_*.bvh", "animateddrawings/*.bvh"))
def test_recordings_come_through(path: Path, tmp_path: Path) -> None:
    """Bodies of all sorts, some with joints that move in their parents."""
    source = read_motion(path).motion.frames(0, 40)
    read = read_gltf(animated(source, scale=100.0).write(tmp_path / "a.glb"), unit="m")
    order = [read.motion.skeleton.names.index(name) for name in source.skeleton.names]
    np.testing.assert_allclose(joints(read.motion)[:, order], joints(source), atol=1e-4)


def test_trimesh_has_the_nodes_where_we_have_them(walking: Motion, tmp_path: Path) -> None:
    """An independent reader of the same file, in the pose that its nodes are in."""
    trimesh = pytest.importorskip("trimesh")
    gltf = animated(walking, scale=100.0)
    triangle = gltf.accessor(np.eye(3))
    gltf.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": triangle}}]}]
    count = len(gltf.json["nodes"])
    for node in gltf.json["nodes"][1:count]:
        node.setdefault("children", []).append(len(gltf.json["nodes"]))
        gltf.json["nodes"].append({"mesh": 0, "name": f"at {node['name']}"})
    scene = trimesh.load(gltf.write(tmp_path / "a.glb"))
    skeleton = read_gltf(tmp_path / "a.glb").motion.skeleton
    for name, at in zip(skeleton.names, skeleton.rest_positions, strict=True):
        matrix, _ = scene.graph.get(f"at {name}")
        np.testing.assert_allclose(matrix[:3, 3][[2, 0, 1]], at, atol=1e-5)


def test_the_animation_that_moves_most_is_read(walking: Motion, tmp_path: Path) -> None:
    gltf = animated(walking)
    times = gltf.accessor(np.array([[0.0], [1.0]]))
    turns = gltf.accessor(np.array([[0, 0, 0, 1.0], [0, 0, 1.0, 0]]))
    gltf.json["animations"].insert(0, {"name": "nod", "channels": [], "samplers": []})
    gltf.channel(0, 1, "rotation", times, turns)
    gltf.json["animations"].append({"channels": [], "samplers": []})
    path = gltf.write(tmp_path / "a.glb")
    notes = read_gltf(path).notes
    assert "animation 'moves' is read (--clip for others: 'nod', 'animation 2')" in notes
    assert len(read_gltf(path).motion) == len(walking)
    nod = spark_sim.load(path, clip="Nod").motion
    assert nod.duration == pytest.approx(1, abs=0.04)
    assert len(read_gltf(path, clip="animation 2").motion) == 1
    with pytest.raises(ConventionError, match=r"a\.glb: no animation is called 'run'; .* 'moves'"):
        spark_sim.load(path, clip="run")


def test_a_longer_animation_of_which_nothing_moves_is_not_read(
    walking: Motion, tmp_path: Path
) -> None:
    gltf = animated(walking)
    held = json.loads(json.dumps(gltf.json["animations"][0]))
    held["name"] = "held"
    times = gltf.accessor(np.array([[0.0], [60.0]]))
    still = {3: np.ones((2, 3)), 4: np.tile([0, 0, 0, 1.0], (2, 1))}
    values = {width: gltf.accessor(rows) for width, rows in still.items()}
    for channel in held["channels"]:
        sampler = held["samplers"][channel["sampler"]]
        sampler["input"] = times
        sampler["output"] = values[4 if channel["target"]["path"] == "rotation" else 3]
    gltf.json["animations"].append(held)
    path = gltf.write(tmp_path / "a.glb")
    assert len(read_gltf(path).motion) == len(walking)
    assert read_gltf(path, clip="held").motion.duration == pytest.approx(60)


def bent(how: str, keys: np.ndarray, values: np.ndarray, path: str) -> Gltf:
    """A file of two joints; the second turns or moves by keys."""
    gltf = Gltf()
    gltf.json["nodes"] = [
        {"name": "hips", "translation": [0, 1, 0], "children": [1]},
        {"name": "spine", "translation": [0, 0.5, 0], "children": [2]},
        {"name": "neck", "translation": [0, 0.5, 0]},
    ]
    gltf.json["scenes"] = [{"nodes": [0]}]
    gltf.json["skins"] = [{"joints": [0, 1, 2]}]
    gltf.json["animations"] = [{"channels": [], "samplers": []}]
    gltf.channel(0, 1, path, gltf.accessor(keys[:, None]), gltf.accessor(values), how)
    return gltf


KEYS = np.array([0.5, 1.0, 2.5])


@pytest.mark.parametrize("how", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_rotations_between_keys(tmp_path: Path, how: str) -> None:
    """Against scipy: slerp, the last key, and the cubic spline of appendix C, normalised."""
    turns = Rotation.from_rotvec(np.radians([[0, 0, 0], [0, 10, 50], [20, 0, 120]]))
    quats = turns.as_quat().astype(np.float32).astype(float)
    slopes = np.random.default_rng(0).normal(0, 0.3, (3, 4)).astype(np.float32).astype(float)
    values = quats
    if how == "CUBICSPLINE":
        values = np.stack([slopes, quats, slopes], axis=1).reshape(-1, 4)
    read = read_gltf(bent(how, KEYS, values, "rotation").write(tmp_path / "a.glb"), fps=20.0)
    times = 0.5 + np.arange(len(read.motion)) / 20
    assert times[-1] == pytest.approx(2.5)
    if how == "LINEAR":
        expected = Slerp(KEYS, turns)(np.clip(times, *KEYS[[0, -1]])).as_quat()
    elif how == "STEP":
        expected = quats[np.searchsorted(KEYS, times + 1e-9, side="right") - 1]
    else:
        expected = CubicHermiteSpline(KEYS, quats, slopes)(np.clip(times, *KEYS[[0, -1]]))
    found = read.motion.rotations[:, 1][:, [2, 3, 1, 0]]  # ours y, z, x, w: the file's x, y, z, w
    between = Rotation.from_quat(found).inv() * Rotation.from_quat(expected)
    np.testing.assert_allclose(between.magnitude(), 0, atol=1e-6)


@pytest.mark.parametrize("step", [0.033333, 0.0333334, 0.041667])
def test_stepped_keys_of_a_rate_in_few_digits_are_a_frame_each(tmp_path: Path, step: float) -> None:
    """None is held for two, and none left out, wherever the rate that is read drifts to."""
    turns = Rotation.from_rotvec(np.linspace(0, 2, 900)[:, None] * [0, 0, 1])
    keys, quats = np.arange(900) * step, turns.as_quat()
    found = read_gltf(bent("STEP", keys, quats, "rotation").write(tmp_path / "a.glb")).motion
    assert len(found) == 900
    apart = np.diff(found.rotations[:, 1], axis=0)
    assert np.linalg.norm(apart, axis=-1).min() > 1e-4


@pytest.mark.parametrize("path", ["translation", "scale"])
def test_places_and_scales_between_keys(tmp_path: Path, path: str) -> None:
    values = np.array([[0.25, 0.5, 0.5], [0.5, 0.5, 0.5], [1, 2, 0.5]])
    read = read_gltf(bent("LINEAR", KEYS, values, path).write(tmp_path / "a.glb"), fps=4.0)
    at = np.stack(
        [np.interp([0.5, 0.75, 1, 1.25, 1.5, 1.75, 2, 2.25, 2.5], KEYS, v) for v in values.T], 1
    )
    found = joints(read.motion)[..., [1, 2, 0]]
    if path == "translation":
        np.testing.assert_allclose(found[:, 1] - [0, 1, 0], at, atol=1e-6)
    else:  # the neck hangs half a metre above the spine, in the spine's scale
        np.testing.assert_allclose(found[:, 2, 1] - 1.5, 0.5 * at[:, 1], atol=1e-6)


def test_rates(walking: Motion, tmp_path: Path) -> None:
    """A rate is read off keys that lie as frames do, and else 30."""
    slow = bent("LINEAR", KEYS, np.eye(3), "translation").write(tmp_path / "b.glb")
    assert any("30 fps: its keys lie at odd times" in note for note in read_gltf(slow).notes)
    path = animated(walking).write(tmp_path / "a.glb")
    assert read_gltf(path, fps=60.0).motion.duration == pytest.approx(walking.duration)


@pytest.mark.parametrize("kind", ["VRMC_vrm", "VRMC_vrm_animation", "VRM"])
def test_bones_of_a_vrm_without_a_skin(walking: Motion, tmp_path: Path, kind: str) -> None:
    gltf = animated(walking, skin=False)
    nodes = {f"bone{i}": {"node": i} for i in range(1, len(gltf.json["nodes"]))}
    bones: Any = nodes if kind != "VRM" else [{"bone": k} | v for k, v in nodes.items()]
    gltf.json["extensions"] = {kind: {"humanoid": {"humanBones": bones}}}
    gltf.json["animations"] = []
    read = read_motion(gltf.write(tmp_path / "a.vrm"))
    assert len(read.motion) == 1
    assert len(read.motion.skeleton) == len(walking.skeleton)


def test_skins_of_one_body_and_others(walking: Motion, tmp_path: Path) -> None:
    """Clothes share joints with the body; another figure is left out."""
    gltf = animated(walking)
    joints_ = gltf.json["skins"][0]["joints"]
    gltf.json["skins"] = [{"joints": joints_[:10]}, {"joints": joints_[5:]}]
    gltf.json["skins"].append({"joints": [len(gltf.json["nodes"])]})
    gltf.json["nodes"].append({"name": "lamp"})
    read = read_gltf(gltf.write(tmp_path / "a.glb"))
    assert len(read.motion.skeleton) == len(walking.skeleton)


def test_centimetres(walking: Motion, tmp_path: Path) -> None:
    """Files that keep to no metres: 170 m is no body."""
    gltf = animated(walking, scale=100.0)
    del gltf.json["nodes"][0]["scale"]
    path = gltf.write(tmp_path / "a.glb")
    read = read_gltf(path)
    assert read.convention.unit == "cm"
    assert any("in 100 cm, as glTF has it, it is" in note for note in read.notes)
    assert read_gltf(path, unit="dm").convention.unit == "dm"


CHANGES: dict[str, tuple[Any, str]] = {
    "no nodes": (lambda g: g.update(nodes=[], skins=[], animations=[]), "holds no skeleton"),
    "cycle": (lambda g: g["nodes"][-1].update(children=[0]), "their own ancestors|below two"),
    "two parents": (lambda g: g["nodes"][0].update(children=[1, 2]), "below two others"),
    "outside": (lambda g: g["accessors"][0].update(count=10**9), "outside its buffer"),
    "zeros": (
        lambda g: (g["accessors"][0].pop("bufferView"), g["accessors"][0].update(count=10**12)),
        "expected fewer",
    ),
    "negative": (lambda g: g["bufferViews"][0].update(byteOffset=-8), "outside its buffer"),
    "joint": (lambda g: g["skins"][0].update(joints=[99]), "none of its"),
    "target": (
        lambda g: g["animations"][0]["channels"][0]["target"].update(node=99),
        "animates node 99",
    ),
    "shape": (lambda g: g["accessors"][1].update(type="VEC3"), "expected rising times"),
    "meshopt": (lambda g: g.update(extensionsRequired=["EXT_meshopt_compression"]), "compressed"),
    "glTF 1": (lambda g: g["asset"].update(version="1.0"), "is glTF 1"),
    "rotation": (lambda g: g["nodes"][3].update(rotation=[1, 2]), "rotation of 2 numbers|valid"),
    "list": (lambda g: g.update(nodes=3), "no valid glTF"),
    "flat": (lambda g: g["nodes"][0].update(matrix=[0] * 16), "flat: a scale of zero"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_broken_files_are_refused(walking: Motion, tmp_path: Path, change: str) -> None:
    gltf = animated(walking.frames(0, 3))
    alter, says = CHANGES[change]
    alter(gltf.json)
    with pytest.raises(FileFormatError, match=rf"a\.gltf: .*({says})"):
        read_gltf(gltf.write(tmp_path / "a.gltf", buffer="inside"))


@pytest.mark.parametrize(
    ("start", "says"),
    [(b"glTF\1\0\0\0", "is glTF 1"), (b"glTF\2\0\0\0", "no JSON; is it cut short")],
)
def test_binary_files_without_our_json_are_refused(tmp_path: Path, start: bytes, says: str) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(start + b"\x20\0\0\0\4\0\0\0\0\0\0\0{}  ")
    with pytest.raises(FileFormatError, match=rf"a\.glb: .*{says}"):
        read_gltf(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("gltf")


@given(changes=edits, binary=st.booleans())
@settings(deadline=None, max_examples=150)
def test_damaged_files_give_a_recording_or_an_error_of_ours(
    folder: Path, changes: list[tuple[str, int, int]], binary: bool
) -> None:
    name, buffer = ("c.glb", "glb") if binary else ("c.gltf", "inside")
    whole = bent("LINEAR", KEYS, np.eye(3), "translation").write(folder / name, buffer=buffer)
    whole.write_bytes(damaged(whole.read_bytes(), changes))
    try:
        read = read_motion(whole)
    except SparkSimError:
        return
    assert np.isfinite(joints(read.motion)).all()


LONG = [10**300, -(10**300), 10**400, 10**4200]  # a whole number may have any number of digits
scalars = st.none() | st.booleans() | st.floats() | st.text(max_size=3)
scalars |= st.integers(-3, 2**70) | st.sampled_from(LONG)


@given(
    place=st.lists(st.integers(0, 50), min_size=1, max_size=6),
    value=st.recursive(scalars, lambda v: st.lists(v, max_size=2), max_leaves=3),
)
@settings(deadline=None, max_examples=300)
def test_json_with_other_values_gives_a_recording_or_an_error_of_ours(
    folder: Path, place: list[int], value: Any
) -> None:
    """One value of the JSON, anywhere, becomes another one of any type."""
    gltf = bent("LINEAR", KEYS, np.eye(3), "translation")
    gltf.write(folder / "d.gltf", buffer="inside")
    at: Any = gltf.json
    for step in place:
        keys = list(at) if isinstance(at, dict) else list(range(len(at)))
        if not keys:
            break
        key = keys[step % len(keys)]
        if not isinstance(at[key], dict | list) or not at[key] or step % 7 == 0:
            at[key] = value
            break
        at = at[key]
    try:
        text = json.dumps(gltf.json)
    except ValueError:
        return
    (folder / "d.gltf").write_text(text)
    try:
        read = read_motion(folder / "d.gltf")
    except SparkSimError:
        return
    assert np.isfinite(joints(read.motion)).all()
