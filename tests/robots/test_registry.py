"""Robots by name: what is known of them, where they are, and what is said where they are not."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import spark_sim
from robots import registry
from robots.model.known import known
from robots.model.mjcf import read_mjcf
from robots.model.morphology import Morphology
from robots.registry import ENTRIES, Entry
from spark.errors import ConventionError, DependencyError, FileFormatError

NAMES = [entry.name for entry in ENTRIES]
MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


def height(robot: Morphology) -> float:
    """From the lowest to the highest point [m] of all shapes in the T-pose, by MuJoCo."""
    whole = read_mjcf(robot.mjcf.path)
    model, data = whole.model, mujoco.MjData(whole.model)
    data.qpos[:] = robot.to_qpos(robot.tpose)[0]
    mujoco.mj_kinematics(model, data)
    z = []
    for geom in range(model.ngeom):
        if int(model.geom_bodyid[geom]) not in whole.bodies():
            continue
        up = data.geom_xmat[geom].reshape(3, 3)[2]
        if int(model.geom_type[geom]) == MESH:
            mesh = int(model.geom_dataid[geom])
            first = int(model.mesh_vertadr[mesh])
            points = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])] @ up
            z += [data.geom_xpos[geom, 2] + points.min(), data.geom_xpos[geom, 2] + points.max()]
        else:
            center, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            middle = data.geom_xpos[geom, 2] + center @ up
            z += [middle - half @ np.abs(up), middle + half @ np.abs(up)]
    return max(z) - min(z)


@pytest.mark.parametrize("entry", ENTRIES, ids=NAMES)
def test_what_is_said_of_a_robot_holds(entry: Entry) -> None:
    if entry.path is None:
        pytest.skip(f"{entry.name}: {entry.module} is not installed")
    mjcf = read_mjcf(registry.find(entry.name), visuals=False)
    assert len(mjcf.joints()) == entry.joints
    assert registry.name_of(mjcf.path) == entry.name
    licence = {"BSD-3-Clause": "Redistribution and use", "Apache-2.0": "Apache License"}
    texts = [path.read_text() for path in mjcf.path.parent.glob("LICENSE")]
    assert all(licence[entry.licence] in text for text in texts)


@pytest.mark.parametrize("name", ["robot", "unitree_g1", "unitree_h1", "gymnasium_humanoid"])
def test_heights_are_those_of_the_shapes(name: str) -> None:
    entry = next(entry for entry in ENTRIES if entry.name == name)
    if entry.path is None:
        pytest.skip(f"{name}: {entry.module} is not installed")
    assert height(known(name)) == pytest.approx(entry.height, abs=0.02)


def test_our_own_ships_and_needs_no_meshes() -> None:
    assert registry.find("robot") == registry.find("ember")
    model = known("robot").mjcf.model
    assert model.nmesh == 0
    assert registry.ENTRIES[0].path is not None


def test_listing_and_finding_import_nothing() -> None:
    code = (
        "import sys\nfrom robots import registry\n"
        "[entry.path for entry in registry.ENTRIES], registry.downloads()\n"
        "registry.find('robot'), registry.is_robot('robot')\n"
        "print(sorted({'numpy', 'mujoco', 'gymnasium', 'dm_control'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("cmu", "did you mean 'dm_control_cmu'"),
        ("unitree_g2", "did you mean 'unitree_g1' or 'unitree_h1'"),
        ("Apollo", "did you mean 'apollo'"),
        ("nothing_like_it_xyz", "no robot is called 'nothing_like_it_xyz'; `spark-sim robots`"),
    ],
)
def test_unknown_names_get_the_near_ones(name: str, says: str) -> None:
    with pytest.raises(ConventionError, match=says):
        registry.find(name)


def test_what_is_not_installed_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "find_spec", lambda name: None)
    with pytest.raises(DependencyError, match=r"pip install 'spark-sim\[robots\]'"):
        registry.find("unitree_g1")
    with pytest.raises(DependencyError, match="pip install 'dm-control'"):
        registry.find("dm_control_cmu")
    assert registry.downloads() == ()


def test_paths_are_models() -> None:
    assert registry.find("some/where/g1.xml") == Path("some/where/g1.xml")
    assert registry.find("some/where/g1.urdf") == Path("some/where/g1.urdf")
    for path in ("g1.usd", "walk.bvh", "folder/g1", "."):
        with pytest.raises(FileFormatError, match="expected an MJCF"):
            registry.find(path)


@pytest.mark.parametrize("alias", registry.ALIASES)
def test_aliases_are_other_names_of_robots(alias: str) -> None:
    entry = next(entry for entry in ENTRIES if entry.name == registry.ALIASES[alias])
    if entry.path is None:
        pytest.skip(f"{entry.name}: {entry.module} is not installed")
    assert registry.find(alias) == registry.find(entry.name) == entry.path
    assert registry.name_of(registry.find(alias)) == entry.name


def test_no_alias_hides_a_robot() -> None:
    assert not set(registry.ALIASES) & set(NAMES)


@pytest.mark.parametrize("name", ["g1", "unitree_g1", "robot", "h9_mj_description"])
@pytest.mark.parametrize("make", [Path.mkdir, Path.touch])
def test_what_is_called_as_a_robot_is_not_in_its_way(
    name: str, make: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "downloads", lambda: ("h9_mj_description",))
    assert registry.is_robot(name)
    assert not registry.shadowed(name)
    make(tmp_path / name)
    assert registry.is_robot(name)
    kind = "folder" if make is Path.mkdir else "file"
    assert f"the {kind} '{name}' here is not looked at" in registry.shadowed(name)[0]
    assert not registry.shadowed("takes")


def test_a_robot_is_found_beside_a_folder_of_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plain = spark_sim.load("ember")
    (tmp_path / "ember").mkdir()
    clip = spark_sim.load("ember")
    assert isinstance(clip, spark_sim.RobotClip)
    assert clip.on_robot.robot is plain.on_robot.robot
    assert len(clip.notes) == len(plain.notes) + 1
    assert "the folder 'ember' here is not looked at" in clip.notes[0]


def test_a_name_wins_over_a_folder_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot").mkdir()
    (tmp_path / "takes").mkdir()
    assert registry.is_robot("robot")
    assert registry.is_robot("unknown_name")
    assert registry.is_robot("g1.XML")
    assert not registry.is_robot("takes")
    assert not registry.is_robot("walk.bvh")


@pytest.mark.skipif(
    find_spec("robot_descriptions") is not None, reason="robot_descriptions is installed"
)
def test_robot_descriptions_are_loaded_by_their_own_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "robot_descriptions"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "h9_mj_description.py").write_text("MJCF_PATH = '/models/h9.xml'\n")
    (package / "gone_mj_description.py").write_text("raise OSError('no network')\n")
    (package / "h9_description.py").write_text("URDF_PATH = ''\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert registry.downloads() == ("gone_mj_description", "h9_mj_description")
    assert "robot_descriptions" not in sys.modules
    assert registry.find("h9_mj_description") == Path("/models/h9.xml")
    with pytest.raises(DependencyError, match=r"gone_mj_description.*no network.*internet"):
        registry.find("gone_mj_description")
    with pytest.raises(ConventionError, match="did you mean 'h9_mj_description'"):
        registry.find("h9_mj_descriptio")
    for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
        monkeypatch.delitem(sys.modules, name)
