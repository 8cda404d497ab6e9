"""What is near in a few frames, against a look at everything."""

import numpy as np

from robots.model.known import known
from robots.solver.near_spheres import NearSpheres
from robots.solver.window_poses import WindowPoses
from robots.solver.window_terms import Terms

EMBER = known("robot")
TERMS = Terms(EMBER, (), False)


def tangled(count: int) -> WindowPoses:
    """Poses with parts in each other and in the floor."""
    rng = np.random.default_rng(2)
    q = EMBER.to_qpos(EMBER.tpose).repeat(count, axis=0)
    q[:, 2] -= rng.uniform(0.0, 0.4, count)
    q[:, EMBER.addresses] += rng.normal(0.0, 0.7, (count, len(EMBER.addresses)))
    return TERMS.poses(q)


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
