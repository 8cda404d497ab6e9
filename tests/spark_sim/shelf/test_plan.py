"""Which files a batch reads, and what it will write."""

from pathlib import Path

import pytest

from spark.errors import ConventionError, FileFormatError, OutputError
from spark_sim.shelf.plan import Options, plan


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


def outputs(*sources: Path, to: tuple[str, ...] = ("robot",), mirror: bool = False) -> list[str]:
    out = sources[0].parent / "out"
    jobs = plan([str(s) for s in sources], to, out, Options(), mirror=mirror).jobs
    return [job.output.as_posix() for job in jobs]


def test_the_tree_of_folders_is_kept_below_each_target(tmp_path: Path) -> None:
    touch(tmp_path / "in", "b.bvh", "a/walk.FBX", "a/notes.txt")
    assert outputs(tmp_path / "in", to=("robot", "x/mutant.bvh")) == [
        "robot/a/walk.npz",
        "mutant/a/walk.bvh",
        "robot/b.npz",
        "mutant/b.bvh",
    ]
    assert outputs(tmp_path / "in" / "b.bvh", mirror=True) == [
        "robot/b.npz",
        "robot/b_mirrored.npz",
    ]


def test_several_folders_keep_their_names(tmp_path: Path) -> None:
    touch(tmp_path, "one/walk.bvh", "two/walk.bvh")
    assert outputs(tmp_path / "one", tmp_path / "two") == [
        "robot/one/walk.npz",
        "robot/two/walk.npz",
    ]


def test_the_second_of_two_endings_keeps_it(tmp_path: Path) -> None:
    touch(tmp_path / "in", "walk.bvh", "walk.fbx")
    assert outputs(tmp_path / "in") == ["robot/walk.npz", "robot/walk.fbx.npz"]


def test_results_are_no_sources(tmp_path: Path) -> None:
    touch(tmp_path, "in/walk.bvh", "in/out/mutant/walk.bvh")
    jobs = plan([str(tmp_path / "in")], ["mutant.bvh"], tmp_path / "in" / "out", Options()).jobs
    assert [job.source.name for job in jobs] == ["walk.bvh"]
    with pytest.raises(FileFormatError, match="outside"):
        plan([str(tmp_path / "in" / "out")], ["robot"], tmp_path / "in" / "out", Options())


def test_what_can_not_be_told_apart_is_refused(tmp_path: Path) -> None:
    touch(tmp_path, "in/walk.bvh", "in/walk_mirrored.bvh", "other/walk.bvh")
    with pytest.raises(OutputError, match=r"walk_mirrored\.npz; rename one"):
        outputs(tmp_path / "in", mirror=True)
    with pytest.raises(ConventionError, match=r"both be written to g1/"):
        outputs(tmp_path / "in", to=("g1", "my/g1.xml"))
    with pytest.raises(ConventionError, match="give each once"):
        outputs(tmp_path / "in", to=("g1", "g1"))
    with pytest.raises(FileFormatError, match="no such file or folder"):
        outputs(tmp_path / "gone")
    with pytest.raises(OutputError, match="is a character"):
        plan([str(tmp_path / "in")], ["x.bvh"], tmp_path / "out", Options(format="mjlab"))
