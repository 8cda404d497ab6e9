"""Forward kinematics against a naive loop and against MuJoCo."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spark.errors import ConventionError, SkeletonError
from spark.kinematics import end_positions, forward, local_rotations
from spark.motion import Motion
from spark.skeleton import Skeleton


def random_motion(joints: int, frames: int, seed: int = 0, *, moving: bool = False) -> Motion:
    rng = np.random.default_rng(seed)
    parents = np.array([-1, *(int(rng.integers(0, j)) for j in range(1, joints))])
    skeleton = Skeleton(
        tuple(f"j{j}" for j in range(joints)),
        parents,
        rng.normal(size=(joints, 3)),
        np.arange(joints) == 0,
        np.array([joints - 1, 0]),
        rng.normal(size=(2, 3)),
    )
    q = rng.normal(size=(frames, joints, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    root = rng.normal(size=(frames, 3))
    translations = None
    if moving:
        translations = rng.normal(size=(frames, joints, 3))
        translations[:, 0] = root
    return Motion(skeleton, 1 / 30, root, q, translations)


@pytest.mark.parametrize("moving", [False, True])
def test_forward_agrees_with_a_naive_loop(moving: bool) -> None:
    motion = random_motion(12, 5, moving=moving)
    positions, world = forward(motion)
    skeleton = motion.skeleton
    for t in range(5):
        turns: list[Rotation] = []
        places: list[np.ndarray] = []
        for j in range(12):
            local = Rotation.from_quat(np.roll(motion.rotations[t, j], -1))
            offset = skeleton.offsets[j] if not moving else motion.translations[t, j]
            if j == 0:
                turns.append(local)
                places.append(motion.root_pos[t])
            else:
                p = int(skeleton.parents[j])
                turns.append(turns[p] * local)
                places.append(places[p] + turns[p].apply(offset))
        np.testing.assert_allclose(positions[t], places, atol=1e-12)
        np.testing.assert_allclose(
            Rotation.from_quat(np.roll(world[t], -1, axis=-1)).as_matrix(),
            [turn.as_matrix() for turn in turns],
            atol=1e-12,
        )
        ends = end_positions(skeleton, positions[t], world[t])
        np.testing.assert_allclose(
            ends[0], places[11] + turns[11].apply(skeleton.end_offsets[0]), atol=1e-12
        )


def test_forward_agrees_with_mujoco() -> None:
    """A two-link arm written by hand, in MuJoCo's own words."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="a"><freejoint/><geom size=".1"/>
        <body name="b" pos=".3 .1 -.2"><joint type="ball"/><geom size=".1"/>
        <body name="c" pos="0 .5 .25"><joint type="ball"/><geom size=".1"/>
        </body></body></body></worldbody></mujoco>"""
    )
    skeleton = Skeleton(
        ("a", "b", "c"),
        np.array([-1, 0, 1]),
        np.array([[0, 0, 0], [0.3, 0.1, -0.2], [0, 0.5, 0.25]]),
        np.array([True, False, False]),
    )
    made = random_motion(3, 20, seed=1)
    motion = Motion(skeleton, made.frame_time, made.root_pos, made.rotations)
    positions, _ = forward(motion)
    data = mujoco.MjData(model)
    for t in range(20):
        data.qpos[:] = np.concatenate([motion.root_pos[t], motion.rotations[t].ravel()])
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(positions[t], data.xpos[1:], atol=1e-12)


def test_local_rotations_invert_world_rotations() -> None:
    motion = random_motion(20, 7)
    _, world = forward(motion)
    back = local_rotations(motion.skeleton, world)
    np.testing.assert_allclose(np.abs((back * motion.rotations).sum(-1)), 1, atol=1e-12)


def test_one_joint_and_one_frame() -> None:
    motion = random_motion(1, 1)
    single = Skeleton(("only",), np.array([-1]), np.zeros((1, 3)), np.array([True]))
    positions, _ = forward(Motion(single, 1.0, motion.root_pos, motion.rotations[:, :1]))
    np.testing.assert_array_equal(positions[:, 0], motion.root_pos)


@pytest.mark.parametrize(
    ("parents", "message"),
    [([0, -1], "must be the root"), ([-1, 1], "expected 0 to 0"), ([-1, -1], "one root")],
)
def test_skeletons_that_are_no_trees_are_refused(parents: list[int], message: str) -> None:
    with pytest.raises(SkeletonError, match=message):
        Skeleton(("a", "b"), np.array(parents), np.zeros((2, 3)), np.array([True, False]))


def test_tree_queries() -> None:
    skeleton = Skeleton(
        ("root", "hip", "knee", "spine"),
        np.array([-1, 0, 1, 0]),
        np.array([[0.0, 0, 1], [0, 0.1, 0], [0, 0, -0.4], [0, 0, 0.3]]),
        np.array([True, False, False, False]),
    )
    assert skeleton.children == ((1, 3), (2,), (), ())
    assert skeleton.ancestors(2) == (2, 1, 0)
    assert skeleton.subtree(1) == (1, 2)
    assert [level.tolist() for level in skeleton.levels] == [[0], [1, 3], [2]]
    np.testing.assert_allclose(skeleton.rest_positions[2], [0, 0.1, 0.6])


@pytest.mark.parametrize("frame_time", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_frame_times_are_refused(frame_time: float) -> None:
    made = random_motion(2, 2)
    with pytest.raises(ConventionError, match="frame time"):
        Motion(made.skeleton, frame_time, made.root_pos, made.rotations)
