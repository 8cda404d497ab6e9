"""Skins in pictures and on the page: the vertices are where linear blending has them."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import spark_sim
from sim.report import assess
from sim.view.figure import Figure
from sim.view.page import page
from sim.view.page_skin import smooth_normals
from sim.view.render import stills
from sim.view.scene import Scene
from sim.view.simplify import simplify_skin
from sim.view.skin import FRAME_GROUP
from sim.view.staging import build_scene
from spark.kinematics import forward
from spark.skin import Skin, skinned
from spark_sim.clips import Clip
from tests.helpers.browser import opened, with_probe
from tests.helpers.skins import write_character


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    folder = tmp_path_factory.mktemp("samples")
    spark_sim.sample(folder)
    walk = spark_sim.load(folder / "walker_walk.bvh")
    write_character(walk.part(0.0, 1.0).motion, folder / "tubes.glb")
    worn = spark_sim.load(folder / "tubes.glb")
    assert isinstance(worn, Clip)
    return worn


def skin_of(clip: Clip) -> Skin:
    skin, _ = clip.surface
    assert skin is not None
    return skin


def drawn(scene: Scene, frame: int) -> np.ndarray:
    """Where MuJoCo has the vertices of the scene's skins."""
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.qpos[frame]
    mujoco.mj_kinematics(scene.model, data)
    seen = mujoco.MjvScene(scene.model, maxgeom=1000)
    every = int(mujoco.mjtCatBit.mjCAT_ALL)
    option, camera = mujoco.MjvOption(), mujoco.MjvCamera()
    mujoco.mjv_updateScene(scene.model, data, option, None, camera, every, seen)
    return np.array(seen.skinvert).reshape(-1, 3)


def expected(scene: Scene, skin: Skin, clip: Clip, frame: int, scale: float = 1.0) -> np.ndarray:
    """Where they are by the clip's own motion, material by material as the scene has them."""
    motion = clip.motion
    at = skinned(skin, motion.skeleton, *forward(motion))[frame]
    at = scene.placements[0].to_scene(at)
    parts = (skin.faces[skin.material_of == m] for m in range(len(skin.materials)))
    return np.concatenate([at[np.unique(part)] for part in parts])


@pytest.mark.parametrize("height", [None, 3.2])
def test_mujoco_has_the_vertices_where_blending_has_them(clip: Clip, height: float | None) -> None:
    skin = skin_of(clip)
    scene = build_scene([replace(clip.figures()[0], height=height)])
    for frame in (0, 17, 30):
        found = drawn(scene, frame)
        np.testing.assert_allclose(found, expected(scene, skin, clip, frame), atol=2e-4)


def test_bones_that_scale_are_bound_in_the_tpose(clip: Clip) -> None:
    """MuJoCo's bones are rigid: a mesh that its bones make twice as large is as large all the
    same."""
    skin = skin_of(clip)
    bind = skin.inverse_bind.copy()
    bind[:, :, :3] *= 2.0
    half = replace(skin, vertices=skin.vertices / 2, inverse_bind=bind)
    scene = build_scene([replace(clip.figures()[0], skin=half)])
    plain = build_scene([clip.figures()[0]])
    for frame in (0, 17):
        np.testing.assert_allclose(drawn(scene, frame), drawn(plain, frame), atol=2e-3)


def test_what_hangs_on_a_body_is_in_its_box(clip: Clip) -> None:
    scene = build_scene(clip.figures())
    model = scene.model
    assert set(model.geom_group[1:].tolist()) == {FRAME_GROUP}  # the first is the floor
    data = mujoco.MjData(model)
    data.qpos[:] = scene.qpos[10]
    mujoco.mj_kinematics(model, data)
    at = drawn(scene, 10)
    inside = np.zeros(len(at), dtype=bool)
    for g in range(1, model.ngeom):
        local = (at - data.geom_xpos[g]) @ data.geom_xmat[g].reshape(3, 3)
        inside |= (np.abs(local) <= model.geom_size[g] + 0.02).all(axis=1)
    assert inside.all()


def test_pictures_show_the_materials(clip: Clip) -> None:
    (picture,) = stills(build_scene(clip.figures()), [5], height=300)
    r, g, b = np.moveaxis(picture.astype(int), -1, 0)
    for name, mask in (
        ("red", (r > 1.6 * g) & (r > 1.6 * b)),
        ("blue", (b > 1.6 * r) & (b > 1.6 * g)),
        ("green", (g > 1.4 * r) & (g > 1.4 * b)),
    ):
        assert mask.sum() > 200, name


def test_a_ghost_wears_none(clip: Clip) -> None:
    (figure,) = clip.figures()
    scene = build_scene([figure, replace(figure, ghost=True)])
    assert [placement.skin is None for placement in scene.placements] == [False, True]


def test_the_report_is_that_of_the_motion(clip: Clip) -> None:
    (figure,) = clip.figures()
    assert figure.skin is not None
    bare = Clip(clip.recording, clip.name, given_rig=clip.rig)
    assert assess(figure.subject).json() == assess(bare.subject).json()


def test_a_dense_skin_is_thinned_but_keeps_its_shape(clip: Clip) -> None:
    skin = skin_of(clip)
    fewer = simplify_skin(skin, 1800)
    assert 800 < len(fewer.faces) <= 1800
    np.testing.assert_allclose(fewer.weights.sum(1), 1)
    motion = clip.motion
    poses = forward(motion)
    whole, thin = (skinned(s, motion.skeleton, *poses)[12] for s in (skin, fewer))
    apart = np.linalg.norm(thin[:, None] - whole[None], axis=-1).min(axis=1)
    assert apart.max() < 1e-9, "each of its vertices is one of the whole"
    far = np.linalg.norm(thin[None] - whole[:, None], axis=-1).min(axis=1)
    assert far.max() < 0.12
    for m in (0, 1):
        own = np.unique(fewer.faces[fewer.material_of == m])
        assert len(own) > 50


def test_thinning_opens_no_seam(clip: Clip) -> None:
    """The corners of a closed surface that a picture cuts into patches meet as before."""
    skin = skin_of(clip)
    for _ in range(2):
        skin = divided(skin)
    rng = np.random.default_rng(0)
    corners = skin.faces.ravel()
    cut = replace(  # every face for itself, each with another part of the picture
        skin,
        vertices=skin.vertices[corners],
        bones_of=skin.bones_of[corners],
        weights=skin.weights[corners],
        uv=np.repeat(rng.uniform(size=(len(skin.faces), 2)), 3, axis=0),
        faces=np.arange(len(corners)).reshape(-1, 3),
    )
    fewer = simplify_skin(cut, 5000)
    assert len(fewer.faces) <= 5000

    def borders(mesh: Skin) -> int:
        _, place = np.unique(np.round(mesh.vertices, 6), axis=0, return_inverse=True)
        at = place.ravel()[mesh.faces]
        edges = np.sort(np.concatenate([at[:, [0, 1]], at[:, [1, 2]], at[:, [2, 0]]]), axis=1)
        return int((np.unique(edges, axis=0, return_counts=True)[1] == 1).sum())

    assert borders(fewer) <= borders(cut)


def test_normals_are_smooth_over_the_seam_of_a_picture() -> None:
    # A roof of two faces; its ridge is in the file twice, once for each side's picture.
    vertices = np.array([[0, 0, 1], [1, 0, 1], [0, -1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 0.0]])
    normals = smooth_normals(vertices, np.array([[0, 2, 1], [3, 4, 5]]))
    np.testing.assert_allclose(normals[[0, 1, 3, 4]], np.tile([0, 0, 1.0], (4, 1)), atol=1e-12)


PROBE = """
  const seen = []; onerror = console.error = console.warn = m => seen.push(String(m));
  requestAnimationFrame = () => 0;
  setTimeout(() => {
    play(false); view.time = 0.5; draw();
    const d = ctx.getImageData(0, 0, canvas.width, canvas.height).data, count = [0, 0, 0];
    for (let i = 0; i < d.length; i += 4) for (let k = 0; k < 3; k++)
      if ([0, 1, 2].every(n => n === k || d[i + k] > 1.5 * d[i + n])) count[k]++;
    const rows = [...DATA.figures[0].skin.rows];
    document.body.dataset.result = JSON.stringify({ seen, count, rows, error: gl.getError() });
  }, 400);"""


def test_the_page_moves_the_bones_and_draws_the_materials(clip: Clip, tmp_path: Path) -> None:
    text = page(clip.figures(), title="skin")
    result = opened(with_probe(text, PROBE), tmp_path)
    assert (result["seen"], result["error"]) == ([], 0)
    assert min(result["count"]) > 200, "red, green and blue"
    scene = build_scene(clip.figures(), max_fps=30.0)
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.qpos[15]
    mujoco.mj_kinematics(scene.model, data)
    worn = scene.placements[0].skin
    assert worn is not None
    rows = np.array(result["rows"]).reshape(-1, 3, 4)
    bodies = [int(scene.model.body(name).id) for name in worn.bodies]
    turned = data.xmat[bodies].reshape(-1, 3, 3)
    maps = turned @ worn.skin.inverse_bind
    maps[:, :, 3] += data.xpos[bodies]
    np.testing.assert_allclose(rows, maps, atol=2e-3)


def test_a_page_with_a_dense_skin_is_bounded(clip: Clip) -> None:
    skin = skin_of(clip)
    for _ in range(3):  # each face as four
        skin = divided(skin)
    assert len(skin.faces) > 100_000
    text = page([replace(clip.figures()[0], skin=skin)], title="dense")
    assert len(text) < 2_500_000


def divided(skin: Skin) -> Skin:
    """Each face as four, about its own middle points."""
    a, b, c = skin.faces.T
    at = {"vertices": skin.vertices, "uv": skin.uv, "weights": skin.weights}
    middle = {
        name: np.concatenate([(values[i] + values[j]) / 2 for i, j in ((a, b), (b, c), (c, a))])
        for name, values in at.items()
    }
    count, faces = len(skin.vertices), len(skin.faces)
    ab, bc, ca = (count + k * faces + np.arange(faces) for k in range(3))
    return replace(
        skin,
        **{name: np.concatenate([at[name], middle[name]]) for name in at},
        bones_of=np.concatenate([skin.bones_of, skin.bones_of[np.concatenate([a, b, c])]]),
        faces=np.concatenate(
            [np.stack(each, 1) for each in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
        ),
        material_of=np.tile(skin.material_of, 4),
    )


def test_a_figure_without_a_skin_has_none(tmp_path: Path) -> None:
    spark_sim.sample(tmp_path)
    (figure,) = spark_sim.load(tmp_path / "dancer_walk.bvh").figures()
    assert isinstance(figure, Figure)
    assert figure.skin is None
