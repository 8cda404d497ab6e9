"""Datasets: what comes out is what the files hold, whoever read them and how often."""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spark.errors import FileFormatError, OutputError, SkeletonError
from spark.files import alone
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.io.reading import motion_files, read_motion
from spark.network.features import body_features
from spark.rig.rig import understand
from spark.rig.rig_json import rig_from_json, rig_to_json
from spark.rotation import quat_about, quat_angle, quat_conj, quat_mul
from spark.training import dataset_parts, part_workers
from spark.training.clips import clip_of
from spark.training.dataset import is_dataset, read_dataset, training_clips
from spark.training.dataset_parts import Part, Rejected, make_part, read_part
from spark.training.pairs import PairMaker
from spark.training.prepare import _on_body, prepare
from spark.training.splits import TRAINING, UNSEEN, cells, seen_characters, seen_motions
from spark.transfer.canonical import to_canonical
from tests.helpers.recordings import recording


@pytest.fixture(scope="module")
def made(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("datasets") / "made"
    prepare([tree], out)
    return out


def test_clips_are_those_of_the_files(tree: Path, made: Path) -> None:
    index = json.loads((made / "index.json").read_text())
    files = sorted(path.relative_to(tree).as_posix() for path in tree.rglob("*.bvh"))
    assert [clip["file"] for clip in index["clips"]] == files
    assert index["left_out"] == []
    clips = read_dataset(made, cell=None)
    for entry, clip in zip(index["clips"], clips, strict=True):
        motion = read_motion(tree / entry["file"]).motion
        own = clip_of("", to_canonical(motion, clip.body.rig), clip.body)
        assert quat_angle(own.rotations, np.array(clip.rotations, float)).max() < 1e-6
        np.testing.assert_allclose(clip.hips, own.hips, atol=0.01)
        assert np.mean(clip.planted == own.planted) > 0.98
        assert abs((len(clip.hips) - 1) * clip.frame_time - motion.duration) < clip.frame_time
        assert isinstance(clip.rotations, np.memmap)
        assert isinstance(clip.hips, np.memmap)
    # Files of one skeleton share one body, which is named after its folder.
    assert [body["character"] for body in index["bodies"]] == sorted(
        {f.split("/")[0] for f in files}
    )
    assert len({id(clip.body) for clip in clips}) == len(index["bodies"])


def test_cells(made: Path) -> None:
    index = json.loads((made / "index.json").read_text())
    counts = {name: len(read_dataset(made, name)) for name in index["cells"]}
    assert counts == index["cells"]
    assert set(counts) == {"sc+sm", "sc+um", "uc+sm", "uc+um"}
    assert sum(counts.values()) == len(index["clips"])


def test_same_bytes_whoever_reads(tree: Path, made: Path, tmp_path: Path) -> None:
    prepare([tree / "walker", tree / "dancer"], tmp_path / "again", workers=2)
    names = [path.name for path in sorted(made.glob("*.*"))]
    assert len(names) == 4
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (made / name).read_bytes()


def test_a_second_run_reads_nothing_again(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    prepare([tree / "walker"], out)
    read: list[Path] = []

    def counted(path: Path) -> object:
        read.append(path)
        return read_motion(path)

    monkeypatch.setattr(dataset_parts, "read_motion", counted)
    prepare([tree / "walker"], out)
    assert read == []
    prepare([tree], out)
    assert {path.parent.name for path in read} == {"dancer"}
    # A part that a crash left half written is made again.
    damaged = next((out / "parts").iterdir())
    before = damaged.read_bytes()
    damaged.write_bytes(before[: len(before) // 2])
    read.clear()
    prepare([tree], out)
    assert len(read) == 1
    assert damaged.read_bytes() == before


def test_what_is_left_out_and_why(tree: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mixed"
    folder.mkdir()
    good = (tree / "walker" / "walk.bvh").read_bytes()
    (folder / "a.bvh").write_bytes(good)
    (folder / "b_twin.bvh").write_bytes(good)
    (folder / "c_cut.bvh").write_bytes(good[:3000])
    (folder / "d_text.fbx").write_text("not an FBX file")
    still = read_motion(folder / "a.bvh").motion.frames(0, 1)
    write_bvh(encode_new(still), folder / "e_still.bvh")
    index = prepare([folder], tmp_path / "out")
    assert [clip["file"] for clip in index["clips"]] == ["a.bvh"]
    reasons = {left["file"]: left["why"] for left in index["left_out"]}
    assert list(reasons) == ["b_twin.bvh", "c_cut.bvh", "d_text.fbx", "e_still.bvh"]
    assert reasons["b_twin.bvh"] == "same as a.bvh"
    assert re.match(r"line \d+: the motion is cut short", reasons["c_cut.bvh"])
    assert reasons["d_text.fbx"].startswith("is no FBX file")
    assert "single frame" in reasons["e_still.bvh"]
    assert str(tmp_path) not in json.dumps(index)

    (folder / "a.bvh").unlink()
    (folder / "b_twin.bvh").unlink()
    with pytest.raises(SkeletonError, match=r"among 3 files.*c_cut\.bvh"):
        prepare([folder], tmp_path / "none")
    assert not is_dataset(tmp_path / "none")


def test_clips_are_counted_from_their_bodys_tpose(tree: Path) -> None:
    """A clip that found its own T-pose keeps its world rotations and its path in metres."""
    motion = read_motion(tree / "walker" / "walk.bvh").motion
    rig = understand(motion)
    body = body_features(rig)
    turn = quat_about("x", np.linspace(-0.3, 0.3, len(rig.skeleton)))
    other = replace(rig, tpose=quat_mul(turn, rig.tpose), hip_height=1.1 * rig.hip_height)
    clip = clip_of("", to_canonical(motion, other), body_features(other))
    part = Part(other, clip.rotations, clip.hips.astype(np.float64), clip.planted, motion.fps, 0.0)
    frames, joints = clip.rotations.shape[:2]
    numbers = _on_body(part, rig)
    rotations = numbers[: frames * joints * 4].reshape(frames, joints, 4)
    world = quat_mul(rotations, rig.tpose[body.joints])
    before = quat_mul(clip.rotations, other.tpose[body.joints])
    assert quat_angle(world, before).max() < 1e-9
    expected = quat_mul(world, quat_conj(rig.tpose[body.joints]))
    assert quat_angle(rotations, expected).max() < 1e-9
    hips = numbers[frames * joints * 4 :].reshape(frames, 3)
    np.testing.assert_allclose(hips * rig.hip_height, clip.hips * other.hip_height)


def test_training_draws_from_it(tree: Path, made: Path) -> None:
    clips, notes = training_clips([made])
    assert notes == ()
    assert len(clips) == len(read_dataset(made))
    pairs = PairMaker(clips, window=16, variants=2).draw(0, 3)
    assert pairs.source.rotations.shape[:2] == (3, 16)
    assert np.isfinite(pairs.target.root).all()
    both, _ = training_clips([made, tree])
    assert len(both) == len(clips) + len(list(tree.rglob("*.bvh")))


def test_rigs_come_back_to_the_bit(tree: Path) -> None:
    rig = understand(read_motion(tree / "dancer" / "squat.bvh").motion)
    again = rig_from_json(json.loads(json.dumps(rig_to_json(rig))))
    assert again.skeleton.names == rig.skeleton.names
    assert again.roles == rig.roles
    assert (again.groups, again.root_joint, again.hip_height) == (
        rig.groups,
        rig.root_joint,
        rig.hip_height,
    )
    for name in ("parents", "offsets", "translating", "end_parents", "end_offsets"):
        assert np.array_equal(getattr(again.skeleton, name), getattr(rig.skeleton, name))
    assert np.array_equal(again.tpose, rig.tpose)


def test_what_is_no_dataset(tree: Path, made: Path, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="spark-sim prepare"):
        read_dataset(tree)
    for path in made.glob("*.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    assert read_dataset(tmp_path)
    numbers = next(tmp_path.glob("numbers-*.npy"))
    numbers.write_bytes(numbers.read_bytes()[:-100])
    with pytest.raises(FileFormatError, match="is no dataset"):
        read_dataset(tmp_path)
    index = json.loads((made / "index.json").read_text())
    (tmp_path / "index.json").write_text(json.dumps(index | {"version": 0}))
    with pytest.raises(FileFormatError, match="version 0"):
        read_dataset(tmp_path)


def test_the_papers_characters() -> None:
    folders = [name.replace(" ", "_").lower() for name in (*TRAINING, *UNSEEN)]
    assert len(folders) == 16
    for seed in range(3):
        seen = seen_characters(folders, seed)
        assert [name for name, known in seen.items() if not known] == sorted(folders[12:])


def test_drawn_splits() -> None:
    names = [f"motion {n}" for n in range(20)]
    seen = seen_motions(names, 0)
    assert sum(seen.values()) == 16
    assert seen == seen_motions(names[::-1], 0) != seen_motions(names, 1)
    # One more name moves at most one other.
    more = seen_motions([*names, "new"], 0)
    assert sum(more[name] != seen[name] for name in names) <= 1
    assert seen_motions(["only"], 0) == {"only": True}
    assert sorted(seen_characters(["a", "b"], 0).values()) == [False, True]


def test_whom_training_does_not_meet_is_not_seen() -> None:
    clips = [(who, motion) for who in "ab" for motion in "xy"] + [("c", "y")]
    found = cells(clips, {"a": True, "b": False, "c": True}, {"x": True, "y": False})
    assert found == ["sc+sm", "sc+um", "uc+sm", "uc+um", "uc+um"]


def test_command(tree: Path, tmp_path: Path) -> None:
    def call(*args: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "spark_sim", "prepare", *map(str, args)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)

    (tmp_path / "broken.bvh").write_text("HIERARCHY")
    done = call(tree, "broken.bvh", "-o", "out", "--workers", 1)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("out: 6 clips of 2 bodies, ")
    assert "broken.bvh: left out: " in done.stderr
    assert is_dataset(tmp_path / "out")
    refused = call("nowhere", "-o", "x")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "nowhere" in refused.stderr


def test_mixamo_downloads(tmp_path: Path) -> None:
    pytest.importorskip("pufbx")
    index = prepare([recording("mixamo")], tmp_path / "out")
    assert len(index["clips"]) == 10
    assert [body["character"] for body in index["bodies"]] == [
        "Amy",
        "Big_Vegas",
        "Castle_Guard_01",
        "Kaya",
        "Michelle",
        "Sporty_Granny",
        "Warrok_W_Kurniawan",
        "XBot",
    ]
    cells = {index["bodies"][clip["body"]]["character"]: clip["cell"] for clip in index["clips"]}
    assert cells["Kaya"].startswith("uc")
    assert {cells[name] for name in ("Amy", "Michelle")} == {"sc+sm"}
    assert cells["Big_Vegas"] == "uc+um"  # his only motion is held out
    # Files of 60 and of 30 fps are 30 fps here.
    frames = {clip["file"]: clip["frames"] for clip in index["clips"]}
    assert frames["Kaya/silly_dancing_115f.fbx"] == 115
    assert frames["Michelle/silly_dancing_115f.fbx"] == 116


def test_what_is_there_is_not_lost_unasked(tree: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    whole = prepare([tree], out)
    before = (out / "index.json").read_bytes()
    with pytest.raises(OutputError, match=r"not among these files: 'dancer/.*--force"):
        prepare([tree / "walker"], out)
    with pytest.raises(OutputError, match="is a dataset of seed 0, not 1"):
        prepare([tree], out, seed=1)
    assert (out / "index.json").read_bytes() == before
    assert len(prepare([tree / "walker"], out, force=True)["clips"]) < len(whole["clips"])
    for others in ('{"name": "my page"}', "[" * 100_000):
        (out / "index.json").write_text(others)
        with pytest.raises(OutputError, match="no dataset's"):
            prepare([tree], out)
    assert prepare([tree], out, force=True) == whole


def test_earlier_datasets_are_read(made: Path, tmp_path: Path) -> None:
    """Their index does not name its arrays."""
    index = json.loads((made / "index.json").read_text())
    for name, file in index.pop("arrays").items():
        (tmp_path / f"{name}.npy").write_bytes((made / file).read_bytes())
    (tmp_path / "index.json").write_text(json.dumps(index))
    assert is_dataset(tmp_path)
    assert len(read_dataset(tmp_path, None)) == len(read_dataset(made, None))


def test_a_good_dataset_survives_a_full_disk(tree: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    prepare([tree / "walker"], out)
    before = {path: path.read_bytes() for path in out.glob("*.*")}
    largest = max(len(data) for data in before.values())
    prepare([tree], tmp_path / "parts")
    for part in (tmp_path / "parts" / "parts").iterdir():
        part.replace(out / "parts" / part.name)
    # No file of this process may grow beyond the old dataset's largest: a disk that is full.
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, limits[1]))
    try:
        with pytest.raises(OutputError, match=r"numbers-.*can't be written"):
            prepare([tree], out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert {path: path.read_bytes() for path in out.glob("*.*")} == before
    assert len(read_dataset(out, None)) == 3
    assert len(prepare([tree], out)["clips"]) == 6


def test_one_run_at_a_time(tree: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with alone(out), pytest.raises(OutputError, match="another run is writing to it"):
        prepare([tree], out)
    left = out / "parts" / ".spark-sim-1-1.part"
    left.parent.mkdir()
    left.write_text("half of it")
    prepare([tree], out)
    assert not left.exists()


def test_a_file_that_ends_its_process_is_left_out(tree: Path, tmp_path: Path) -> None:
    """Memory that runs out, a fault in a library: the others go on, in a new process."""
    files = sorted(tree.rglob("*.bvh"))
    parts = tmp_path / "parts"
    parts.mkdir()
    worker = part_workers._Worker(parts)
    try:
        first = worker.digest(files[0])
        os.kill(worker._process.pid, signal.SIGKILL)
        lost, again = worker.digest(files[1]), worker.digest(files[2])
    finally:
        worker.close()
    assert isinstance(read_part(parts, first), Part)
    rejected = read_part(parts, lost)
    assert isinstance(rejected, Rejected)
    assert "SIGKILL" in rejected.why
    assert isinstance(read_part(parts, again), Part)
    # It may have been chance: another run tries it again.
    assert isinstance(read_part(parts, make_part(files[1], parts)), Part)


def test_a_killed_run_leaves_no_processes(tree: Path, tmp_path: Path) -> None:
    for k in range(200):
        shutil.copy(next(tree.rglob("*.bvh")), tmp_path / f"{k}.bvh")
        with (tmp_path / f"{k}.bvh").open("a") as file:
            file.write("\n" * k)  # another hash
    command = [sys.executable, "-m", "spark_sim", "prepare", ".", "-o", "out", "--workers", "2"]
    process = subprocess.Popen(command, cwd=tmp_path)
    parts = tmp_path / "out" / "parts"
    while not (parts.is_dir() and any(parts.glob("*.npz"))):
        time.sleep(0.05)
        assert process.poll() is None
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    workers = children.read_text().split()
    assert len(workers) == 2
    process.kill()
    process.wait()
    deadline = time.monotonic() + 10
    while any(Path(f"/proc/{worker}").exists() for worker in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_linked_folders_are_read_once(tree: Path, tmp_path: Path) -> None:
    folder = tmp_path / "links"
    folder.mkdir()
    (folder / "a").symlink_to(tree / "walker")
    (folder / "b").symlink_to(tree / "walker")
    (folder / "c").symlink_to(folder)
    names = [path.relative_to(folder).as_posix() for path in motion_files(folder)]
    assert names == [f"a/{name}.bvh" for name in ("squat", "walk", "wave")]
    with pytest.raises(FileFormatError, match="nowhere: no such file or folder"):
        motion_files(tmp_path / "nowhere")


def test_a_dataset_with_numbers_that_are_none_is_refused(made: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(made, out)
    (path,) = out.glob("numbers*.npy")
    numbers = np.load(path)
    numbers[len(numbers) // 2] = np.nan
    np.save(path, numbers)
    with pytest.raises(FileFormatError, match=r"numbers.*\.npy: holds nan"):
        read_dataset(out)


def test_an_index_cannot_name_files_elsewhere(made: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(made, out)
    index = json.loads((out / "index.json").read_text())
    (path,) = out.glob("numbers*.npy")
    path.rename(tmp_path / "elsewhere.npy")
    index["arrays"]["numbers"] = "../elsewhere.npy"
    (out / "index.json").write_text(json.dumps(index))
    with pytest.raises(FileFormatError, match=r"elsewhere\.npy: no such file"):
        read_dataset(out)
    (out / "index.json").write_text("[" * 100_000)
    with pytest.raises(FileFormatError, match="its index is no JSON"):
        read_dataset(out)


def test_the_skeleton_of_an_amc_counts(tmp_path: Path) -> None:
    """What was understood of a motion is not used again once the ASF beside it is another."""
    (tmp_path / "02.asf").write_text(":version 1.10\n")
    motion = tmp_path / "02_01.amc"
    motion.write_text(":FULLY-SPECIFIED\n")
    (tmp_path / "parts").mkdir()
    before = make_part(motion, tmp_path / "parts")
    assert make_part(motion, tmp_path / "parts") == before
    (tmp_path / "02.asf").write_text(":version 1.10\n\n")
    assert make_part(motion, tmp_path / "parts") != before
