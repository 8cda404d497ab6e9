"""What is left of parts in each other is said."""

import mujoco
import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.solver import solve
from robots.solver.unparted import unparted
from robots.tree import Coordinates
from scripts.robot_memory import pacing

FRAMES = slice(4, 11)


def with_arms_in(robot: Morphology, q: Coordinates) -> Coordinates:
    """The left forearm in the trunk in some frames."""
    names = [robot.mjcf.joint_name(joint) for joint in robot.mj_joints]
    angles = q.angles.copy()
    angles[FRAMES, names.index("left_shoulder_roll")] = -0.4
    angles[FRAMES, names.index("left_elbow")] = 0.0
    return Coordinates(q.pos, q.quat, angles)


def test_parts_that_stay_in_each_other_are_named(
    ember: Morphology, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With their depth, as MuJoCo finds it in the poses, and the frames."""
    source = pacing(40)
    clean = solve.retarget(source, ember)
    assert not any("deep" in note for note in clean.notes)
    spoilt = with_arms_in(ember, clean.coordinates)
    monkeypatch.setattr(solve, "_trajectory", lambda robot, targets: spoilt)
    notes = [note for note in solve.retarget(source, ember).notes if "deep" in note]
    model = ember.mjcf.model
    data, depths = mujoco.MjData(model), []
    for qpos in ember.to_qpos(spoilt):
        data.qpos = qpos
        mujoco.mj_forward(model, data)
        depths += [(-contact.dist, *contact.geom) for contact in data.contact[: data.ncon]]
    depth, *geoms = max(depths)
    assert all(
        repr(ember.mjcf.body_name(int(model.geom_bodyid[geom]))) in notes[0] for geom in geoms
    )
    assert f"{1000 * depth:.0f} mm deep" in notes[0]
    assert "in 7 frames (4, 5, 6, 7, 8, ...)" in notes[0]


def test_all_of_a_long_motion_is_searched(
    ember: Morphology, monkeypatch: pytest.MonkeyPatch
) -> None:
    q = ember.tpose.at(np.zeros(30, dtype=int))
    spoilt = with_arms_in(ember, q)
    whole = unparted(ember, spoilt, 3)
    assert whole
    monkeypatch.setattr("spark.blocks.BLOCK", 8)
    assert unparted(ember, spoilt, 3) == whole
