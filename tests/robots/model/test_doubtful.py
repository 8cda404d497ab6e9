"""A model whose numbers MuJoCo takes, and no robot has: notes name them and say what to do."""

import re
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots import registry
from robots.model.known import known
from robots.model.understand import understand_robot
from spark.errors import FileFormatError, SkeletonError
from tests.helpers.urdf import twins

DOUBTS = "beyond two turns|hardly turn|equally long|not above 0 kg"


@pytest.fixture
def model() -> str:
    return registry.find("robot").read_text()


def doubts(tmp_path: Path, text: str, name: str = "robot.xml") -> list[str]:
    (tmp_path / name).write_text(text)
    notes = understand_robot(tmp_path / name).notes
    return [note for note in notes if re.search(DOUBTS, note)]


def with_ranges(text: str, changed: Callable[[float], float]) -> str:
    def written(found: re.Match[str]) -> str:
        return f'range="{changed(float(found[1])):.6g} {changed(float(found[2])):.6g}"'

    return re.sub(r'range="(-?[\d.]+) (-?[\d.]+)"', written, text)


def with_raised_arms(text: str) -> str:
    """Ember as a file in which the arms point sideways at zero."""
    return re.sub(
        r'(<body name="(left|right)_shoulder_roll_link")',
        lambda at: f'{at[1]} quat="1 {1 if at[2] == "left" else -1} 0 0"',
        text,
    )


def test_degrees_that_are_read_as_radians_are_said(model: str, tmp_path: Path) -> None:
    degrees = with_ranges(model, lambda angle: float(np.degrees(angle)))
    (note,) = doubts(tmp_path, degrees)
    assert "29 of 29 hinges go beyond two turns ('left_shoulder_pitch' the most, to 171.9" in note
    assert 'set <compiler angle="degree"/>' in note
    assert not doubts(tmp_path, degrees.replace('angle="radian"', 'angle="degree"'))


def test_degrees_in_a_urdf_are_said(tmp_path: Path) -> None:
    _, urdf = twins(mujoco.MjSpec.from_file(str(registry.find("robot"))))
    assert not doubts(tmp_path, urdf, "robot.urdf")
    degrees = re.sub(
        r'(lower|upper)="([^"]*)"', lambda at: f'{at[1]}="{np.degrees(float(at[2]))}"', urdf
    )
    (note,) = doubts(tmp_path, degrees, "robot.urdf")
    assert "in degrees, and a URDF's are radians; convert them" in note


def test_one_range_without_end_is_no_other_unit(model: str, tmp_path: Path) -> None:
    (note,) = doubts(tmp_path, model.replace('range="-0.05 2.5"', 'range="-100 100"', 1))
    assert note.startswith("by their limits 1 of 29 hinges go beyond two turns ('left_knee'")
    assert note.endswith("check their ranges in the file")


def test_radians_that_are_read_as_degrees_are_said(model: str, tmp_path: Path) -> None:
    """Where the arms hang at zero, that is also why they can't be raised for a T-pose."""
    tiny = model.replace('angle="radian"', 'angle="degree"')
    with pytest.raises(SkeletonError, match=r"forbid a T-pose.*29 of 29 hinges hardly turn"):
        doubts(tmp_path, tiny)
    (note,) = doubts(tmp_path, with_raised_arms(tiny))
    assert "('left_shoulder_yaw' the most, by 4.6 degrees)" in note
    assert 'set <compiler angle="radian"/>' in note


def test_a_robot_whose_hinges_are_held_is_no_other_unit(model: str, tmp_path: Path) -> None:
    """But for its legs, as who trains a walk holds the rest."""
    held = re.sub(
        r'(name="\w*(?:shoulder|elbow|wrist|waist)\w*"\s+axis="[^"]*"\s+range=)"[^"]*"',
        r'\1"-1e-6 1e-6"',
        with_raised_arms(model),
    )
    assert held.count("1e-6 1e-6") == 17
    assert not doubts(tmp_path, held)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("left_shin", "from 'left_thigh' to 'left_shin' 0.28 m, from 'right_thigh'"),
        ("right_ankle_pitch_link", "'left_foot' 0.32 m, from 'right_shin' to 'right_foot' 0.28 m"),
    ],
)
def test_a_bone_that_is_shorter_than_the_other_side_s_is_said(
    body: str, said: str, model: str, tmp_path: Path
) -> None:
    short = model.replace(
        f'<body name="{body}" pos="0 0 -0.32"', f'<body name="{body}" pos="0 0 -0.28"'
    )
    (note,) = doubts(tmp_path, short)
    assert said in note


KNEE = '<joint class="leg" name="left_knee"'


@pytest.mark.parametrize("bound", ["", 'boundmass="0.001" boundinertia="0.001"'])
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ('mass="-2" diaginertia=".1 .1 .1"', "has mass=-2; expected more than 0"),
        ('mass="2" diaginertia="-.1 .1 .1"', "has moments of -0.1 kg m²; expected more than 0"),
    ],
)
def test_a_mass_below_zero_is_refused(
    given: str, said: str, bound: str, model: str, tmp_path: Path
) -> None:
    """Also where the file has MuJoCo lift it."""
    text = model.replace(KNEE, f'<inertial pos="0 0 0" {given}/>{KNEE}')
    with pytest.raises(FileFormatError, match=f"body 'left_shin': its <inertial> {said}"):
        doubts(tmp_path, text.replace("<compiler ", f"<compiler {bound} "))


def test_bodies_that_move_without_mass_are_named(model: str, tmp_path: Path) -> None:
    text = model.replace(KNEE, f'<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>{KNEE}')
    (tmp_path / "robot.xml").write_text(text)
    (note,) = understand_robot(tmp_path / "robot.xml").notes
    assert note == "some bodies move without mass, and get next to none: 'left_shin'"


@pytest.mark.parametrize("mass", ["0", "-1.5"])
def test_a_link_with_a_shape_and_no_mass_is_named(mass: str, tmp_path: Path) -> None:
    _, urdf = twins(mujoco.MjSpec.from_file(str(registry.find("robot"))))
    start = urdf.index('<link name="left_shin">')
    light = urdf[:start] + urdf[start:].replace('<mass value="1.6"/>', f'<mass value="{mass}"/>', 1)
    assert light != urdf
    (note,) = doubts(tmp_path, light, "robot.urdf")
    assert note.endswith("as if of water: 'left_shin'")


@pytest.mark.parametrize("entry", registry.ENTRIES, ids=lambda entry: entry.name)
def test_no_robot_is_doubted_that_is_one(entry: registry.Entry) -> None:
    if entry.path is None:
        pytest.skip(f"{entry.requirement} is needed")
    assert not [note for note in known(entry.name).notes if re.search(DOUBTS, note)]
