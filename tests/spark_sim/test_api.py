"""The Python API: what the README shows, and its laws."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from scripts.corruptions import jittering
from spark.demo import gait
from spark.demo.sample import sample_rig
from spark.errors import ConventionError, DependencyError, OutputError, SkeletonError
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.kinematics import forward
from spark.rotation import quat_angle
from spark.transfer.canonical import from_canonical
from spark.transfer.leg_fit import travel_scale
from tests.helpers.fbx_text import Fbx, Node
from tests.helpers.twisting import plain, turning, with_bones


def test_import_is_light() -> None:
    code = (
        "import sys, spark_sim\n"
        "assert not {'numpy', 'mujoco', 'torch', 'spark_sim.clips'} & set(sys.modules)\n"
        "spark_sim.load\n"
        "assert 'numpy' in sys.modules and not {'mujoco', 'torch'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_names() -> None:
    for name in set(spark_sim.__all__) - {"AnyClip"}:
        assert getattr(spark_sim, name).__name__ == name
    assert spark_sim.AnyClip == spark_sim.Clip | spark_sim.RobotClip
    assert set(spark_sim.__all__) < set(dir(spark_sim))
    with pytest.raises(AttributeError, match="nonsense"):
        _ = spark_sim.nonsense


def test_a_saved_result_reads_back_as_the_same_motion(samples: Path, tmp_path: Path) -> None:
    out = spark_sim.retarget(samples / "walker_walk.bvh", samples / "dancer_wave.bvh")
    back = spark_sim.load(out.save(tmp_path / "deep" / "out.bvh"), unit="m", up="z")
    np.testing.assert_allclose(forward(back.motion)[0], forward(out.motion)[0], atol=1e-6)


def test_onto_its_own_body_a_motion_stays(samples: Path) -> None:
    walk = spark_sim.load(samples / "walker_walk.bvh")
    same = spark_sim.retarget(walk, walk, refine=False)
    np.testing.assert_allclose(forward(same.motion)[0], forward(walk.motion)[0], atol=1e-6)
    assert quat_angle(same.motion.rotations, walk.motion.rotations).max() < 1e-6
    held = spark_sim.retarget(walk, walk)
    # A foot that is held stands still; the source's own rolls by millimetres before it lifts.
    np.testing.assert_allclose(forward(held.motion)[0], forward(walk.motion)[0], atol=1e-2)


@pytest.mark.parametrize("ending", ["bvh", "fbx"])
def test_twist_bones_of_a_character_turn(ending: str, tmp_path: Path) -> None:
    """A hand that twists by 120 degrees: the forearm's bone, 0.6 along it, takes 72 of them."""
    skeleton, axis = with_bones(), np.array([0.0, 1.0, 0.0])
    character = tmp_path / f"character.{ending}"
    if ending == "bvh":
        write_bvh(encode_new(turning(skeleton, {"Hips": np.zeros((2, 3))})), character)
    else:
        Fbx(
            [
                Node(name, int(parent), (100 * y, 100 * z, 100 * x))
                for name, parent, (x, y, z) in zip(
                    skeleton.names, skeleton.parents, skeleton.offsets.tolist(), strict=True
                )
            ]
        ).write(character)
    twist = turning(plain(), {"LeftHand": np.radians(np.linspace(0, 120, 30))[:, None] * axis})
    write_bvh(encode_new(twist), tmp_path / "twist.bvh")
    out = spark_sim.retarget(tmp_path / "twist.bvh", character)
    assert any("twist bones that the source lacks" in note for note in out.notes)
    back = spark_sim.load(out.save(tmp_path / "out.bvh"), unit="cm", up="y")
    bone = back.motion.rotations[:, back.joint_names.index("LeftForeArmTwist02")]
    assert np.degrees(quat_angle(bone[0], bone[-1])) == pytest.approx(72, abs=0.1)


def test_a_recording_that_trembles_is_smoothed_and_says_so(samples: Path) -> None:
    walk = spark_sim.load(samples / "walker_walk.bvh")
    shaken = jittering(walk.motion, walk.rig, np.random.default_rng(0), degrees=1.0)
    noisy = replace(walk, recording=replace(walk.recording, motion=shaken))
    held, plain = (spark_sim.retarget(noisy, walk, refine=on) for on in (True, False))
    assert any("tremble" in note for note in held.recording.notes)
    assert not any("tremble" in note for note in plain.recording.notes)
    jerks = [np.diff(forward(own.motion)[0], 3, axis=0).std() for own in (held, plain)]
    assert jerks[0] < jerks[1] / 4


def test_a_loop_closes_on_another_body(samples: Path, tmp_path: Path) -> None:
    """Feet that slide a little are held, also that one which stands as the loop ends and begins."""
    rig, fps = sample_rig("walker"), 60.0
    count = round(fps * gait.stride_time(rig)) + 1
    stride = gait.walk(rig, fps).frames(20, 20 + count)
    stride = replace(stride, hips=stride.hips * [0.9, 1.0, 1.0])
    write_bvh(encode_new(from_canonical(stride)), tmp_path / "stride.bvh")
    moved = spark_sim.retarget(tmp_path / "stride.bvh", samples / "dancer_wave.bvh").canonical
    assert len(moved) == count
    assert np.degrees(quat_angle(moved.rotations[0], moved.rotations[-1])).max() < 0.5
    ahead = (stride.hips[-1] - stride.hips[0]) * travel_scale(rig, moved.rig)
    np.testing.assert_allclose(moved.hips[-1] - moved.hips[0], ahead, atol=0.003)


def test_there_and_back(samples: Path) -> None:
    """Another body with as many spine joints loses nothing of the limbs' motion, but for what the
    digits of the file between take from the knees."""
    walk = spark_sim.load(samples / "walker_walk.bvh")
    there = spark_sim.retarget(walk, samples / "dancer_wave.bvh", refine=False)
    back = spark_sim.retarget(there, walk, refine=False)
    limbs = [j for j, n in enumerate(walk.motion.skeleton.names) if "Leg" in n or "Arm" in n]
    ours, theirs = forward(walk.motion)[1][:, limbs], forward(back.motion)[1][:, limbs]
    assert quat_angle(ours, theirs).max() < 1e-4


def test_paths_and_clips_are_alike(samples: Path) -> None:
    walk, wave = samples / "walker_walk.bvh", samples / "dancer_wave.bvh"
    by_path = spark_sim.retarget(str(walk), wave)
    by_clip = spark_sim.retarget(spark_sim.load(walk), spark_sim.load(wave))
    np.testing.assert_array_equal(by_path.motion.rotations, by_clip.motion.rotations)
    assert by_path.name == by_clip.name == "walker_walk on dancer_wave"


@pytest.mark.parametrize("name", ["samba.fbx", "walk.csv", "walk.npz", "walk"])
def test_no_file_is_named_what_it_is_not(name: str, samples: Path, tmp_path: Path) -> None:
    walk = spark_sim.load(samples / "walker_walk.bvh")
    with pytest.raises(OutputError, match=r"a character's motion is written as \.bvh"):
        walk.save(tmp_path / name, force=True)
    assert not list(tmp_path.iterdir())
    assert walk.save(tmp_path / "walk.BVH").exists()


def test_fbx_without_its_extra_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = Fbx([Node("Hips"), Node("Spine", 0)]).write(tmp_path / "dance.fbx")
    monkeypatch.setitem(sys.modules, "pufbx", None)
    with pytest.raises(DependencyError, match=r"pip install 'spark-sim\[fbx\]'"):
        spark_sim.load(path)


def test_nothing_is_overwritten_unasked(samples: Path, tmp_path: Path) -> None:
    walk = spark_sim.load(samples / "walker_walk.bvh")
    walk.save(tmp_path / "a.bvh")
    with pytest.raises(OutputError, match=r"a\.bvh: exists"):
        walk.save(tmp_path / "a.bvh")
    walk.save(tmp_path / "a.bvh", force=True)
    (tmp_path / "b_scene.xml").touch()
    with pytest.raises(OutputError, match=r"b_scene\.xml: exists"):
        walk.save_mjcf(tmp_path / "b.xml")
    assert not (tmp_path / "b.xml").exists()
    for wanted in ("video", "html", "strip"):
        with pytest.raises(OutputError, match="exists"):
            spark_sim.play(walk, **{wanted: tmp_path / "a.bvh"})


def test_reports(samples: Path) -> None:
    walk = spark_sim.load(samples / "walker_walk.bvh")
    alone, beside = spark_sim.report(walk), spark_sim.report(walk, source=walk)
    assert alone.source is None
    assert beside.source is not None
    assert beside.implausible == float(beside.source.implausible.mean())


def test_a_result_keeps_what_is_known_of_its_body(samples: Path) -> None:
    target = spark_sim.load(samples / "dancer_wave.bvh")
    assert spark_sim.retarget(samples / "walker_walk.bvh", target).rig is target.rig


def test_unknown_method(samples: Path) -> None:
    with pytest.raises(ConventionError, match="'magic' is not known; expected 'copy'"):
        spark_sim.retarget(samples / "walker_walk.bvh", samples / "dancer_wave.bvh", method="magic")


def test_touches_are_kept_where_feet_are(samples: Path) -> None:
    """Hands that touch nothing stay as they are; a baseline has none to keep."""
    walk, body = samples / "walker_walk.bvh", samples / "dancer_walk.bvh"
    plain = spark_sim.retarget(walk, body)
    kept = spark_sim.retarget(walk, body, keep_touches=True)
    np.testing.assert_array_equal(kept.motion.rotations, plain.motion.rotations)
    for baseline in ({"method": "copy"}, {"refine": False}):
        with pytest.raises(ConventionError, match="a baseline keeps none"):
            spark_sim.retarget(walk, body, keep_touches=True, **baseline)


def test_errors_of_a_body_name_its_file(tmp_path: Path) -> None:
    path = tmp_path / "stick.bvh"
    path.write_text(
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Zrotation\n"
        "End Site\n{\nOFFSET 0 1 0\n}\n}\n"
        "MOTION\nFrames: 1\nFrame Time: 0.1\n0\n"
    )
    clip = spark_sim.load(path)
    with pytest.raises(SkeletonError, match=r"stick\.bvh: not a humanoid"):
        _ = clip.rig


def carried(walk: Path, path: Path, *, movable: bool = True) -> Path:
    """A walk whose hips a root carries over the ground; it is not `movable` without channels for
    its place, and then at rest."""
    head, _, rows = walk.read_text().partition("MOTION")
    channels = "6 Xposition Yposition Zposition" if movable else "3"
    head = head.replace("HIERARCHY\nROOT", "JOINT")
    frames, time, *values = rows.strip().splitlines()
    table = np.array([line.split() for line in values], dtype=float)
    if movable:
        root = np.column_stack([table[:, 0], 0 * table[:, 0], table[:, 2]])
        table[:, [0, 2]] = 0.0
        table = np.column_stack([root, np.zeros((len(table), 3)), table])
    else:
        table = np.column_stack([np.zeros((len(table), 3)), table])
    body = "\n".join(" ".join(f"{x:.6f}" for x in row) for row in table)
    path.write_text(
        f"HIERARCHY\nROOT root\n{{\nOFFSET 0 0 0\n"
        f"CHANNELS {channels} Zrotation Xrotation Yrotation\n"
        f"{head}}}\nMOTION\n{frames}\n{time}\n{body}\n"
    )
    return path


def test_root_motion_goes_over_where_the_target_s_root_can_move(
    samples: Path, tmp_path: Path
) -> None:
    source = spark_sim.load(carried(samples / "walker_walk.bvh", tmp_path / "source.bvh"))
    still = carried(samples / "walker_walk.bvh", tmp_path / "still.bvh", movable=False)
    way = source.motion.root_pos
    assert np.linalg.norm(way[-1] - way[0]) > 1
    one = spark_sim.retarget(source, tmp_path / "source.bvh", refine=False)
    np.testing.assert_allclose(one.motion.root_pos[:, :2], way[:, :2], atol=1e-6)
    assert any("root motion" in note for note in one.recording.notes)
    other = spark_sim.retarget(source, still, refine=False)
    np.testing.assert_allclose(other.motion.root_pos, 0.0, atol=1e-9)
    assert not any("root motion" in note or "lost" in note for note in other.recording.notes)
    for made in (one, other):
        places = [forward(clip.motion)[0][:, clip.rig.pelvis] for clip in (source, made)]
        np.testing.assert_allclose(*places, atol=2e-3)
