"""Skins of FBX files: against ufbx's nodes and answers worked by hand, and as GLB."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spark_sim
from spark.errors import FileFormatError
from spark.io.convention import Convention
from spark.io.fbx import read_fbx
from spark.io.fbx_scene import FbxScene
from spark.io.fbx_skin import read_fbx_skin
from spark.io.gltf_file import GltfFile
from spark.io.skins import read_skin
from spark.kinematics import forward
from spark.rotation import matrix_from_quat
from spark.skin import skinned
from spark_sim import Clip
from tests.helpers.fbx_arm import BOX, SIDES, arm, moved, placed, png, skin_of
from tests.helpers.fbx_text import Fbx, Mesh, Node, Surface, as_binary
from tests.helpers.recordings import recording

pytest.importorskip("pufbx")


def write(fbx: Fbx, path: Path, kind: str) -> Path:
    match kind:
        case "text":
            return fbx.write(path)
        case "7.4":
            path.write_bytes(as_binary(fbx.text()))
        case _:
            path.write_bytes(as_binary(fbx.text(), 7700))
    return path


@pytest.mark.parametrize("kind", ["text", "7.4", "7.7"])
def test_a_mesh_is_where_the_nodes_of_ufbx_carry_it(kind: str, tmp_path: Path) -> None:
    """Of a mesh that was bound in another pose than the nodes' rest, in all frames: the weighted
    mean of node(t) x Transform x vertex."""
    path = write(arm(), tmp_path / "arm.fbx", kind)
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    skin = skin_of(path)
    (mesh,) = skin.meshes
    assert set(mesh.joints) == {"Arm", "Fore"}
    np.testing.assert_allclose(mesh.weights.sum(axis=1), 1)

    scene = FbxScene(path)
    joints, _ = scene.joints()
    baked, times, _ = scene.animation(clip.frame_time)
    at, axes = scene.world(joints, baked, times)
    expected = np.zeros((len(times), len(BOX), 3))
    for node, transform, weights in arm().meshes[0].clusters:
        j = [joint.name for joint in joints].index(arm().nodes[node].name)
        inside = BOX @ transform[:3, :3].T + transform[:3, 3]
        there = at[:, j, None] + np.einsum("tij,vj->tvi", axes[:, j], inside)
        for point, weight in weights.items():
            expected[:, point] += weight * there[:, point]
    of = [int(np.argmin(np.abs(BOX - vertex).sum(axis=1))) for vertex in mesh.vertices]
    expected = clip.recording.convention.from_file(expected[:, of])
    np.testing.assert_allclose(placed(skin, mesh, clip), expected, atol=1e-6)


def test_the_first_frame_by_hand(tmp_path: Path) -> None:
    """The corner (5, 0, 5) hangs on the arm, which is turned by 30 degrees at (10, 90, 0)."""
    path = arm().write(tmp_path / "arm.fbx")
    clip = spark_sim.load(path, up="y", unit="cm")
    assert isinstance(clip, Clip)
    skin = skin_of(path)
    (mesh,) = skin.meshes
    corner = int(np.argmin(np.abs(mesh.vertices - [5, 0, -5]).sum(axis=1)))
    x, y, z = 10 + 5 * np.cos(np.pi / 6), 90 + 5 * np.sin(np.pi / 6), -5.0
    by_hand = np.array([z, x, y]) / 100
    np.testing.assert_allclose(placed(skin, mesh, clip)[0, corner], by_hand, atol=1e-6)


def test_polygons_are_cut_into_triangles_that_face_outward(tmp_path: Path) -> None:
    (mesh,) = skin_of(arm().write(tmp_path / "arm.fbx")).meshes
    assert len(mesh.faces) == 12
    corners = mesh.vertices[mesh.faces]
    middle = BOX.mean(axis=0)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.sum(across * (corners.mean(axis=1) - middle), axis=1) > 0).all()
    volume = np.sum(corners[:, 0] * across) / 6
    assert volume == pytest.approx(10 * 40 * 10)
    assert (np.sum(mesh.normals * (mesh.vertices - middle), axis=1) > 0).all()


def test_what_hangs_on_a_joint_without_clusters_is_rigid(tmp_path: Path) -> None:
    nodes = [
        Node("Hips", translation=(0, 90, 0)),
        Node("Head", 0, (0, 60, 0)),
        Node("eye", 1, (0, 5, 8), kind="Mesh", scale=(0.1, 0.1, 0.1)),
        Node("chair", -1, (100, 0, 0), kind="Mesh"),
    ]
    eye = Mesh(2, BOX, SIDES, geometric=(0, -20, 0))
    path = Fbx(nodes, meshes=[eye, Mesh(3, BOX, SIDES)]).write(tmp_path / "head.fbx")
    skin = skin_of(path)
    (mesh,) = skin.meshes
    assert mesh.joints == ("Head",)
    at = mesh.vertices @ mesh.to_rest[0, :3, :3].T + mesh.to_rest[0, :3, 3]
    np.testing.assert_allclose(at.min(axis=0), [-0.5, 153, 7.5], atol=1e-9)
    np.testing.assert_allclose(at.max(axis=0), [0.5, 157, 8.5], atol=1e-9)


@pytest.mark.parametrize("kind", ["text", "7.4", "7.7"])
def test_materials_have_their_colours_and_pictures(kind: str, tmp_path: Path) -> None:
    beside = png((10, 200, 10))
    (tmp_path / "green.png").write_bytes(beside)
    surfaces = [
        Surface("plain", (0.25, 0.5, 0.75)),
        Surface("inside", picture=png()),
        Surface("beside", beside="green.png"),
        Surface("gone", (0.1, 0.2, 0.3), beside="gone.tga"),
    ]
    path = write(arm(surfaces=surfaces, surface_of=[0, 1, 2, 3, 3, 0]), tmp_path / "arm.fbx", kind)
    (mesh,) = skin_of(path).meshes
    plain, inside, near, gone = mesh.materials
    assert (plain.name, plain.rgb, plain.picture) == ("plain", (0.25, 0.5, 0.75), None)
    assert (inside.picture, near.picture) == (png(), beside)
    assert (gone.picture, gone.missing, gone.rgb) == (None, "gone.tga", (0.1, 0.2, 0.3))
    np.testing.assert_array_equal(np.bincount(mesh.material_of), [4, 2, 2, 4])

    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    file = GltfFile(clip.save(tmp_path / "arm.glb"))
    entries = {entry["name"]: entry["pbrMetallicRoughness"] for entry in file.json["materials"]}
    # IEC 61966-2-1: 0.5 is 0.2140 of white's light.
    assert entries["plain"]["baseColorFactor"][1] == pytest.approx(0.2140, abs=1e-4)
    images = file.json["images"]
    assert [image["mimeType"] for image in images] == ["image/png"] * 2
    for name, content in (("inside", png()), ("beside", beside)):
        texture = file.json["textures"][entries[name]["baseColorTexture"]["index"]]
        view = file.json["bufferViews"][images[texture["source"]]["bufferView"]]
        start = view["byteOffset"]
        assert file.buffer(0)[start : start + view["byteLength"]] == content


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_glb_of_it_has_the_mesh_where_the_file_has_it(up: str, tmp_path: Path) -> None:
    """By glTF's own rule: the weighted mean of node x inverse bind matrix x vertex."""
    fbx = arm()
    fbx.axes = (0, 1, 2) if up == "y" else (1, 2, 0)
    path = fbx.write(tmp_path / "arm.fbx")
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    skin = skin_of(path)
    (mesh,) = skin.meshes
    expected = placed(skin, mesh, clip)[..., [1, 2, 0]]
    file = GltfFile(clip.save(tmp_path / "arm.glb"))
    (primitive,) = file.json["meshes"][0]["primitives"]
    at = {name: file.accessor(i) for name, i in primitive["attributes"].items()}
    (entry,) = file.json["skins"]
    inverse = file.accessor(entry["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
    world = worlds(file, len(clip))
    got = np.zeros(expected.shape)
    corners = np.column_stack([at["POSITION"], np.ones(len(at["POSITION"]))])
    for k in range(4):
        bones = at["JOINTS_0"][:, k].astype(int)
        maps = world[:, np.array(entry["joints"])[bones]] @ inverse[bones]
        got += at["WEIGHTS_0"][:, k, None] * np.einsum("tvij,vj->tvi", maps, corners)[..., :3]
    np.testing.assert_allclose(got, expected, atol=1e-5)


def worlds(file: GltfFile, frames: int) -> np.ndarray:
    """Each node's matrix in the world, in the frames that its tracks have."""
    local = np.tile(np.eye(4), (frames, len(file.nodes), 1, 1))
    animation = file.json["animations"][0]
    tracks = {
        (c["target"]["node"], c["target"]["path"]): file.accessor(
            animation["samplers"][c["sampler"]]["output"]
        )
        for c in animation["channels"]
    }
    for i, node in enumerate(file.nodes):
        turn = tracks.get((i, "rotation"), np.array([node.get("rotation", [0.0, 0, 0, 1])]))
        local[:, i, :3, :3] = matrix_from_quat(np.asarray(turn, float)[:, [3, 0, 1, 2]])
        local[:, i, :3, 3] = tracks.get((i, "translation"), node.get("translation", [0.0, 0, 0]))
    world = local.copy()
    parents = file.parents()
    for i, parent in enumerate(parents):  # parents come first in what we write
        if parent >= 0:
            world[:, i] = world[:, parent] @ local[:, i]
    return world


def test_two_meshes_that_were_bound_differently_share_a_joint(tmp_path: Path) -> None:
    """A skin of glTF names each node once: the second bone of a joint is a node below it."""
    fbx = arm()
    low = dict.fromkeys(range(8), 1.0)
    fbx.nodes.append(Node("sleeve", kind="Mesh"))
    fbx.meshes.append(Mesh(4, BOX, SIDES, [(1, moved(0, 0, 0), low)]))
    fbx.meshes[0].clusters = [
        *fbx.meshes[0].clusters,
        (1, moved(0, 3, 0, 15), {0: 0.2, 1: 0.1}),
    ]
    path = fbx.write(tmp_path / "arm.fbx")
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    file = GltfFile(clip.save(tmp_path / "arm.glb"))
    (entry,) = file.json["skins"]
    # The forearm once; the arm for the box, for its second cluster, and for the sleeve.
    assert len(set(entry["joints"])) == len(entry["joints"]) == 4
    assert len(file.json["meshes"]) == 2


def test_a_result_wears_the_skin_of_its_target(tmp_path: Path) -> None:
    path = arm().write(tmp_path / "arm.fbx")
    clip = spark_sim.load(path)
    bare = spark_sim.load(Fbx(arm().nodes[:3]).write(tmp_path / "bare.fbx"))
    assert isinstance(clip, Clip)
    assert isinstance(bare, Clip)
    assert "meshes" in GltfFile(clip.save(tmp_path / "a.glb")).json
    drawn = GltfFile(bare.save(tmp_path / "b.glb")).json
    assert "skins" not in drawn
    assert read_fbx_skin(tmp_path / "bare.fbx") is None


def test_points_beyond_any_length_are_refused(tmp_path: Path) -> None:
    far = BOX.copy()
    far[3, 1] = 1e200  # whose normals would overflow
    fbx = arm()
    fbx.meshes = [Mesh(3, far, SIDES)]
    with pytest.raises(FileFormatError, match=r"no numbers up to 1e\+12"):
        read_fbx_skin(fbx.write(tmp_path / "far.fbx"))


def test_a_cluster_with_a_point_that_the_mesh_lacks_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.fbx"
    path.write_text(arm().text().replace("Indexes: *4 { a: 0", "Indexes: *4 { a: 99"))
    with pytest.raises(FileFormatError, match="none of its mesh's 8"):
        read_fbx_skin(path)


_SEEDS = [arm(surfaces=[Surface(picture=png())]).text()]
_SEEDS_BINARY = [as_binary(_SEEDS[0]), as_binary(_SEEDS[0], 7700)]


@settings(max_examples=150, deadline=None)
@given(
    data=st.sampled_from(_SEEDS_BINARY),
    at=st.floats(0, 0.999),
    put=st.binary(max_size=6),
    cut=st.integers(0, 12),
)
def test_spoilt_bytes_end_in_an_error_or_in_numbers(
    data: bytes, at: float, put: bytes, cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "spoilt.fbx"
    place = int(at * len(data))
    path.write_bytes(data[:place] + put + data[place + cut :])
    try:
        skin = read_fbx_skin(path)
    except FileFormatError:
        return
    for mesh in () if skin is None else skin.meshes:
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.max(initial=0) < len(mesh.vertices)


def test_an_array_that_claims_more_than_it_has_uses_no_memory(tmp_path: Path) -> None:
    data = as_binary(arm().text())
    claimed = struct.pack("<III", 24, 1, 1 << 20)[:4]
    place = data.index(b"Vertices") + len("Vertices")
    assert data[place + 1 : place + 5] == claimed
    broken = data[: place + 1] + struct.pack("<I", 1 << 31) + data[place + 5 :]
    path = tmp_path / "bomb.fbx"
    path.write_bytes(broken)
    with pytest.raises(FileFormatError):
        read_fbx_skin(path)


def test_a_mixamo_character_has_its_skin_with_fingers() -> None:
    """It was bound in its rest pose, so all bones of a mesh have it in one place."""
    path = recording("mixamo/XBot/silly_dancing_115f.fbx")
    assert read_fbx(path).convention == Convention(0.01, "y")
    skin = skin_of(path)
    assert len(skin.meshes) == 2
    fingers = {j for mesh in skin.meshes for j in mesh.joints if "HandIndex" in j}
    assert len(fingers) >= 6
    for mesh in skin.meshes:
        same = np.broadcast_to(mesh.to_rest[0], mesh.to_rest.shape)
        np.testing.assert_allclose(mesh.to_rest, same, atol=1e-3)
    assert read_fbx_skin(recording("mixamo/Amy/hip_hop_dancing_101f.fbx")) is None


def test_what_pictures_show_is_what_the_file_has(tmp_path: Path) -> None:
    """The skin as one surface in metres, moved by its joints, with its picture."""
    path = arm(surfaces=[Surface(picture=png((200, 30, 30)))]).write(tmp_path / "arm.fbx")
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    skin, notes = read_skin(path, clip.recording.convention)
    assert skin is not None
    assert notes == ()
    moved = skinned(skin, clip.motion.skeleton, *forward(clip.motion))
    source = skin_of(path)
    expected = placed(source, source.meshes[0], clip)
    # The faces are the same, in the same order; vertices may be numbered anew.
    corners = source.meshes[0].faces
    np.testing.assert_allclose(moved[:, skin.faces], expected[:, corners], atol=1e-6)
    (material,) = skin.materials
    assert material.image is not None
    assert material.image[0, 0].tolist() == [200, 30, 30]
    # The front's corner at the box's top left shows the picture's top left.
    top = np.argmin(np.abs(source.meshes[0].vertices - [-5, 40, 5]).sum(axis=1))
    at = corners.ravel().tolist().index(int(top))
    np.testing.assert_allclose(skin.uv[skin.faces.ravel()[at]], [0, 0], atol=1e-6)
