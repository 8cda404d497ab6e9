"""Bodies from a skinned mesh: hulls lie on the bones, whatever its pose, axes and units."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from sim.body.build import build_body
from sim.body.mesh import hulls_of, read_skinned_mesh
from sim.body.mjcf import notes_of, paths_of, write_mjcf
from spark.errors import DependencyError, FileFormatError, SkeletonError
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from tests.helpers.bodies import at_key, joint_errors_deg, run
from tests.helpers.fbx_text import Fbx, Mesh, Node, Take
from tests.helpers.glb import HALF_WIDTH, box_of, write_glb
from tests.helpers.stick import joint, stick_rig

BONES = (Role.LEFT_UPPER_ARM, Role.LEFT_FOREARM, Role.RIGHT_HAND, Role.LEFT_LOWER_LEG, Role.SPINE)


def assert_boxes_are_hulls(path: Path, rig: Rig) -> None:
    hulls, _ = hulls_of(path, rig)
    assert sorted(hulls) == list(range(len(rig.skeleton)))
    for role in BONES:
        found, expected = hulls[joint(role)].vertices, box_of(rig.skeleton, joint(role))
        assert len(found) == 8
        away = np.linalg.norm(found[:, None] - expected, axis=-1)
        assert away.min(axis=0).max() < 1e-5
        assert away.min(axis=1).max() < 1e-5


@pytest.mark.parametrize("scale", [1.0, 100.0, 0.0254])
@pytest.mark.parametrize("bind", [(0.0, 0.0), (60.0, 0.0)])
@pytest.mark.parametrize("shown", [(0.0, 0.0), (45.0, 5.0)])
def test_hulls_are_in_the_tpose(
    scale: float, bind: tuple[float, float], shown: tuple[float, float], tmp_path: Path
) -> None:
    rig = stick_rig()
    path = write_glb(tmp_path / "body.glb", rig, scale=scale, bind=bind, shown=shown)
    assert_boxes_are_hulls(path, rig)
    _, notes = hulls_of(path, rig)
    assert f"scaled by {1 / scale:.4g}" in notes[0]


def test_an_fbx_has_a_mesh_too(tmp_path: Path) -> None:
    """In centimetres and Y up, at rest whatever it plays; a VRM is a GLB by another name."""
    pytest.importorskip("pufbx")
    corners = np.array([[x, y, z] for x in (-5.0, 5) for y in (0.0, 40) for z in (-5.0, 5)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    nodes = [Node("Hips", translation=(0, 90, 0)), Node("Arm", 0, (10, 0, 0))]
    nodes.append(Node("box", kind="Mesh"))
    hung = Mesh(2, corners, sides, [(1, np.eye(4), dict.fromkeys(range(8), 1.0))])
    turning = Take("turn", 1, "Z", times=(0.0, 0.5, 1.0), angles=(40.0, 80.0, 10.0))
    mesh = read_skinned_mesh(Fbx(nodes, [turning], meshes=[hung]).write(tmp_path / "arm.fbx"))
    assert mesh.names == ("Hips", "Arm")
    assert set(mesh.owners) == {1}
    expected = (corners + np.array([10, 0, 0]))[:, [2, 0, 1]] / 100
    away = np.linalg.norm(mesh.vertices[:, None] - expected, axis=-1)
    assert max(away.min(axis=0).max(), away.min(axis=1).max()) < 1e-6
    rig = stick_rig()
    assert_boxes_are_hulls(write_glb(tmp_path / "a.glb", rig).rename(tmp_path / "a.vrm"), rig)


def test_a_buffer_beside_the_file(tmp_path: Path) -> None:
    rig = stick_rig()
    assert_boxes_are_hulls(write_glb(tmp_path / "body.gltf", rig, embed=False), rig)


def test_the_heaviest_joint_owns_a_vertex(tmp_path: Path) -> None:
    """The builder gives each vertex 0.7 of its bone and 0.3 of the pelvis."""
    mesh = read_skinned_mesh(write_glb(tmp_path / "body.glb", stick_rig()))
    assert np.bincount(mesh.owners).tolist() == [8] * len(mesh.names)


def test_names_match_without_case_punctuation_and_prefix(tmp_path: Path) -> None:
    rig = stick_rig()
    names = tuple(f"mixamorig:{name.replace('_', ' ').title()}" for name in rig.skeleton.names)
    assert_boxes_are_hulls(write_glb(tmp_path / "body.glb", rig, names=names), rig)


def test_names_that_do_not_match_are_named(tmp_path: Path) -> None:
    rig = stick_rig()
    names = tuple(name.replace("left_hand", "xyz") for name in rig.skeleton.names)
    path = write_glb(tmp_path / "body.glb", rig, names=names)
    with pytest.raises(
        SkeletonError, match=r"body\.glb: no joint is named as 'left_hand' of .*'xyz'|more"
    ):
        hulls_of(path, rig)


def test_what_hangs_on_a_joint_that_the_rig_lacks_belongs_to_the_one_above(tmp_path: Path) -> None:
    """The rig's left hand is no joint of its own: the forearm has two boxes, hand and forearm."""
    rig = stick_rig()
    path = write_glb(tmp_path / "body.glb", rig)
    hand = joint(Role.LEFT_HAND)
    without = _without(rig, hand)
    hulls, _ = hulls_of(path, without)
    forearm = hulls[without.roles.require(Role.LEFT_FOREARM)].vertices
    reach = rig.skeleton.offsets[hand][1]
    assert forearm[:, 1].max() == pytest.approx(reach + HALF_WIDTH, abs=1e-5)
    assert forearm[:, 0].max() == pytest.approx(0.1 + HALF_WIDTH, abs=1e-5)


def _without(rig: Rig, gone: int) -> Rig:
    """The rig without a joint at the end of a limb."""
    s = rig.skeleton
    kept = [j for j in range(len(s)) if j != gone]
    index = {j: k for k, j in enumerate(kept)}
    skeleton = replace(
        s,
        names=tuple(s.names[j] for j in kept),
        parents=np.array([index.get(int(s.parents[j]), -1) for j in kept]),
        offsets=s.offsets[kept],
        translating=s.translating[kept],
        end_parents=np.array([index[int(j)] for j in s.end_parents]),
    )
    roles = tuple(rig.roles.roles[j] for j in kept)
    return replace(
        rig,
        skeleton=skeleton,
        roles=RoleMap(roles, (1.0,) * len(kept), ("",) * len(kept)),
        groups=rig.groups[:-1],
        tpose=rig.tpose[kept],
    )


@pytest.mark.parametrize("joints", ["ball", "hinge"])
def test_a_body_of_hulls_is_written_and_stands(joints: str, tmp_path: Path) -> None:
    rig = stick_rig()
    mesh = write_glb(tmp_path / "mesh.glb", rig, scale=100.0)
    spec = build_body(rig, joints=joints, mesh=mesh)
    assert any("hulls" in note for note in notes_of(spec))
    body, scene = write_mjcf(spec, tmp_path / "b.xml")
    assert all(path.exists() for path in paths_of(spec, body))
    assert (tmp_path / "b_meshes" / "left_foot.obj").exists()
    assert "<mesh" in body.read_text()
    assert "vertex=" not in body.read_text()
    model = mujoco.MjModel.from_xml_path(str(scene))
    plain = build_body(rig).compile()
    np.testing.assert_allclose(model.body_mass, plain.body_mass, rtol=1e-8)
    np.testing.assert_allclose(model.body_inertia, plain.body_inertia, rtol=1e-6)
    kinds = model.geom_type[model.geom_bodyid > 0]
    assert int(mujoco.mjtGeom.mjGEOM_CAPSULE) not in kinds
    assert (kinds == int(mujoco.mjtGeom.mjGEOM_MESH)).sum() == len(rig.skeleton)

    data = at_key(model, "tpose")
    shin = model.body("left_lower_leg").id
    geom = int(np.flatnonzero(model.geom_bodyid == shin)[0])
    at = int(model.mesh_vertadr[model.geom_dataid[geom]])
    corners = model.mesh_vert[at : at + 8] @ data.geom_xmat[geom].reshape(3, 3).T
    corners += data.geom_xpos[geom]
    expected = data.xpos[shin] + box_of(rig.skeleton, joint(Role.LEFT_LOWER_LEG))
    np.testing.assert_allclose(np.sort(corners, axis=0), np.sort(expected, axis=0), atol=1e-5)

    start = data.qpos.copy()
    for _ in run(model, data, 1.0):
        pass
    assert np.linalg.norm(data.qpos[:3] - start[:3]) < 0.03
    assert max(joint_errors_deg(model, data.qpos, start).values()) < 3


def test_other_proportions_are_said(tmp_path: Path) -> None:
    rig = stick_rig()
    path = write_glb(tmp_path / "body.glb", rig)
    offsets = rig.skeleton.offsets * np.where(np.arange(len(rig.skeleton)) % 2, 1.5, 1.0)[:, None]
    other = replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))
    _, notes = hulls_of(path, other)
    assert "is it the same body?" in notes[0]


def broken(path: Path, change: str) -> Path:
    """A file with one thing wrong."""
    write_glb(path, stick_rig(), embed=False)
    gltf = json.loads(path.read_text())
    if change == "no skin":
        del gltf["nodes"][-1]["skin"]
    elif change == "cycle":
        gltf["nodes"][5].setdefault("children", []).append(0)
    elif change == "outside":
        gltf["accessors"][0]["count"] = 10**6
    elif change == "draco":
        gltf["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    elif change == "joint":
        gltf["skins"][0]["joints"][0] = 999
    elif change == "sparse":
        gltf["accessors"][0]["sparse"] = {}
    elif change == "no buffer":
        (path.parent / "the data.bin").unlink()
    elif change == "list":
        gltf = [gltf]
    path.write_text(json.dumps(gltf)[: -20 if change == "truncated" else None])
    return path


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("no skin", "has no skinned mesh"),
        ("cycle", "their own ancestors"),
        ("outside", "outside its buffer"),
        ("draco", "is compressed"),
        ("joint", "none of its 19 nodes"),
        ("sparse", "no valid glTF"),
        ("no buffer", "no such file"),
        ("list", "no valid glTF"),
        ("truncated", "no valid glTF"),
    ],
)
def test_broken_files_are_errors(change: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=says):
        read_skinned_mesh(broken(tmp_path / "body.gltf", change))


@pytest.mark.parametrize("length", [0, 3, 4, 11, 15, 100, 4000])
def test_truncated_binaries_are_errors(length: int, tmp_path: Path) -> None:
    path = write_glb(tmp_path / "body.glb", stick_rig())
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(FileFormatError):
        read_skinned_mesh(path)


def test_flipped_bytes_are_errors_or_meshes(tmp_path: Path) -> None:
    path = write_glb(tmp_path / "body.glb", stick_rig())
    content = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(150):
        damaged = bytearray(content)
        for at in rng.integers(0, 6000, 3):
            damaged[at] = rng.integers(256)
        path.write_bytes(bytes(damaged))
        try:
            mesh = read_skinned_mesh(path)
        except FileFormatError:
            refused += 1
        else:
            assert np.isfinite(mesh.vertices).all()
    assert refused > 10


def test_without_trimesh_the_package_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_glb(tmp_path / "body.glb", stick_rig())
    monkeypatch.setitem(sys.modules, "trimesh.convex", None)
    with pytest.raises(DependencyError, match=r"spark-sim\[mesh\]"):
        hulls_of(path, stick_rig())
