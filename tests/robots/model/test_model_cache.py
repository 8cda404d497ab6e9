"""A model that comes from the disk is the one that MuJoCo would compile; anything else on the disk
is not used."""

import os
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model import compiling, model_cache
from robots.model.mjcf import read_mjcf
from robots.registry import ENTRIES

_ROBOT = """
<mujoco>
  <compiler meshdir="meshes"/>
  <asset><mesh name="block" file="block.obj"/></asset>
  <worldbody>
    <body name="trunk">
      <geom type="mesh" mesh="block"/>
      <body name="arm" pos="0 0 .2"><joint name="elbow"/><geom type="capsule" size=".02 .1"/></body>
    </body>
  </worldbody>
</mujoco>
"""
_BLOCK = """
v 0 0 0
v {0} 0 0
v 0 .1 0
v 0 0 .1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "robot.xml"
    path.write_text(_ROBOT)
    (tmp_path / "meshes").mkdir()
    shaped(path, 0.1)
    return path


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the cache, of this test alone."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "spark-sim" / "models"


@pytest.fixture
def compiles(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The models that were compiled, and did not come from the disk."""
    made: list[Path] = []
    original = compiling._compile

    def counted(spec: mujoco.MjSpec, path: Path, notes: list[str]) -> mujoco.MjModel:
        made.append(path)
        return original(spec, path, notes)

    monkeypatch.setattr(compiling, "_compile", counted)
    return made


def shaped(robot: Path, width: float) -> None:
    (robot.parent / "meshes" / "block.obj").write_text(_BLOCK.format(width))


def content(model: mujoco.MjModel) -> bytes:
    made = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, made)
    return made.tobytes()


def test_the_second_reading_is_the_first(robot: Path, kept: Path, compiles: list[Path]) -> None:
    first, second = read_mjcf(robot), read_mjcf(robot)
    assert compiles == [robot]
    assert len(list(kept.iterdir())) == 1
    assert content(first.model) == content(second.model)
    assert first.notes == second.notes
    # Physics and viewers go on from the spec.
    assert content(second.spec.copy().compile()) == content(first.model)
    assert second.spec.to_xml() == first.spec.to_xml()


@pytest.mark.parametrize("name", ["unitree_g1", "booster_t1", "g1_urdf", "icub"])
@pytest.mark.parametrize("visuals", [False, True])
def test_robots_come_back_as_they_were(
    name: str, visuals: bool, kept: Path, compiles: list[Path]
) -> None:
    path = next(entry.path for entry in ENTRIES if entry.name == name)
    if path is None:
        pytest.skip(f"{name} is not installed")
    first, second = (read_mjcf(path, visuals=visuals) for _ in range(2))
    assert len(compiles) == 1
    assert content(first.model) == content(second.model)
    assert (first.root, first.notes) == (second.root, second.notes)


def test_what_a_model_is_made_of_tells_it_from_others(
    robot: Path, kept: Path, compiles: list[Path]
) -> None:
    masses = {read_mjcf(robot).model.body_mass.sum()}
    shaped(robot, 0.2)
    masses.add(read_mjcf(robot).model.body_mass.sum())
    robot.write_text(_ROBOT.replace(".02 .1", ".03 .1"))
    masses.add(read_mjcf(robot).model.body_mass.sum())
    assert len(masses) == len(compiles) == len(list(kept.iterdir())) == 3


SPOILT = (
    *("cut off", "empty", "a number changed", "another model"),
    *("written by anyone", "a folder", "gone"),
)


def spoil(path: Path, how: str) -> None:
    whole = path.read_bytes()
    match how:
        case "cut off":
            path.write_bytes(whole[: len(whole) // 2])
        case "empty":
            path.write_bytes(b"")
        case "a number changed":
            at = len(whole) - 40
            path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x3F]) + whole[at + 1 :])
        case "another model":
            other = mujoco.MjModel.from_xml_string("<mujoco/>")
            path.write_bytes(content(other))
        case "written by anyone":
            path.chmod(0o666)
        case "a folder":
            path.unlink()
            path.mkdir()
        case "gone":
            path.unlink()
            path.symlink_to("/nowhere")


@pytest.mark.parametrize("how", SPOILT)
def test_what_is_not_as_it_was_stored_is_not_used(
    how: str, robot: Path, kept: Path, compiles: list[Path]
) -> None:
    first = content(read_mjcf(robot).model)
    (path,) = kept.iterdir()
    spoil(path, how)
    assert content(read_mjcf(robot).model) == first
    assert len(compiles) == 2
    assert content(read_mjcf(robot).model) == first


@pytest.mark.parametrize("place", ["/dev/null", "relative", "a file", "shared"])
def test_where_nothing_can_be_kept_models_are_compiled(
    place: str,
    robot: Path,
    tmp_path: Path,
    compiles: list[Path],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HOME", "/dev/null")
    (tmp_path / "a file").write_text("")
    shared = tmp_path / "shared" / "spark-sim" / "models"
    shared.mkdir(parents=True)
    shared.chmod(0o777)
    given = place if place in ("/dev/null", "relative") else str(tmp_path / place)
    monkeypatch.setenv("XDG_CACHE_HOME", given)
    first, second = read_mjcf(robot), read_mjcf(robot)
    assert content(first.model) == content(second.model)
    assert len(compiles) == 2
    assert not list(shared.iterdir())


def test_a_model_that_was_changed_to_compile_is_not_kept(
    robot: Path, kept: Path, compiles: list[Path]
) -> None:
    """It would come back without the note."""
    (robot.parent / "meshes" / "block.obj").write_text("v 0 0 0\n")
    first, second = read_mjcf(robot), read_mjcf(robot)
    assert first.notes == second.notes
    assert any("without meshes" in note for note in first.notes)
    assert not kept.exists()


def test_the_folder_stays_small(
    robot: Path, kept: Path, compiles: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    read_mjcf(robot)
    (one,) = kept.iterdir()
    monkeypatch.setattr(model_cache, "_MOST", int(2.5 * one.stat().st_size))
    for k, width in enumerate((0.2, 0.3, 0.4)):
        os.utime(one, (k, k))  # not used for longest ...
        if k:
            shaped(robot, 0.1)
            read_mjcf(robot)  # ... unless it is used now
        shaped(robot, width)
        read_mjcf(robot)
    assert one.exists()
    assert len(list(kept.iterdir())) == 2
    (kept / "old.part").write_bytes(b"")
    os.utime(kept / "old.part", (0, 0))
    shaped(robot, 0.5)
    read_mjcf(robot)
    assert not (kept / "old.part").exists()
