"""Scenes, pictures, videos and the page: what a person looks at."""

import json
import os
import re
import threading
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import spark_sim
from sim.interpolate import at_times
from sim.trajectory import ModelTrajectory, Subject
from sim.view.camera import extents, shot
from sim.view.display import lit
from sim.view.figure import Figure
from sim.view.page import page, write_page
from sim.view.painter import Painter
from sim.view.render import frames, stills
from sim.view.scene import Scene
from sim.view.simplify import area, simplify_together
from sim.view.staging import build_scene, thinned
from sim.view.video import write_animation, write_strip, write_video
from spark.demo.sample import sample_motion, sample_rig
from spark.errors import ConventionError, DependencyError, OutputError
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_mul, quat_rotate
from tests.helpers.browser import opened, with_probe


def figures() -> list[Figure]:
    made = []
    for build, fps in (("walker", 30.0), ("dancer", 60.0)):
        rig = sample_rig(build)
        made.append(Figure(Subject(sample_motion("wave", rig, fps), rig), build))
    return made


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(figures())


def draw(scene: Scene, picked: list[int]) -> list[np.ndarray]:
    try:
        return [picture.copy() for picture in frames(scene, picked, width=320, height=240)]
    except DependencyError as error:
        if "CI" in os.environ:
            raise
        pytest.skip(f"no OpenGL: {error}")


def test_figures_share_time_and_stand_apart(scene: Scene) -> None:
    assert scene.frame_time == pytest.approx(1 / 30)
    assert len(scene.qpos) == 121
    heads = [i for i in range(scene.model.njnt) if scene.model.jnt_type[i] == 0]
    first, second = (scene.qpos[:, scene.model.jnt_qposadr[i] + 1] for i in heads)
    assert (second - first).min() > 1.0


def test_fast_clips_are_thinned_not_slowed() -> None:
    rig = sample_rig("walker")
    scene = build_scene([Figure(Subject(sample_motion("wave", rig, 240.0), rig), "fast")])
    assert scene.frame_time == pytest.approx(1 / 60)
    assert len(scene.qpos) == 241


def test_pictures_show_two_bodies_that_move(scene: Scene) -> None:
    rest, raised = draw(scene, [0, 60])
    limbs = np.ptp(rest.astype(int), axis=-1) > 60  # limbs are orange and blue, the rest is grey
    assert 0.01 < limbs.mean() < 0.6
    columns = np.flatnonzero(limbs.any(0))
    assert np.diff(columns).max() > 3, "a gap between the two"
    assert np.abs(raised.astype(int) - rest).max() > 60


def test_pictures_drawn_at_once_come_in_order(scene: Scene) -> None:
    """Each is what a painter alone draws, and who stops listening leaves nothing running."""
    picked = [0, 60, 30, 90, 60, 10, 0]
    together = draw(scene, picked)
    threads = threading.active_count()
    with Painter(scene, 320, 240, (12, 6)) as painter:
        seen = shot(scene, aspect=320 / 240)
        for frame, picture in zip(picked, together, strict=True):
            np.testing.assert_array_equal(picture, painter.frame(frame, seen))
    some = frames(scene, iter(range(100)), width=320, height=240)
    np.testing.assert_array_equal(next(iter(some)), together[0])
    some.close()
    assert threading.active_count() <= threads


def test_video_and_strip(scene: Scene, tmp_path: Path) -> None:
    draw(scene, [0])
    short = replace(scene, qpos=scene.qpos[:8])
    write_video(short, tmp_path / "out.mp4", width=160, height=120)
    assert (tmp_path / "out.mp4").read_bytes()[4:8] == b"ftyp"
    write_strip(short, tmp_path / "out.png", count=3, width=80, height=90)
    from PIL import Image

    with Image.open(tmp_path / "out.png") as picture:
        assert picture.size == (240, 90)
    with pytest.raises(OutputError):
        write_video(short, tmp_path / "nowhere" / "out.mp4", width=160, height=120)


def test_page_is_one_file_and_small(tmp_path: Path) -> None:
    path = tmp_path / "out.html"
    write_page(figures(), path, title="a & b </script>")
    text = path.read_text()
    assert len(text) < 2_000_000
    assert not re.search(r"(src|href)\s*=\s*[\"']?(https?:)?//", text)
    assert "a &amp; b &lt;/script&gt;" in text
    data = json.loads(re.search(r'type="application/json">(.*?)</script>', text)[1])
    assert [f["label"] for f in data["figures"]] == ["walker", "dancer"]


PROBE = """
  const seen = []; onerror = console.error = console.warn = m => seen.push(String(m));
  requestAnimationFrame = () => 0; // frames are drawn when asked for, not as time goes by
  setTimeout(() => {
    const look = time => { play(false); view.time = time; draw(); let sum = 0, ink = 0;
      const d = ctx.getImageData(0, 0, canvas.width, canvas.height).data;
      for (let i = 0; i < d.length; i += 4) {
        sum = (sum * 31 + d[i]) % 1000003; if (Math.abs(d[i] - d[i + 2]) > 60) ink++; }
      return { sum, ink, bodies: DATA.figures.map(f => poses(f).map(b => [...b.p, ...b.q])) }; };
    const looks = TIMES.map(look);
    play(true); tick(1000); view.time = 0; tick(1500);
    document.body.dataset.result = JSON.stringify({ seen, looks, time: view.time });
  }, 100);"""


def test_page_moves_in_a_browser(tmp_path: Path) -> None:
    """Headless Chromium draws it without an error; it has our colours, and another moment looks
    different; the page's kinematics are MuJoCo's."""
    robot, motion, body = machine(tmp_path)
    shown = [*figures(), Figure(Subject(motion, robot, body), "machine")]
    probe = PROBE.replace("TIMES", "[0.0, 2.0]")
    result = opened(with_probe(page(shown, title="test"), probe), tmp_path)
    assert result["seen"] == []
    assert result["time"] == pytest.approx(0.5), "it plays"
    first, second = result["looks"]
    assert first["sum"] != second["sum"]
    assert first["ink"] > 1000, "limbs are orange and blue"
    scene = build_scene(shown, max_fps=30.0)
    data = mujoco.MjData(scene.model)
    for look, time in ((first, 0.0), (second, 2.0)):
        data.qpos[:] = scene.qpos[round(time / scene.frame_time)]
        mujoco.mj_kinematics(scene.model, data)
        poses = np.concatenate([np.array(bodies) for bodies in look["bodies"]])
        np.testing.assert_allclose(poses[:, :3], data.xpos[1:], atol=2e-3)
        agree = np.abs((poses[:, 3:] * data.xquat[1:]).sum(1))
        np.testing.assert_allclose(agree, 1, atol=1e-5)


MACHINE = """
<mujoco>
  <compiler meshdir="{folder}" angle="degree"/>
  <option gravity="0 0 -3"/>
  <default><geom rgba="1 0 0 1"/><default class="seen"><geom contype="0" conaffinity="0"/></default>
  </default>
  <asset><mesh name="block" file="block.obj"/><material name="blue" rgba="0.1 0.2 0.9 1"/></asset>
  <worldbody>
    <light name="theirs" pos="0 0 3"/>
    <geom name="their_floor" type="plane" size="1 1 1"/>
    <body name="table" pos="2 0 0"><freejoint/><geom size="0.2"/></body>
    <body name="base" pos="0 0 0.9">
      <freejoint name="free"/>
      <geom class="seen" type="mesh" mesh="block" material="blue" rgba="0.5 0.5 0.5 1"
        pos="0.1 0 0" euler="0 30 0"/>
      <geom name="hidden" group="3" type="box" size="0.3 0.3 0.3"/>
      <body name="slider" pos="0 0.2 0.3" euler="0 0 40">
        <joint type="slide" name="lift" axis="0 0 1" ref="0.1"/>
        <geom class="seen" type="cylinder" size="0.05 0.2"/>
        <body name="arm" pos="0 0 0.4">
          <joint name="a" axis="0 1 0" pos="0.05 0 0" ref="20"/>
          <joint name="b" axis="1 0 1" pos="0 0.1 0"/>
          <geom class="seen" type="ellipsoid" size="0.1 0.05 0.2" pos="0 0 0.2"/>
          <body name="ball" pos="0 0 0.4">
            <joint type="ball" name="c" pos="0 0 0.02"/>
            <geom class="seen" type="sphere" size="0.07"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="a"/></actuator>
  <sensor><jointpos joint="a"/></sensor>
  <equality><joint joint1="a" joint2="b"/></equality>
  <keyframe><key name="theirs"/></keyframe>
</mujoco>"""
FACES = ((1, 3, 2), (1, 2, 4), (1, 4, 3), (2, 3, 4))


def machine(folder: Path) -> tuple[Rig, Motion, ModelTrajectory]:
    """A model with every kind of joint, off its zero; its motion lends the time alone."""
    corners = ((0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.5))
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in FACES]
    (folder / "block.obj").write_text("\n".join(lines))
    spec = mujoco.MjSpec.from_string(MACHINE.format(folder=folder))
    model = spec.compile()
    rig = sample_rig("walker")
    motion = sample_motion("wave", rig, 30.0)
    qpos = np.tile(model.qpos0, (len(motion), 1))
    turn = np.linspace(0, 3, len(motion))
    qpos[:, 7:10] += np.stack([turn, 0.3 * turn, 0.2 * np.sin(turn)], -1)
    qpos[:, 14] += 0.1 * turn
    qpos[:, 15:17] += np.stack([turn, -turn], -1)
    qpos[:, 17], qpos[:, 19] = np.cos(turn), np.sin(turn)
    return rig, motion, ModelTrajectory(spec, model, int(model.body("base").id), qpos)


def test_a_given_model_is_shown_and_nothing_else_of_its_file(tmp_path: Path) -> None:
    rig, motion, body = machine(tmp_path)
    scene = build_scene([Figure(Subject(motion, rig, body), "machine")])
    model, own = scene.model, body.model
    assert (model.nu, model.nsensor, model.neq, model.nkey) == (0, 0, 0, 0)
    assert (model.nlight, model.ngeom, model.nbody) == (2, 5, 5)
    assert model.nq == own.nq - 7, "the table is not the robot's"
    np.testing.assert_allclose(model.geom_rgba[1], [0.1, 0.2, 0.9, 1], err_msg="its material's")
    np.testing.assert_allclose(model.geom_rgba[2], [1, 0, 0, 1], err_msg="its class's")
    # Every shape is where the model itself has it, after the figure was placed.
    ours, theirs = mujoco.MjData(model), mujoco.MjData(own)
    seen = [g for g in range(own.ngeom) if own.geom_bodyid[g] > 1 and own.geom_group[g] < 3]
    for t in (0, 40, len(motion) - 1):
        ours.qpos[:], theirs.qpos[:] = scene.qpos[t], body.qpos[t]
        mujoco.mj_kinematics(model, ours)
        mujoco.mj_kinematics(own, theirs)
        placed = scene.placements[0].to_scene(theirs.geom_xpos[seen[1:]])
        np.testing.assert_allclose(ours.geom_xpos[2:], placed, atol=1e-6)
        # A mesh's frame is its own affair; its corners are not.
        block = scene.placements[0].to_scene(corners_of(own, theirs, seen[0]))
        apart = np.linalg.norm(corners_of(model, ours, 1)[:, None] - block, axis=-1)
        np.testing.assert_allclose(apart.min(1), 0, atol=1e-6)


def corners_of(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """The vertices of a geom's mesh in the world."""
    start = int(model.mesh_vertadr[model.geom_dataid[geom]])
    count = int(model.mesh_vertnum[model.geom_dataid[geom]])
    vertices = model.mesh_vert[start : start + count]
    return vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def test_a_ghost_stands_where_its_figure_stands() -> None:
    first, second = figures()
    ghost = replace(first, ghost=True)
    scene = build_scene([first, ghost, second])
    here, there = (scene.path(scene.placements[k]) for k in (0, 1))
    np.testing.assert_allclose(here, there)
    alphas = [{float(a) for a in scene.model.geom_rgba[g, 3]} for g in shapes_of(scene)]
    assert [max(a) < 0.5 for a in alphas] == [False, True, False]


def shapes_of(scene: Scene) -> list[list[int]]:
    """The shapes of each figure."""
    owners = scene.model.geom_bodyid
    return [
        [g for g, b in enumerate(owners) if b in placement.bodies] for placement in scene.placements
    ]


def test_all_face_the_camera_and_stay_in_its_picture() -> None:
    """A motion that walks off sideways is turned to face +X, and is seen whole at all times."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0)
    turn = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_mul(turn, rotations[:, 0])
    aside = replace(motion, rotations=rotations, root_pos=quat_rotate(turn, motion.root_pos))
    for figure in (Figure(Subject(motion, rig), "ahead"), Figure(Subject(aside, rig), "aside")):
        path = build_scene([figure]).path(build_scene([figure]).placements[0])
        gone = path[-1] - path[0]
        assert gone[0] > 1.0
        assert abs(gone[1]) < 0.1 * gone[0]
    scene = build_scene(
        [Figure(Subject(motion, rig), "walks"), Figure(Subject(motion.frames(0, 2), rig), "stays")]
    )
    for picture in draw(scene, [0, len(scene.qpos) - 1]):
        limbs = np.ptp(picture.astype(int), axis=-1) > 60
        edge = np.concatenate([limbs[0], limbs[-1], limbs[:, 0], limbs[:, -1]])
        assert limbs.any()
        assert not edge.any()


def test_large_meshes_are_thinned_but_keep_their_shape() -> None:
    turn, rise = np.meshgrid(np.linspace(0, 2 * np.pi, 401)[:-1], np.linspace(-1.5, 1.5, 201))
    ball = np.stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)], -1)
    k = np.arange(200 * 400)
    right = k - k % 400 + (k + 1) % 400
    faces = np.concatenate(
        [np.stack([k, right, right + 400], -1), np.stack([k, right + 400, k + 400], -1)]
    )
    vertices = ball.reshape(-1, 3)
    mesh = (vertices, faces)
    assert simplify_together({7: mesh}, len(faces)) == {7: mesh}, "small enough as it is"
    fewer, kept = simplify_together({7: mesh}, 8000)[7]
    assert 3000 < len(kept) <= 8000
    np.testing.assert_allclose(np.linalg.norm(fewer, axis=1), 1, atol=0.01)
    assert area(fewer, kept) == pytest.approx(area(vertices, faces), rel=0.03)
    a, b, c = (fewer[kept[:, k]] for k in range(3))
    assert ((np.cross(b - a, c - a) * (a + b + c)).sum(1) > 0).mean() > 0.99, "faces look outwards"


def test_coordinates_between_frames(tmp_path: Path) -> None:
    _, _, body = machine(tmp_path)
    frames = body.qpos[[0, 60]]
    halfway = at_times(body.model, frames, 1.0, np.array([0.0, 0.5, 1.0, 7.0]))
    np.testing.assert_array_equal(halfway[[0, 2, 3]], frames[[0, 1, 1]])
    np.testing.assert_allclose(halfway[1, 7:10], frames[:, 7:10].mean(0))
    np.testing.assert_allclose(halfway[1, 15:17], frames[:, 15:17].mean(0))
    np.testing.assert_allclose(halfway[1, 17:], [np.cos(0.75), 0, np.sin(0.75), 0], atol=1e-12)


def test_scenes_of_long_motions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made a few frames at a time they are the same to the bit: at other rates, with models of
    their own and without, and beyond the end of the shorter ones."""
    rig, motion, body = machine(tmp_path)
    walker = sample_rig("walker")
    shown = [
        Figure(Subject(sample_motion("walk", walker, fps), walker), f"{fps:g}")
        for fps in (120.0, 30.0, 47.0)
    ]
    shown.append(Figure(Subject(motion, rig, body), "machine"))
    whole = build_scene(shown)
    monkeypatch.setattr("spark.blocks.BLOCK", 7)
    np.testing.assert_array_equal(build_scene(shown).qpos, whole.qpos)


@pytest.mark.parametrize("option", ["html", "video", "strip"])
def test_a_motion_is_not_overwritten_by_what_shows_it(option: str, tmp_path: Path) -> None:
    (walk, *_) = spark_sim.sample(tmp_path)
    before = walk.read_bytes()
    with pytest.raises(OutputError, match=r"is written as \.(html|mp4|png)"):
        spark_sim.play(walk, force=True, **{option: walk})
    with pytest.raises(OutputError, match=r"a page is written as \.html"):
        spark_sim.report(walk, html=walk, force=True)
    with pytest.raises(OutputError, match=r"a MuJoCo model is written as \.xml"):
        spark_sim.load(walk).save_mjcf(walk, force=True)
    assert walk.read_bytes() == before


def test_stills_are_framed_on_the_figures() -> None:
    """The figures reach over most of each still, and no part of them is cut off."""
    scene = build_scene(figures())
    frames = [0, len(scene.qpos) // 2, len(scene.qpos) - 1]
    pictures, heights = stills(scene, frames, height=240), []
    for picture in pictures:
        limbs = np.ptp(picture.astype(int), axis=-1) > 60
        rows, columns = (np.flatnonzero(limbs.any(axis=axis)) for axis in (1, 0))
        assert 0 < rows[0] < rows[-1] < 239
        heights.append(rows[-1] - rows[0])
        assert 0 < columns[0] < columns[-1] < picture.shape[1] - 1
    assert max(heights) > 0.6 * 240


def test_a_line_parts_figures_that_overlap() -> None:
    first, _ = figures()
    behind = replace(first, floor_z=first.floor_z + 0.1, ghost=False)
    scene = build_scene([first, behind])
    scene.qpos[:, scene.placements[1].columns][:, 1] = scene.qpos[:, 1] + 0.05
    white = [(p == 255).all(-1).sum() for p in stills(scene, [0], height=240)]
    alone = [(p == 255).all(-1).sum() for p in stills(build_scene([first]), [0], height=240)]
    assert white[0] > alone[0] + 40


def test_at_the_same_height_they_stand_as_tall() -> None:
    small = replace(figures()[0], height=1.0)
    tall = replace(figures()[1], height=2.0)
    scene = build_scene([small, tall])
    bounds = extents(scene, [0])[0]
    owners = scene.model.geom_bodyid
    up = []
    for placement in scene.placements:
        own = np.flatnonzero(np.isin(owners[owners > 0], placement.bodies))
        up.append(np.ptp(bounds[own, 1]))
    assert up[1] / up[0] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("ending", ["gif", "webp"])
def test_animated_pictures_last_as_long_as_the_motion(tmp_path: Path, ending: str) -> None:
    image = pytest.importorskip("PIL.Image")
    scene = build_scene(figures())
    out = tmp_path / f"a.{ending}"
    write_animation(scene, out, height=80)
    with image.open(out) as opened:
        total = 0
        for frame in range(opened.n_frames):
            opened.seek(frame)
            opened.load()
            total += opened.info["duration"]
        assert opened.n_frames > 10
        assert opened.info.get("loop") == 0
    duration = (len(scene.qpos) - 1) * scene.frame_time
    assert abs(total / 1000 - duration) < 0.15


@pytest.mark.parametrize("ending", ["gif", "webp"])
def test_an_animation_is_whole_or_not_there(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("PIL.Image")

    def full(path: Path, flags: int) -> None:
        raise OSError(28, "No space left on device")

    scene = build_scene(figures())
    out = tmp_path / f"a.{ending}"
    out.write_text("mine")
    monkeypatch.setattr("spark.files._to_disk", full)
    with pytest.raises(OutputError, match="No space left"):
        write_animation(scene, out, height=40)
    assert out.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [out]


def test_slow_motion_has_frames_between_those_of_the_motion(tmp_path: Path) -> None:
    """At a quarter of the speed a video takes four times as long, at no fewer frames a second."""
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    (walk, *_) = spark_sim.sample(tmp_path)
    short = tmp_path / "short.bvh"
    spark_sim.load(walk).part(0.0, 0.4).save(short)
    draw(build_scene(figures()), [0])
    seconds, rates = {}, {}
    for speed in (1.0, 0.25, 4.0):
        out = tmp_path / f"{speed}.mp4"
        spark_sim.play(short, video=out, speed=speed)
        found = next(imageio_ffmpeg.read_frames(str(out)))
        seconds[speed], rates[speed] = found["duration"], found["fps"]
    assert seconds[0.25] == pytest.approx(4 * seconds[1.0], rel=0.1)
    assert seconds[4.0] == pytest.approx(seconds[1.0] / 4, rel=0.3)
    assert rates[0.25] >= 24
    with pytest.raises(ConventionError, match=r"speed 3: expected one of 0\.1, 0\.25"):
        spark_sim.play(walk, video=tmp_path / "three.mp4", speed=3.0)


def test_blended_frames_lie_on_the_way() -> None:
    own = build_scene(figures()[:1])
    fine = build_scene(figures()[:1], max_fps=120.0, blend=True)
    assert fine.frame_time == pytest.approx(own.frame_time / 4)
    np.testing.assert_allclose(fine.qpos[::4], own.qpos, atol=1e-12)
    np.testing.assert_allclose(fine.qpos[2::4, :3], (own.qpos[1:] + own.qpos[:-1])[:, :3] / 2)


@pytest.mark.parametrize(
    ("frame_time", "most", "step"),
    [
        *(("0.016666", 60.0, 1), ("0.016667", 30.0, 2), ("0.016666", 30.0, 2)),
        *(("0.008333", 30.0, 4), ("0.004166", 30.0, 8)),
        *(("0.04", 30.0, 1), ("0.02", 30.0, 2), ("0.01", 60.0, 2)),
    ],
)
def test_a_rounded_frame_time_costs_no_frames(frame_time: str, most: float, step: int) -> None:
    """A BVH has six digits: 60 frames a second are 59.9988, or 60.0024."""
    fps = 1 / float(frame_time)
    assert thinned(fps, most) == step
    rig = sample_rig("walker")
    figure = Figure(Subject(sample_motion("wave", rig, fps), rig), "walker")
    scene = build_scene([figure], max_fps=most)
    assert scene.frame_time == pytest.approx(step * float(frame_time))
    fine = build_scene([figure], max_fps=120.0, blend=True)
    assert 1 / fine.frame_time == pytest.approx(120, rel=0.2)


def test_dark_colours_are_lifted_and_others_stay() -> None:
    black, blue = lit(np.array([0.0, 0, 0, 1])), np.array([0.6, 0.7, 0.9, 0.5])
    assert 0.3 < black[:3].min() < 0.5
    np.testing.assert_allclose(lit(blue), blue)
    grey = [float(lit(np.array([v, v, v, 1.0]))[0]) for v in np.linspace(0, 1, 20)]
    assert grey == sorted(grey)
