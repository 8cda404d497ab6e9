"""Jacobians beside central differences, for hinges and balls, with and without the base's dofs."""

from collections.abc import Callable

import numpy as np
import pytest
from jaxtyping import Float

from robots.kinematics import LinkPoses, forward_kinematics
from robots.least_squares import NormalEquations
from robots.residuals import (
    direction_residual,
    limit_residual,
    one_sided,
    point_jacobian,
    rotation_residual,
    twists,
)
from robots.tree import BASE, Coordinates, Tree
from spark.rotation import matrix_from_quat, quat_normalize

FRAMES, STEP = 3, 1e-6
LINK = 4
BONE, POINT = np.array([0.6, 0.0, 0.8]), np.array([0.3, -0.2, 1.4])


@pytest.fixture
def tree() -> Tree:
    """A chain of two hinges, a ball and a hinge, and a hinge beside it, askew in space."""
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(5, 3))
    return Tree(
        parents=np.array([-1, 0, 0, 1, 3]),
        anchors=rng.normal(size=(5, 3)),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        balls=np.array([False, False, False, True, False]),
        lower=np.array([-1.0, -2.0, -0.1, -np.inf, -0.5]),
        upper=np.array([1.0, 0.5, 0.1, np.inf, 3.0]),
        base=np.array([0.1, 0.2, 0.9]),
    )


@pytest.fixture
def q(tree: Tree) -> Coordinates:
    rng = np.random.default_rng(1)
    return Coordinates(
        rng.normal(size=(FRAMES, 3)),
        quat_normalize(rng.normal(size=(FRAMES, 4))),
        rng.normal(size=(FRAMES, len(tree))),
        quat_normalize(rng.normal(size=(FRAMES, len(tree), 4))),
    )


def differences(
    function: Callable[[LinkPoses], np.ndarray], tree: Tree, q: Coordinates
) -> Float[np.ndarray, "D *n"]:
    """The derivatives of a function of the poses by all dofs, by central differences."""
    out = []
    for dof in range(tree.nv):
        step = np.zeros((FRAMES, tree.nv))
        step[:, dof] = STEP
        after, before = (
            function(forward_kinematics(tree, q.integrated(tree, sign * step))) for sign in (1, -1)
        )
        out.append((after - before) / (2 * STEP))
    return np.array(out)


def chain_axes(tree: Tree, poses: LinkPoses) -> tuple[list[int], Float[np.ndarray, "C 3 T"]]:
    """The dofs that turn the link, the base's included, and their axes."""
    chain = tree.chain(LINK)
    base = np.repeat(np.eye(3)[:, :, None], FRAMES, axis=2)
    return [3, 4, 5, *tree.dofs(chain)], np.concatenate([base, poses.angular_jacobian(chain)])


def targets(shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng(2).normal(size=shape)


def test_points_move_as_their_jacobian_says(tree: Tree, q: Coordinates) -> None:
    poses = forward_kinematics(tree, q)
    chain = tree.chain(LINK)
    dofs, axes = chain_axes(tree, poses)
    point = poses.point(LINK, POINT)
    numeric = differences(lambda p: p.point(LINK, POINT), tree, q)
    whole = np.zeros_like(numeric)
    whole[[0, 1, 2, *dofs]] = point_jacobian(poses, chain, axes, point, base=True)
    np.testing.assert_allclose(whole, numeric, atol=1e-7)
    joints = point_jacobian(poses, chain, axes[3:], point, base=False)
    np.testing.assert_allclose(joints, numeric[dofs[3:]], atol=1e-7)
    beside = tree.dofs((2,))
    assert np.abs(numeric[beside]).max() == 0  # a joint beside the chain moves nothing on it
    assert np.abs(numeric[BASE:]).max() > 0.1


def test_pushes_say_how_far_points_yield(tree: Tree, q: Coordinates) -> None:
    """Two points of a link, each pushed along its own vector, with one set of twists."""
    points, pushes = np.array([POINT, POINT + BONE]), targets((2, 3, FRAMES))
    chain = tree.chain(LINK)
    poses = forward_kinematics(tree, q)
    moved = twists(poses, chain, poses.positions[LINK], base=True)
    dofs = [*range(BASE), *tree.dofs(chain)]
    normal = NormalEquations(FRAMES, tree.nv)
    wrenches = np.zeros((FRAMES, 6, 2))
    numeric = np.zeros((FRAMES, tree.nv, 2))
    for k, (rest, push) in enumerate(zip(points, pushes, strict=True)):
        arm = poses.point(LINK, rest) - poses.positions[LINK]
        wrenches[:, :, k] = np.concatenate([np.cross(arm, push, axis=0), push]).T

        def along(poses: LinkPoses, rest: np.ndarray = rest, push: np.ndarray = push) -> np.ndarray:
            return (poses.point(LINK, rest) * push).sum(0)

        numeric[:, :, k] = differences(along, tree, q).T
    np.testing.assert_allclose(moved @ wrenches, numeric[:, dofs], atol=1e-7)
    residuals = targets((2, FRAMES))
    squares, sums = (
        wrenches @ wrenches.transpose(0, 2, 1),
        np.einsum("tmk,kt->tm", wrenches, residuals),
    )
    normal.add_moved(np.arange(FRAMES), dofs, moved, squares, sums)
    expected = numeric @ numeric.transpose(0, 2, 1)
    np.testing.assert_allclose(np.triu(normal.H), np.triu(expected), atol=1e-6)
    np.testing.assert_allclose(normal.g, np.einsum("tdk,kt->td", numeric, residuals), atol=1e-6)


@pytest.mark.parametrize("weight", [1.0, 3.0, np.array([1.0, 2.0, 0.5])])
def test_directions_turn_as_their_jacobian_says(
    tree: Tree, q: Coordinates, weight: float | np.ndarray
) -> None:
    target = targets((3, FRAMES))

    def residual(poses: LinkPoses) -> np.ndarray:
        _, axes = chain_axes(tree, poses)
        return direction_residual(poses.direction(LINK, BONE), target, axes, weight)[1]

    poses = forward_kinematics(tree, q)
    dofs, axes = chain_axes(tree, poses)
    jacobian, _ = direction_residual(poses.direction(LINK, BONE), target, axes, weight)
    np.testing.assert_allclose(jacobian, differences(residual, tree, q)[dofs], atol=1e-7)


@pytest.mark.parametrize("weight", [1.0, np.array([1.0, 2.0, 0.5])])
def test_rotations_cost_one_less_the_cosine_and_have_its_gradient(
    tree: Tree, q: Coordinates, weight: float | np.ndarray
) -> None:
    """Their Jacobian is exact at the target only; the gradient of the cost is everywhere."""
    quats = quat_normalize(targets((FRAMES, 4)))
    target = np.moveaxis(matrix_from_quat(quats), 0, -1)

    def cost(poses: LinkPoses) -> np.ndarray:
        _, axes = chain_axes(tree, poses)
        residual = rotation_residual(poses.rotations[LINK], target, axes, weight)[1]
        return 0.5 * (residual**2).sum(0)

    poses = forward_kinematics(tree, q)
    cosine = (np.einsum("ijt,ijt->t", poses.rotations[LINK], target) - 1) / 2
    np.testing.assert_allclose(cost(poses), weight**2 * (1 - cosine), atol=1e-12)
    dofs, axes = chain_axes(tree, poses)
    jacobian, residual = rotation_residual(poses.rotations[LINK], target, axes, weight)
    gradient = np.einsum("cmt,mt->ct", jacobian, residual)
    np.testing.assert_allclose(gradient, differences(cost, tree, q)[dofs], atol=1e-7)
    at_target = rotation_residual(poses.rotations[LINK], poses.rotations[LINK], axes, weight)

    def near(moved: LinkPoses) -> np.ndarray:
        return rotation_residual(moved.rotations[LINK], poses.rotations[LINK], axes, weight)[1]

    np.testing.assert_allclose(at_target[0], differences(near, tree, q)[dofs], atol=1e-7)


def test_limits_push_back_and_only_near_them(tree: Tree, q: Coordinates) -> None:
    def residual(angles: np.ndarray) -> np.ndarray:
        moved = Coordinates(q.pos, q.quat, angles, q.ball_quats)
        return limit_residual(tree, moved, margin=0.1, weight=5.0)[0]

    derivatives = limit_residual(tree, q, margin=0.1, weight=5.0)[1]
    numeric = np.zeros_like(derivatives)
    for j in np.flatnonzero(~tree.balls):
        step = np.zeros(q.angles.shape)
        step[:, j] = STEP
        change = (residual(q.angles + step) - residual(q.angles - step)) / (2 * STEP)
        at = tree.dof_starts[j]
        numeric[:, at] = change[:, at]
        assert np.abs(np.delete(change, at, axis=1)).max() == 0
    np.testing.assert_allclose(derivatives, numeric, atol=1e-7)
    inside = residual(np.tile([0.0, -0.75, 0.0, 0.0, 1.25], (FRAMES, 1)))  # the limits' middle
    wide = tree.dof_starts[[0, 1, 4]]
    assert np.abs(inside[:, wide]).max() < 0.01
    beyond = residual(np.tile(np.where(tree.balls, 0.0, tree.upper + 0.3), (FRAMES, 1)))
    np.testing.assert_allclose(beyond[:, wide], 5.0 * (0.3 + 0.1), rtol=0.01)


def test_one_sided_is_the_maximum_but_near_zero() -> None:
    x = np.linspace(-1, 1, 201)
    value, slope = one_sided(x, 0.02)
    np.testing.assert_allclose(value, np.maximum(x, 0), atol=0.01 + 1e-12)
    np.testing.assert_allclose(value[x < -0.2], 0, atol=1e-3)
    numeric = (one_sided(x + STEP, 0.02)[0] - one_sided(x - STEP, 0.02)[0]) / (2 * STEP)
    np.testing.assert_allclose(slope, numeric, atol=1e-6)
