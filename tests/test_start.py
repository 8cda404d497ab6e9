"""Where the solver starts: laws of what is seen and said, and fewer steps on robots never met."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from conftest import recording

from robots import start
from robots.cues import answer_mirror, answer_of, cue_mirror, cues_of, pose_of
from robots.footing import Footing, plan_footing
from robots.known import known
from robots.morphology import Morphology
from robots.solve import copied, solve, stride_between
from robots.start import learned_start, moved, predict, shipped
from robots.targets import Targets, targets_of
from robots.tree import Coordinates, forward
from scripts.robot_variants import variant
from scripts.start_bench import compare
from scripts.start_examples import ROBOTS, VARIANTS
from scripts.train_start import Net, layers_of
from spark.canonical import CanonicalMotion, to_canonical
from spark.recording import read_recording
from spark.rig import understand
from spark.roles import Role
from spark.rotation import quat_from_yaw, quat_mul, quat_rotate
from spark.sample import sample_motion, sample_rig


@dataclass(frozen=True, eq=False)
class Copied:
    robot: Morphology
    targets: Targets
    footing: list[Footing]
    q: Coordinates

    @property
    def cues(self) -> np.ndarray:
        frames = forward(self.robot.tree, self.q)
        return cues_of(self.robot, self.targets, self.footing, frames, pose_of(self.robot, frames))

    @property
    def start(self) -> Coordinates:
        return learned_start(self.robot, self.targets, self.footing, self.q)


def on_robot(motion: CanonicalMotion, robot: Morphology) -> Copied:
    targets = targets_of(motion, robot)
    footing = plan_footing(robot, targets)
    return Copied(robot, *copied(robot, targets, footing, stride_between(targets)))


@pytest.fixture(scope="module")
def ember() -> Morphology:
    return known("robot")


@pytest.fixture(scope="module")
def walk() -> CanonicalMotion:
    rig = sample_rig("walker")
    return to_canonical(sample_motion("walk", rig, 60.0), rig)


@pytest.fixture(scope="module")
def walked(walk: CanonicalMotion, ember: Morphology) -> Copied:
    return on_robot(walk, ember)


def mirrored(motion: CanonicalMotion) -> CanonicalMotion:
    """On the same rig, which is its own mirror image."""
    roles = motion.rig.roles
    other = np.arange(len(roles.roles))
    for j, role in enumerate(roles.roles):
        if role is not None and role.value.startswith(("left_", "right_")):
            side, kind = role.value.split("_", 1)
            other[j] = roles.require(Role(f"{'right' if side == 'left' else 'left'}_{kind}"))
    return CanonicalMotion(
        motion.rig,
        motion.frame_time,
        motion.rotations[:, other] * np.array([1.0, -1, 1, -1]),
        motion.hips * np.array([1.0, -1, 1]),
        motion.floor_z,
    )


def test_a_mirror_image_is_seen_as_one(walk: CanonicalMotion, walked: Copied) -> None:
    order, signs = cue_mirror()
    np.testing.assert_array_equal(order[order], np.arange(len(order)))
    image = on_robot(mirrored(walk), walked.robot).cues
    np.testing.assert_allclose(image, walked.cues[:, order] * signs, atol=1e-6)
    assert np.abs(image - walked.cues).max() > 0.1


def test_mirror_images_get_the_mirror_image_of_the_answer() -> None:
    (order, signs), (back, back_signs) = cue_mirror(), answer_mirror()
    cues = np.random.default_rng(0).normal(size=(30, len(order)))
    said, other = predict(cues, shipped()), predict(cues[:, order] * signs, shipped())
    np.testing.assert_allclose(other, said[:, back] * back_signs, atol=1e-5)


def test_heading_and_place_do_not_matter(walk: CanonicalMotion, walked: Copied) -> None:
    yaw = quat_from_yaw(np.array(2.0))
    there = CanonicalMotion(
        walk.rig,
        walk.frame_time,
        quat_mul(yaw, walk.rotations),
        quat_rotate(yaw, walk.hips) + np.array([3.0, -2.0, 0.0]),
        walk.floor_z,
    )
    other, start = on_robot(there, walked.robot), walked.start
    np.testing.assert_allclose(other.cues, walked.cues, atol=1e-6)
    np.testing.assert_allclose(other.start.angles, start.angles, atol=1e-4)
    apart = np.linalg.norm(np.diff(start.pos, axis=0), axis=1)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(other.start.pos, axis=0), axis=1), apart, atol=1e-4
    )


@pytest.mark.parametrize("name", ["robot", "unitree_h1", "robotis_op3", "berkeley_humanoid"])
def test_an_answer_takes_a_copy_to_the_pose_that_it_tells_of(
    walk: CanonicalMotion, name: str
) -> None:
    here = on_robot(walk, known(name))
    robot, tree = here.robot, here.robot.tree
    solved = solve(robot, here.targets, here.footing, here.q)
    was, now = (pose_of(robot, forward(tree, q)) for q in (here.q, solved))
    answer = answer_of(was, now, robot.rig.hip_height)
    there = pose_of(robot, forward(tree, moved(robot, here.targets, was, answer)))
    np.testing.assert_allclose(there.hips, now.hips, atol=1e-9)
    alike = np.abs((there.parts * now.parts).sum(-1))
    assert np.degrees(2 * np.arccos(np.minimum(alike, 1.0))).mean() < 0.5
    stays = moved(robot, here.targets, was, 0 * answer)
    np.testing.assert_allclose(stays.pos, here.q.pos, atol=1e-6)


def test_the_answer_is_that_of_the_network_that_was_trained() -> None:
    torch.manual_seed(0)
    (order, signs), (back, back_signs) = cue_mirror(), answer_mirror()
    net = Net(len(order), len(back))
    torch.nn.init.normal_(net.straight.weight)
    rng = np.random.default_rng(1)
    mean, scale = rng.normal(size=len(order)), rng.uniform(0.5, 2, len(order))
    cues = rng.normal(size=(23, len(order)))

    def said(cues: np.ndarray) -> np.ndarray:
        seen = torch.from_numpy(np.clip((cues - mean) / scale, -start.MOST, start.MOST))
        with torch.no_grad():
            return net(seen.float().T[None])[0].T.numpy()

    both = (said(cues) + said(cues[:, order] * signs)[:, back] * back_signs) / 2
    np.testing.assert_allclose(predict(cues, layers_of(net, mean, scale)), both, atol=1e-4)


@pytest.mark.parametrize("name", ["robot", "robotis_op3"])
def test_a_start_keeps_the_limits(walk: CanonicalMotion, name: str) -> None:
    here = on_robot(walk, known(name))
    tree = here.robot.tree
    angles = here.start.angles
    assert (angles >= tree.lower - 1e-9).all()
    assert (angles <= tree.upper + 1e-9).all()


@pytest.mark.parametrize("frames", [1, 2, 4])
def test_few_frames_have_a_start(walk: CanonicalMotion, ember: Morphology, frames: int) -> None:
    assert np.isfinite(on_robot(walk.frames(0, frames), ember).start.angles).all()


def test_variants_are_other_robots(ember: Morphology) -> None:
    other, again = (variant("robot", seed) for seed in (1, 1))
    assert other.rig.hip_height == again.rig.hip_height
    assert abs(other.rig.hip_height / ember.rig.hip_height - 1) > 0.005
    assert variant("robot", 0).rig.hip_height == ember.rig.hip_height


def test_robots_that_it_never_met_need_fewer_steps() -> None:
    """One whose like it was not trained on, and other variants than those that it was."""
    assert "robotis_op3" not in ROBOTS
    names = ("robot", "unitree_h1", "booster_t1", "unitree_g1")
    robots = [known("robotis_op3"), *(variant(name, VARIANTS + 1) for name in names)]
    motion = read_recording(recording("cmu_asf/cmu_02_01.bvh")).motion
    walk = to_canonical(motion, understand(motion))
    rows = np.concatenate([compare(robot, [walk], shipped()) for robot in robots])
    steps, cost = rows[:, :, 0], rows[:, :, 3]
    assert steps[:, 1].sum() < steps[:, 0].sum()
    assert np.log(cost[:, 1] / cost[:, 0]).mean() < 0.02
