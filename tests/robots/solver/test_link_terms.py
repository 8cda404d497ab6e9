"""Sums over links, against Jacobians that are written down."""

import numpy as np
import pytest

from robots.kinematics import LinkPoses, forward_kinematics
from robots.least_squares import NormalEquations
from robots.residuals import direction_residual, point_jacobian, rotation_residual
from robots.solver.block import Block
from robots.solver.link_terms import LinkTerms
from robots.tree import ROOT, Coordinates, Tree

FRAMES, WEIGHT = 3, 1.7
BONE = np.array([0.0, 0.6, -0.8])


def forked() -> Tree:
    """A hinge and a ball that carry two limbs, of two hinges and of a hinge and a ball."""
    anchors = np.array([[0, 0, 1], [0, 0, 1.2], [0, 0.3, 1.4], [0.1, 0.5, 1.4], [0, -0.3, 1.4]])
    anchors = np.vstack([anchors, [[0.2, -0.5, 1.3]]])
    axes = np.array([[1, 0, 0], [0, 0, 1], [0, 1, 0], [0.6, 0, 0.8], [0, 0, -1], [0, 0, 1.0]])
    return Tree(
        np.array([-1, 0, 1, 2, 1, 4]),
        anchors,
        axes,
        np.array([False, True, False, False, False, True]),
        np.full(6, -np.inf),
        np.full(6, np.inf),
        np.array([0.0, 0.0, 0.9]),
    )


def posed(tree: Tree) -> Coordinates:
    rng = np.random.default_rng(5)
    quats = rng.normal(size=(FRAMES, len(tree) + 1, 4))
    quats /= np.linalg.norm(quats, axis=2, keepdims=True)
    angles = rng.normal(size=(FRAMES, len(tree)))
    return Coordinates(rng.normal(size=(FRAMES, 3)), quats[:, -1], angles, quats[:, :-1])


def axes_of(poses: LinkPoses, block: Block, link: int) -> np.ndarray:
    axes = poses.angular_jacobian(block.free_joints(link))
    turns = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, FRAMES))
    return np.concatenate([turns, axes]) if block.base else axes


@pytest.mark.parametrize(
    ("joints", "base"), [(range(6), True), ((0, 1, 4), True), ((2, 3, 4, 5), False), ((3,), False)]
)
@pytest.mark.parametrize("turns_alone", [False, True])
def test_sums_are_those_of_jacobians(joints: range, base: bool, turns_alone: bool) -> None:
    tree = forked()
    poses, block = forward_kinematics(tree, posed(tree)), Block(tree, tuple(joints), base)
    wanted = forward_kinematics(tree, Coordinates(*(np.roll(x, 1, 0) for x in parts(tree))))
    written, summed = (NormalEquations(FRAMES, len(block.dofs)) for _ in range(2))
    terms = LinkTerms(poses, block, summed)
    rng = np.random.default_rng(6)
    for link in (ROOT, 1, 3, 4, 5):
        dofs, axes = block.local_dofs(block.free_joints(link)), axes_of(poses, block, link)
        shifts = np.zeros((3 if block.base else 0, 4, FRAMES))
        jacobian, residual = rotation_residual(
            poses.rotations[link], wanted.rotations[link], axes, WEIGHT
        )
        written.add(dofs, transposed(np.concatenate([shifts, jacobian])), residual)
        terms.add_rotation(link, wanted.rotations[link], WEIGHT)
        now, then = poses.direction(link, BONE), wanted.direction(link, BONE)
        jacobian, residual = direction_residual(now, then, axes, WEIGHT)
        written.add(dofs, transposed(np.concatenate([shifts[:, :3], jacobian])), residual)
        terms.add_direction(link, now, then, WEIGHT)
        if turns_alone or link == 3:
            continue
        point, weight = poses.point(link, BONE), rng.random((3, FRAMES))
        jacobian = point_jacobian(poses, block.free_joints(link), axes, point, base=base)
        target = wanted.point(link, BONE)
        written.add(dofs, transposed(jacobian * weight), (point - target) * weight)
        terms.add_point(link, point, target, weight)
        slope, frames = rng.normal(size=(1, 2)), np.array([0, 2])
        J, residual = np.zeros((FRAMES, len(dofs), 1)), np.zeros((1, FRAMES))
        J[frames] = transposed(jacobian[:, 2:, frames] * slope)
        residual[:, frames] = 0.3
        written.add(dofs, J, residual)
        terms.add_heights(link, point[:2, None, frames], residual[:, frames], slope, frames)
    terms.add_to_normal()
    np.testing.assert_allclose(summed.cost, written.cost, atol=1e-9)
    np.testing.assert_allclose(summed.g, written.g, atol=1e-9)
    np.testing.assert_allclose(np.triu(summed.H), np.triu(written.H), atol=1e-9)


def parts(tree: Tree) -> tuple[np.ndarray, ...]:
    q = posed(tree)
    assert q.ball_quats is not None
    return q.pos, q.quat, q.angles, q.ball_quats


def transposed(jacobian: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(jacobian.transpose(2, 0, 1))
