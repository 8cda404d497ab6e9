"""A motion on the MuJoCo body that is made from its own skeleton: it comes back as it was.

The source's report looks at the rig's soles, MuJoCo at the body's boxes, the solver at what is
understood of the model's file: they see the same feet. Ball joints can do all that the source's
can; of hinges, an elbow has one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.model.understand import understand_robot
from robots.solver.solve import copy, retarget
from sim.body.build import build_body
from sim.body.joints import JointType
from sim.body.mjcf import write_mjcf
from sim.report import Report, Subject, assess
from sim.report.stretches import measure_clip
from spark.demo.sample import sample_motion, sample_rig
from spark.io.reading import read_motion
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.directions import bone_directions
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig, understand
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.ground import level_ground
from tests.helpers.recordings import recording

FRAMES = 120  # of a recording, at most
POINT = 0.01  # a percentage point of the frames
KINDS = ("ball", "hinge")
MADE = "walk"
RECORDED = (
    "cmu_asf/cmu_02_01.bvh",
    "animateddrawings/dab.bvh",
    "mesh2motion/human_addon_YMCA.bvh",
    "reactidle/000_genuine.bvh",
    "zoo/ad_rokoko_mixamo.bvh",
)
"""Five rigs: toes of all kinds and none."""
OFF_AXIS = "reactidle/000_genuine.bvh"
STANDING = (
    "squat",
    "cmu_asf/cmu_02_05.bvh",
    "animateddrawings/wave_hello.bvh",
    "reactidle/007_genuine.bvh",
)


@dataclass
class OnOwnBody:
    """A motion, and the robot that its skeleton makes."""

    motion: Motion
    rig: Rig
    robot: Morphology

    @property
    def source(self) -> CanonicalMotion:
        return to_canonical(self.motion, self.rig)

    def report(self, moved: RobotMotion) -> Report:
        subject = Subject(moved.motion, self.robot.rig, moved.body)
        return assess(subject, source=Subject(self.motion, self.rig))

    def hips_error(self, moved: RobotMotion) -> float:
        """How far [hip heights] the middle of the hips is from the source's, at most."""
        theirs = forward(self.motion)[0][:, self.rig.hips].mean(1) - [0, 0, self.source.floor_z]
        own = forward(moved.motion)[0][:, self.robot.rig.hips].mean(1)
        return float(np.linalg.norm(own - theirs, axis=1).max() / self.rig.hip_height)

    def limb_errors(self, moved: RobotMotion, *, only: str = "") -> np.ndarray:
        """Angles [degrees] between the limbs' directions on both, of all frames."""
        bones = [
            bone_directions(each.rig, canonical_positions(each), each.rotations)
            for each in (self.source, to_canonical(moved.motion, self.robot.rig))
        ]
        cosines = [(bones[0][r] * bones[1][r]).sum(1) for r in bones[0] if r.endswith(only)]
        return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


@pytest.fixture(scope="module")
def put(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, JointType], OnOwnBody]:
    """What a sample motion or a recording is on a body of balls or hinges; each made once."""
    known: dict[tuple[str, JointType], OnOwnBody] = {}
    folder = tmp_path_factory.mktemp("bodies")

    def make(name: str, kind: JointType) -> OnOwnBody:
        if (name, kind) not in known:
            if name.endswith(".bvh"):
                motion = read_motion(recording(name)).motion
                motion = motion.frames(0, min(len(motion), FRAMES))
                rig = understand(motion)
            else:
                rig = sample_rig("walker")
                motion = sample_motion(name, rig, 60.0)
            path = folder / f"{Path(name).stem}_{kind}.xml"
            write_mjcf(build_body(rig, joints=kind), path)
            known[name, kind] = OnOwnBody(motion, rig, understand_robot(path))
        return known[name, kind]

    return make


def assert_unchanged(own: OnOwnBody, moved: RobotMotion) -> None:
    """No more, and no fewer, of the frames are implausible than of the source over the level floor
    that comes to lie at z = 0, as a whole and of each kind."""
    floor = level_ground(own.source.floor_z)
    now, before = own.report(moved).clip, measure_clip(Subject(own.motion, own.rig), floor)
    assert now.implausible_share == pytest.approx(before.implausible_share, abs=POINT)
    assert now.shares == pytest.approx(before.shares, abs=POINT)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", [MADE, *RECORDED])
def test_the_model_s_soles_are_the_rig_s(
    name: str, kind: JointType, put: Callable[[str, JointType], OnOwnBody]
) -> None:
    own = put(name, kind)
    rig, other = own.rig, own.robot.rig
    assert len(other.soles) == len(rig.soles) == 2
    for sole, found in zip(rig.soles, other.soles, strict=True):
        assert found.side == sole.side
        assert [other.skeleton.names[j] for j in found.joints] == [
            rig.skeleton.names[j] for j in sole.joints
        ]
        wanted = sole_positions(sole, rig.tpose_positions, rig.tpose)
        wanted -= rig.tpose_positions[rig.hips].mean(0)
        points = sole_positions(found, other.tpose_positions, other.tpose)
        points -= other.tpose_positions[other.hips].mean(0)
        np.testing.assert_allclose(points, wanted, atol=1e-6)


@pytest.mark.parametrize("name", [MADE, *RECORDED])
def test_boxes_have_their_lower_corners_at_the_soles_points(
    name: str, put: Callable[[str, JointType], OnOwnBody]
) -> None:
    """Heel and ball are those of the foot's box; the toes' box ends at the toes' end."""
    own = put(name, "ball")
    rig, model = own.rig, own.robot.mjcf.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hips = np.mean([data.body(rig.skeleton.names[j]).xpos for j in rig.hips], axis=0)
    for sole in rig.soles:
        points = sole_positions(sole, rig.tpose_positions, rig.tpose)
        points -= rig.tpose_positions[rig.hips].mean(0)
        for joint in {*sole.joints.tolist()}:
            body = model.body(rig.skeleton.names[joint]).id
            boxes = np.flatnonzero(
                (model.geom_bodyid == body) & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
            )
            assert len(boxes) == 1
            box = int(boxes[0])
            signs = np.array([(x, y, -1) for x in (-1, 1) for y in (-1, 1)])
            turn = data.geom_xmat[box].reshape(3, 3)
            corners = data.geom_xpos[box] + (signs * model.geom_size[box]) @ turn.T - hips
            ours = points[sole.joints == joint]
            np.testing.assert_allclose(corners[-len(ours) :], ours, atol=1e-6)


@pytest.mark.parametrize("name", [MADE, *RECORDED])
def test_on_balls_a_copied_motion_comes_back_exactly(
    name: str, put: Callable[[str, JointType], OnOwnBody]
) -> None:
    own = put(name, "ball")
    moved = copy(own.source, own.robot)
    assert_unchanged(own, moved)
    assert own.hips_error(moved) < 1e-6
    assert own.limb_errors(moved).max() < 0.01


@pytest.mark.parametrize("name", [MADE, *(name for name in RECORDED if name != OFF_AXIS)])
def test_on_hinges_a_copied_motion_comes_back_as_it_was(
    name: str, put: Callable[[str, JointType], OnOwnBody]
) -> None:
    own = put(name, "hinge")
    moved = copy(own.source, own.robot)
    assert_unchanged(own, moved)
    assert own.hips_error(moved) < 1e-6
    assert own.limb_errors(moved, only="upper_leg").max() < 0.01


def test_a_knee_that_bends_beside_its_axis_is_no_hinge(
    put: Callable[[str, JointType], OnOwnBody],
) -> None:
    """Why that recording is no case of the law above: its shanks lean sideways."""
    own = put(OFF_AXIS, "hinge")
    assert np.percentile(own.limb_errors(copy(own.source, own.robot), only="lower_leg"), 50) > 2


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", STANDING)
def test_a_standing_motion_is_solved_as_it_was(
    name: str, kind: JointType, put: Callable[[str, JointType], OnOwnBody]
) -> None:
    """Feet that a recording has a little above its floor are put on it, the hips with them."""
    own = put(name, kind)
    moved = retarget(own.source, own.robot)
    assert_unchanged(own, moved)
    assert own.hips_error(moved) < 0.05
    assert np.percentile(own.limb_errors(moved), 99) < 3


@pytest.mark.parametrize("kind", KINDS)
def test_a_walk_is_solved_as_it_was(
    kind: JointType, put: Callable[[str, JointType], OnOwnBody]
) -> None:
    own = put(MADE, kind)
    assert_unchanged(own, retarget(own.source, own.robot))


@pytest.mark.parametrize("name", ["cmu_asf/cmu_02_01.bvh", "animateddrawings/dab.bvh"])
def test_feet_with_toes_do_not_sink(name: str, put: Callable[[str, JointType], OnOwnBody]) -> None:
    """What the solver keeps above the floor is all that the report finds below it."""
    own = put(name, "hinge")
    report = own.report(retarget(own.source, own.robot))
    assert report.source is not None
    assert report.clip.shares["penetration"] <= report.source.shares["penetration"] + POINT
