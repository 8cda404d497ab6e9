"""The robot that ships: it compiles, stands under its own servos, and is what its script writes."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots import registry
from scripts.make_ember import SCENE, ember

XML = registry.find("robot")
SCENE_XML = XML.with_name("scene.xml")


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(SCENE_XML))


def test_the_files_are_those_that_the_script_writes() -> None:
    assert XML.read_text() == ember()
    assert SCENE_XML.read_text() == SCENE
    assert {path.name for path in XML.parent.iterdir()} == {"ember.xml", "scene.xml"}


def test_what_it_says_of_itself(model: mujoco.MjModel) -> None:
    said = Path(XML).read_text()
    assert f"{model.body_subtreemass[1]:.0f} kg, {model.nu} hinges, no meshes" in said
    assert (model.nmesh, model.ntex) == (0, 1)  # the floor's
    assert model.jnt_limited[1:].all()
    assert model.actuator_forcelimited.all()
    assert [model.actuator(k).name for k in range(model.nu)] == [
        model.joint(j).name for j in range(1, model.njnt)
    ]


def test_left_mirrors_right(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [model.body(b).name for b in range(model.nbody)]
    for left, name in enumerate(names):
        if not name.startswith("left_"):
            continue
        right = names.index(name.replace("left_", "right_"))
        assert model.body_mass[left] == pytest.approx(model.body_mass[right])
        np.testing.assert_allclose(data.xpos[left], data.xpos[right] * [1, -1, 1], atol=1e-9)
        (low, high), other = model.jnt_range[model.body_jntadr[[left, right]]]
        mirrored = name.split("_")[-2] in ("roll",) or tuple(other) != (low, high)
        assert tuple(other) == ((-high, -low) if mirrored else (low, high))


@pytest.mark.parametrize("key", ["home", "tpose"])
def test_it_stands_under_its_own_servos(key: str, model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_forward(model, data)
    assert {model.geom_bodyid[contact.geom1] for contact in data.contact} == {0}
    start = data.qpos.copy()
    np.testing.assert_allclose(data.ctrl, start[7:])
    for _ in range(round(10 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert not any(warning.number for warning in data.warning)
    assert np.linalg.norm(data.qpos[:3] - start[:3]) < 0.08
    assert np.abs(data.qpos[7:] - start[7:]).max() < np.radians(8)
    assert np.abs(data.qvel).max() < 0.1


def test_it_moves_freely_where_people_do() -> None:
    """Squatting, reaching up and forwards, arms crossed: no part runs into another."""
    model = mujoco.MjModel.from_xml_path(str(XML))
    data = mujoco.MjData(model)
    for angles in (
        {"hip_pitch": -1.6, "knee": 2.2, "ankle_pitch": -0.7},
        {"shoulder_pitch": -2.8, "shoulder_roll": 0.7},
        {"shoulder_pitch": -1.5},
        {"elbow": -2.0},
    ):
        mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
        for side, sign in (("left", 1), ("right", -1)):
            for joint, value in angles.items():
                angle = sign * value if joint.endswith("roll") else value
                low, high = model.joint(f"{side}_{joint}").range
                assert low <= angle <= high
                data.joint(f"{side}_{joint}").qpos = angle
        mujoco.mj_forward(model, data)
        pairs = [
            (
                model.body(model.geom_bodyid[c.geom1]).name,
                model.body(model.geom_bodyid[c.geom2]).name,
            )
            for c in data.contact
        ]
        assert not pairs, angles
