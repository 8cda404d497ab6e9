"""The floor under all that a robot has, whatever its shapes are and whether they collide."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.registry import find
from robots.solver.block import blocks_of, whole_of
from robots.solver.floor import depth_in_floor, sole_paths, solids_over_floor
from robots.solver.solve import retarget
from robots.tree import Coordinates
from scripts.robot_bars import follow
from sim.outline import outline, solid
from sim.report.clip_poses import pose_clip
from sim.report.thresholds import HUMAN_HIP_HEIGHT, PLAUSIBILITY
from sim.trajectory import Subject
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_from_rotvec, quat_mul
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark_sim.loading import load_robot
from tests.helpers.ember import changed_ember

Way = Callable[[CanonicalMotion, Morphology], RobotMotion]

FEET = {  # in place of Ember's boxes
    "a box": '<geom class="foot"',
    "a ball": '<geom class="foot" type="sphere" mass="0.6" size="0.05" pos="0.03 0 0"/><geom '
    'class="visual" type="box"',
    "a rod": '<geom class="foot" type="capsule" mass="0.6" size="0.03" '
    'fromto="-0.03 0 -0.02 0.12 0 -0.02"/><geom class="visual" type="box"',
    "round toes": '<geom class="foot" type="ellipsoid" mass="0.6" pos="0.045 0 -0.02" '
    'size="0.11 0.04 0.03"/><geom class="visual" type="box"',
}
EMBER = load_robot(find("robot")).on_robot.robot


def ember(tmp_path: Path, foot: str) -> Morphology:
    """Ember with other feet."""
    return changed_ember(tmp_path, '<geom class="foot"(?= mass)', FEET[foot])


def tiptoeing(degrees: float = 50.0) -> CanonicalMotion:
    """A walker that goes to its knees on its toes."""
    rig = sample_rig("walker")
    source = to_canonical(sample_motion("squat", rig, 60.0).frames(0, 60), rig)
    rotations = source.rotations.copy()
    for side in ("left", "right"):
        foot = list(rig.skeleton.subtree(rig.roles.require(Role(f"{side}_foot"))))
        pitch = quat_from_rotvec(np.array([0.0, np.radians(degrees), 0.0]))
        rotations[:, foot] = quat_mul(pitch, rotations[:, foot])
    return CanonicalMotion(rig, source.frame_time, rotations, source.hips, source.floor_z)


def lowest(robot: Morphology, qpos: np.ndarray) -> np.ndarray:
    """The lowest point of the feet [m] in each frame: by MuJoCo's poses and the geoms' sizes."""
    model, data = robot.mjcf.model, mujoco.MjData(robot.mjcf.model)
    feet = [g for g in range(model.ngeom) if "foot" in model.body(model.geom_bodyid[g]).name]
    out = []
    for q in qpos:
        data.qpos = q
        mujoco.mj_kinematics(model, data)
        heights = []
        for geom in solid(model, feet):
            down = -data.geom_xmat[geom].reshape(3, 3)[2][None]
            points, radius = outline(model, geom, ellipsoid=down, mesh=down, ring=16)
            heights.append((data.geom_xpos[geom][2] - points @ down[0]).min() - radius)
        out.append(min(heights))
    return np.array(out)


def tilted(robot: Morphology, roll: float, pitch: float) -> Coordinates:
    """The T-pose as it heads anywhere, tilted by up to so much [degrees]."""
    rng = np.random.default_rng(1)
    q = robot.tpose.at(np.zeros(200, dtype=int))
    tilt = rng.uniform(-1, 1, (200, 3)) * np.radians([roll, pitch, 180])
    turned = [quat_from_rotvec(tilt[:, [k]] * np.eye(3)[k]) for k in (2, 1, 0)]
    turn = quat_mul(quat_mul(*turned[:2]), turned[2])
    return Coordinates(q.pos, turn, q.angles, q.ball_quats)


@pytest.mark.parametrize("foot", FEET)
def test_no_point_of_a_tilted_foot_is_lower_than_is_known(tmp_path: Path, foot: str) -> None:
    robot = ember(tmp_path, foot)
    q = tilted(robot, 50, 50)
    poses = forward_kinematics(robot.tree, q)
    found = np.min([sole_paths(robot, poses, sole)[..., 2].min(1) for sole in robot.soles], axis=0)
    assert (found - lowest(robot, robot.to_qpos(q))).max() < 0.006


@pytest.mark.parametrize("foot", FEET)
def test_no_point_of_a_foot_that_lies_is_lower_than_is_known(tmp_path: Path, foot: str) -> None:
    """By a half of what the report lets sink."""
    robot = ember(tmp_path, foot)
    q = tilted(robot, 20, 120)
    poses = forward_kinematics(robot.tree, q)
    soles = [sole_paths(robot, poses, sole)[..., 2].T for sole in robot.soles]
    own = [solid for solid in solids_over_floor(robot) if solid.link in robot.foot_links]
    known = np.vstack([*soles, *(solid.lowest(poses) for solid in own)]).min(axis=0)
    excess = (known - lowest(robot, robot.to_qpos(q))).max()
    assert excess < PLAUSIBILITY.penetration / 2 * robot.rig.hip_height / HUMAN_HIP_HEIGHT


@pytest.mark.parametrize("foot", FEET)
@pytest.mark.parametrize("follows", [retarget, follow], ids=["whole", "stream"])
def test_who_stands_on_tiptoe_does_not_sink(tmp_path: Path, foot: str, follows: Way) -> None:
    result = follows(tiptoeing(), ember(tmp_path, foot))
    assert lowest(result.robot, result.qpos).min() > -0.007


def on_the_side(height: float) -> CanonicalMotion:
    """A walker that lies on its left arm, the middle of its hips so high [m]."""
    rig = sample_rig("walker")
    roll = quat_from_rotvec(np.array([-np.pi / 2, 0.0, 0.0]))
    rotations = np.tile(roll, (60, len(rig.skeleton), 1))
    for role in (Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM):
        ahead = quat_from_rotvec(np.array([0.0, 0.0, -np.pi / 2]))
        arm = list(rig.skeleton.subtree(rig.roles.require(role)))
        rotations[:, arm] = quat_mul(roll, ahead if role.side == "left" else quat_conj(ahead))
    return CanonicalMotion(rig, 1 / 60, rotations, np.tile([0.0, 0, height], (60, 1)), 0.0)


@pytest.mark.parametrize("follows", [retarget, follow], ids=["whole", "stream"])
def test_a_trunk_lifts_the_shoulder_that_no_arm_can_lift(follows: Way) -> None:
    result = follows(on_the_side(0.12), EMBER)
    body = result.body
    subject = Subject(result.motion, result.robot.rig, body)
    parts = pose_clip(subject)
    lowest = (parts.part_points[..., 2] - parts.part_radii).min()
    assert lowest > -0.011 * result.robot.rig.hip_height  # what the report takes for sinking


@pytest.mark.parametrize("part", ["left_hand", "torso", "left_foot"])
def test_what_nobody_moves_is_over_the_floor_with_what_carries_it(
    tmp_path: Path, part: str
) -> None:
    """A finger, an antenna, or a spur: its hinge is idle, and its shape is in the floor or not."""
    spike = (
        '<body name="spike"><joint name="spike" axis="1 0 0" range="-0.1 1"/>'
        '<geom class="collision" type="capsule" fromto="0 0 0 0 0 -1.5" size="0.01" mass="0.1"/>'
        "</body>"
    )
    robot = changed_ember(tmp_path, rf'(<body name="{part}"[^>]*>)', rf"\1{spike}")
    spiked = robot.joint_names.index("spike")
    assert spiked not in robot.moved
    standing = robot.from_qpos(robot.mjcf.model.qpos0[None])
    poses = forward_kinematics(robot.tree, standing)
    deepest = max(-solid.lowest(poses)[0] for solid in solids_over_floor(robot))
    first, _ = blocks_of(robot)
    assert deepest > 0.1
    for block in (whole_of(robot), *([] if part == "left_hand" else [first])):
        assert depth_in_floor(robot, poses, block)[0] == pytest.approx(deepest)


@pytest.mark.parametrize("follows", [retarget, follow], ids=["whole", "stream"])
def test_a_body_that_touches_with_its_feet_alone_is_not_in_the_floor(
    tmp_path: Path, follows: Way
) -> None:
    """Models for learning to walk let nothing else touch, to be fast."""
    apart = '<geom contype="0" conaffinity="0" class="collision"'
    robot = changed_ember(tmp_path, '<geom class="collision"', apart)
    model, source = robot.mjcf.model, on_the_side(0.12)
    touching = {int(model.geom_bodyid[g]) for g in np.flatnonzero(model.geom_contype)}
    assert {model.body(b).name for b in touching} == {"left_foot", "right_foot"}
    for lies in (follows(source, robot), follows(source, EMBER)):
        judged = [
            pose_clip(Subject(lies.motion, each.rig, RobotMotion(each, lies.coordinates, 1.0).body))
            for each in (robot, EMBER)
        ]
        own, same = ((parts.part_points[..., 2] - parts.part_radii).min() for parts in judged)
        assert own == pytest.approx(same, abs=1e-9)
        assert own > -0.011 * robot.rig.hip_height
