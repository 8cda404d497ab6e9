"""What is near in a few frames, against a look at everything."""

import mujoco
import numpy as np
import pytest

from robots.model.known import known
from robots.model.shapes import surface_of
from robots.solver.block import blocks_of
from robots.solver.collision import collisions_of
from robots.solver.near_spheres import NearSpheres
from robots.solver.targets import targets_of
from robots.solver.window_dofs import as_slice
from robots.solver.window_poses import WindowPoses
from robots.solver.window_targets import PointTargets, pose_targets
from robots.solver.window_terms import Terms
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.transfer.canonical import to_canonical

EMBER = known("robot")
TERMS = Terms(EMBER, (), False)
ELBOW = int(EMBER.links[EMBER.rig.roles.require(Role.LEFT_FOREARM)])


def tangled(count: int) -> WindowPoses:
    """Poses with parts in each other and in the floor."""
    return TERMS.poses(tangled_qpos(count))


def tangled_qpos(count: int) -> np.ndarray:
    rng = np.random.default_rng(2)
    q = EMBER.to_qpos(EMBER.tpose).repeat(count, axis=0)
    q[:, 2] -= rng.uniform(0.0, 0.4, count)
    q[:, EMBER.addresses] += rng.normal(0.0, 0.7, (count, len(EMBER.addresses)))
    return q


def rolled() -> np.ndarray:
    """One of them, on its side."""
    q: np.ndarray = EMBER.to_qpos(EMBER.tpose)[0]
    q[3:7] = np.sqrt([0.3, 0.4, 0.2, 0.1])
    q[EMBER.addresses] += np.random.default_rng(5).normal(0.0, 0.5, len(EMBER.addresses))
    return q


def columns(spheres: NearSpheres) -> set[tuple[float, ...]]:
    return {tuple(column) for column in np.concatenate([spheres.numbers, spheres.sizes]).T}


def test_no_sphere_that_is_near_another_shape_is_missed() -> None:
    poses, collisions = tangled(6), TERMS._collisions
    assert (collisions._spheres.depth(poses) > 0).any()
    for t in range(6):
        one = poses.at(slice(t, t + 1))
        found, everything = TERMS.candidates(one), collisions._spheres
        near = np.flatnonzero(everything.depth(one)[0] > -0.03)
        assert columns(everything.at(near)) <= columns(found)
        assert len(found) < len(everything)


def test_nothing_that_touches_the_floor_is_missed() -> None:
    poses, floor = tangled(6), TERMS._floor
    low, depth = TERMS.low(poses), floor.depth(poses)
    assert np.flatnonzero((depth > 0).any(axis=0)).tolist() == [
        k for k in low.spheres.tolist() if (depth[:, k] > 0).any()
    ]
    np.testing.assert_allclose(low.depth, depth[:, low.spheres], atol=1e-12)
    assert len(low.spheres) < depth.shape[1]


def test_a_limb_alone_is_asked_what_it_is_asked_as_a_part_of_the_whole() -> None:
    """Parts that it does not move are not looked at: they have no say in its share of H and g."""
    arms, tree = blocks_of(EMBER)[1].joints, EMBER.tree
    limb = tuple(j for j in arms if j in tree.chain(ELBOW) or ELBOW in tree.chain(j))
    alone, dofs = Terms(EMBER, (), False, only=limb), tree.dofs(limb)
    q, rig = tangled_qpos(6), sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 30.0), rig).frames(0, len(q))
    normal = []
    for terms in (TERMS, alone):
        poses = terms.poses(q)
        targets = pose_targets(targets_of(walk, EMBER), ())
        holds = PointTargets(*np.zeros((2, len(q), terms.sole_count, 3)))
        asked, posture = terms.asked(targets, holds), terms.hinges.at_tpose
        normal.append(terms.linearize(q, poses, asked, posture, terms.candidates(poses)))
    (H, g), (own_H, own_g) = normal
    assert len(alone.candidates(poses)) < len(TERMS.candidates(poses))
    np.testing.assert_allclose(own_H, H[:, dofs][:, :, dofs], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(own_g, g[:, dofs], rtol=1e-9, atol=1e-9)


def test_a_shape_that_moves_is_inside_its_sides_and_touches_them() -> None:
    """Against the points of its surface where MuJoCo puts them."""
    model, data = EMBER.mjcf.model, mujoco.MjData(EMBER.mjcf.model)
    data.qpos[:] = rolled()
    mujoco.mj_kinematics(model, data)
    poses, polytopes = TERMS.poses(data.qpos[None]), TERMS._collisions._spheres.polytopes
    shapes = list({pair.large.geom: pair.large for pair in collisions_of(EMBER).pairs}.values())
    for k, shape in enumerate(shapes):
        points = surface_of(model, data, shape.geom)
        which = np.full(len(points), k)
        beyond = polytopes.beyond(poses, which, points.T[:, None])[:, 0]
        np.testing.assert_allclose(beyond.max(axis=1), 0.0, atol=1e-9)
        side = int(beyond[:, 0].argmax())
        normal, sides = np.empty((3, 1, 1)), np.array([[side]])
        polytopes.normals(poses, which[:1], sides, out=normal)
        out = points[:1].T[:, None] + 0.01 * normal
        farther = polytopes.beyond(poses, which[:1], out)[side, 0, 0]
        assert farther == pytest.approx(beyond[side, 0] + 0.01)


def test_numbers_that_follow_each_other_pick_the_same_as_a_slice() -> None:
    values = np.arange(10)
    for numbers in (np.array([3, 4, 5]), np.array([3, 5, 4]), np.zeros(0, dtype=int)):
        np.testing.assert_array_equal(values[as_slice(numbers)], values[numbers])
    assert isinstance(as_slice(np.array([3, 4, 5])), slice)


def test_the_mass_of_one_pose_is_where_it_is_among_others() -> None:
    poses = TERMS.poses(np.array([rolled(), EMBER.to_qpos(EMBER.tpose)[0]]))
    np.testing.assert_array_equal(TERMS.com(rolled()), poses.com[0])
