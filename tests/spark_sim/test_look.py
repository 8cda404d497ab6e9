"""What the API's objects look like at a prompt and in a notebook."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import spark_sim
from robots import formats, registry
from robots.formats.unitree import ORDERS
from spark.io.convention import UNITS
from spark_sim import choices

OURS = ("spark.", "sim.", "robots.", "spark_sim.")


@pytest.fixture(scope="module")
def walk(walk_path: Path) -> spark_sim.Clip:
    return spark_sim.load(walk_path, unit="cm")


@pytest.fixture(scope="module")
def on_robot(walk: spark_sim.Clip) -> spark_sim.RobotClip:
    return spark_sim.retarget(walk, "robot", method="copy")


def reached(value: Any, seen: set[type]) -> Iterator[Any]:
    """One object of each of our classes that is in reach from `value` by public attributes."""
    if isinstance(value, tuple | list):
        for part in value[:1]:
            yield from reached(part, seen)
    elif type(value).__module__.startswith(OURS) and type(value) not in seen:
        seen.add(type(value))
        yield value
        names = [field.name for field in fields(value)] if is_dataclass(value) else [*vars(value)]
        names += [n for c in type(value).__mro__ for n, v in vars(c).items() if hasattr(v, "func")]
        for name in names:
            if not name.startswith("_"):
                yield from reached(getattr(value, name), seen)


def test_a_repr_is_one_short_line(walk: spark_sim.Clip, on_robot: spark_sim.RobotClip) -> None:
    start = (
        walk,
        spark_sim.retarget(walk, walk),
        on_robot,
        spark_sim.report(on_robot, source=walk),
        spark_sim.simulate(on_robot, balance=False),
        spark_sim.Retargeter(walk, on_robot),
    )
    seen: set[type] = set()
    found = [each for value in start for each in reached(value, seen)]
    assert {"Clip", "RobotClip", "Rig", "Motion", "Skeleton", "Recording", "Bvh", "Report"} < {
        type(each).__name__ for each in found
    }
    texts = {type(each).__name__: repr(each) for each in found}
    assert {name: text for name, text in texts.items() if len(text) > 240} == {}
    assert {name: text for name, text in texts.items() if "\n" in text or " at 0x" in text} == {}


def test_reprs_tell_what_one_asks_first(
    walk: spark_sim.Clip, on_robot: spark_sim.RobotClip
) -> None:
    frames = len(walk)
    assert repr(walk) == f"Clip('walker_walk', {frames} frames, 30 fps, 22 joints)"
    assert (
        repr(on_robot) == f"RobotClip('walker_walk on robot', {frames} frames, 30 fps, 29 joints)"
    )
    assert repr(walk.motion) == f"Motion({frames} frames, 30 fps, 22 joints)"
    assert repr(walk.motion.frames(0, 1)) == "Motion(1 frame, 30 fps, 22 joints)"
    assert repr(walk.rig).startswith("Rig(22 joints, 22 with a role, hips 0.")
    assert repr(walk.recording).endswith(", unit cm, y up)")
    report = spark_sim.report(walk)
    assert f"{frames} frames, 30 fps, {100 * report.implausible:.1f} % implausible" in repr(report)


def test_notebooks_show_a_table(walk: spark_sim.Clip, on_robot: spark_sim.RobotClip) -> None:
    page = walk._repr_html_()
    for fact in ("<b>walker_walk</b>", ">frames<", "mixamorig:Hips", "cm, y"):
        assert fact in page
    assert "left_hip_pitch" in on_robot._repr_html_()
    assert "root wrench" in spark_sim.report(walk)._repr_html_()
    odd = replace(walk, name="<script>")
    assert "<script>" not in odd._repr_html_()


def test_what_a_clip_tells(walk: spark_sim.Clip) -> None:
    motion = walk.motion
    assert (len(walk), walk.fps, walk.duration) == (len(motion), motion.fps, motion.duration)
    assert walk.joint_names == motion.skeleton.names
    assert walk.canonical is walk.canonical


def test_contacts_alternate_in_a_walk(walk: spark_sim.Clip, on_robot: spark_sim.RobotClip) -> None:
    """Now the left foot stands alone, now the right; one who walks is never in the air."""
    for clip in (on_robot, walk):
        left, right = clip.contacts["left"], clip.contacts["right"]
        assert left.shape == right.shape == (len(clip),)
        assert (left & ~right).any()
        assert (right & ~left).any()
    assert (left | right).all()


def test_joints_of_a_robot_are_those_of_mujoco(on_robot: spark_sim.RobotClip) -> None:
    """By name, as a model with other joints before them would have them, too."""
    model = on_robot.body.model
    assert on_robot.qpos.shape == (len(on_robot), model.nq)
    assert tuple(on_robot.joints) == on_robot.joint_names
    for name, angles in on_robot.joints.items():
        start = int(model.joint(name).qposadr[0])
        np.testing.assert_array_equal(angles, on_robot.qpos[:, start])


def test_a_robot_needs_no_model(on_robot: spark_sim.RobotClip, tmp_path: Path) -> None:
    with pytest.raises(spark_sim.SparkSimError, match="has a MuJoCo model of its own"):
        on_robot.save_mjcf(tmp_path / "robot.xml")


def test_the_words_of_options_are_those_that_are_understood() -> None:
    """What a type checker allows is what works: no more, no less."""
    assert set(get_args(choices.Unit)) == set(UNITS)
    assert set(get_args(choices.Quat)) == set(ORDERS)
    assert set(get_args(choices.Format)) == set(formats.FORMATS)
    names = {*(entry.name for entry in registry.ENTRIES), *registry.ALIASES}
    assert set(get_args(choices.RobotName)) == names


def test_a_robot_without_shapes_is_shown_as_its_skeleton(tmp_path: Path) -> None:
    """As one whose meshes are all missing: there would be nothing to see."""
    ember = registry.find("ember")
    root = ElementTree.fromstring(ember.read_text())
    for body in root.findall("worldbody//body"):
        for shape in body.findall("geom"):
            body.remove(shape)
        inertial = {"pos": "0 0 0", "mass": "1", "diaginertia": "0.01 0.01 0.01"}
        body.insert(0, ElementTree.Element("inertial", inertial))
    bare = tmp_path / "bare.xml"
    bare.write_text(ElementTree.tostring(root, encoding="unicode"))
    clip, whole = spark_sim.load(bare), spark_sim.load(ember)
    assert "no shapes" in clip.surface[1][0]
    assert whole.surface[1] == ()
    assert [figure.subject.body for figure in clip.figures()] == [None]
    assert whole.figures()[0].subject.body is whole.body
    spark_sim.play(clip, html=tmp_path / "bare.html")
