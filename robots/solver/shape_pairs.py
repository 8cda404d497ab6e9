"""Which of a robot's shapes can collide, and how far they are from each other."""

from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import carriers
from robots.solver.hulls import (
    SLABS,
    Shape,
    ShapePair,
    can_collide,
    shapes_of,
    signed_distance,
)
from robots.tree import Tree

_ONE_JOINT = 0.05  # hip heights between hinges that turn about one point


def pairs_of(robot: Morphology) -> tuple[ShapePair, ...]:
    """The pairs of the robot's colliding shapes, but for those of neighbouring bodies, those that
    the file excludes, and those that nothing moves against each other. What touches in the T-pose
    may stay as near as it is there; but parts around one joint of several hinges, in each other
    already there, are neighbours too.

    What no block moves, as fingers, is of the link that carries it, as the T-pose has it there.
    """
    mjcf, tree = robot.mjcf, robot.tree
    shapes = _carried_shapes(robot)
    poses = forward_kinematics(tree, robot.tpose)
    data = mujoco.MjData(mjcf.model)
    data.qpos[:] = robot.to_qpos(robot.tpose)[0]
    mujoco.mj_kinematics(mjcf.model, data)
    pairs = []
    for i, a in enumerate(shapes):
        for b in shapes[i + 1 :]:
            if not can_collide(mjcf, a, b):
                continue
            # The longer chain is the limb's end: the slender part.
            small, large = (a, b) if len(tree.chain(a.link)) >= len(tree.chain(b.link)) else (b, a)
            first = np.zeros(1, dtype=np.int64)
            at_tpose = distances(tree, poses, small.link, small.spheres, large, first)
            gap = float((at_tpose[:, 0] - small.radii).min())
            if gap < 0 and _at_one_joint(robot, small.link, large.link):
                apart = mujoco.mj_geomDistance(mjcf.model, data, a.geom, b.geom, 1.0, None)
                if apart < 0:
                    continue
            pairs.append(ShapePair(small, large, gap))
    return tuple(pairs)


def in_shape(
    tree: Tree,
    poses: LinkPoses,
    link: int,
    points: Float[np.ndarray, "S 3"],
    shape: Shape,
    at: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "3 S N"]:
    """Where points that a link carries are in some frames, in the rest pose of a shape [m], as
    exactly as the points are given."""
    exact = points.dtype
    outer, R = (
        poses.rotations[x].take(at, axis=2).astype(exact, copy=False) for x in (link, shape.link)
    )
    offset = poses.positions[link].take(at, axis=1) - poses.positions[shape.link].take(at, axis=1)
    offset = (R * offset.astype(exact, copy=False)[:, None]).sum(axis=0)
    offset += tree.anchor(shape.link).astype(exact)[:, None]
    relative = np.einsum("jit,jkt->ikt", R, outer)
    local: Float[np.ndarray, "3 S N"] = (points - tree.anchor(link)).astype(exact) @ relative
    local += offset[:, None]
    return local


def distances(
    tree: Tree,
    poses: LinkPoses,
    link: int,
    points: Float[np.ndarray, "S 3"],
    shape: Shape,
    at: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "S N"]:
    """The signed distance [m] of points that a link carries from a shape in some frames, to the
    micrometre: in half the time that it takes exactly."""
    return signed_distance(shape, in_shape(tree, poses, link, points.astype(np.float32), shape, at))


def nearest(
    poses: LinkPoses,
    link: int,
    points: Float[np.ndarray, "3 N"],
    shape: Shape,
    frames: Int[np.ndarray, "N"],
) -> tuple[Float[np.ndarray, "3 N"], Float[np.ndarray, "N"], Float[np.ndarray, "3 N"]]:
    """Of points that a link carries, one in each of some frames: where they are [m, world], their
    signed distance [m] from a shape, and the unit normal of its side there [world]."""
    near = poses.at(frames, {link, shape.link})
    paths = near.point(link, points)
    away = paths - near.positions[shape.link]
    inside = (near.rotations[shape.link] * away[:, None]).sum(axis=0)
    middle, half = shape.slabs[:, :, None]
    off = SLABS @ (inside + poses.tree.anchor(shape.link)[:, None]) - middle
    over = np.abs(off) - half
    at = over.argmax(axis=0), np.arange(len(frames))
    side = SLABS[at[0]].T * np.sign(off[at])
    return paths, over[at], near.direction(shape.link, side)


def _carried_shapes(robot: Morphology) -> list[Shape]:
    """The solid shapes, each of the link that carries it."""
    above, qpos = carriers(robot), robot.mjcf.model.qpos0.copy()
    tpose = robot.to_qpos(robot.tpose)[0]
    for link, carrier in enumerate(above):
        if carrier != link:
            own = int(robot.addresses[link]) + np.arange(4 if robot.tree.balls[link] else 1)
            qpos[own] = tpose[own]
    shapes = shapes_of(robot.mjcf, robot.mj_joints, qpos)
    return [replace(x, link=above[x.link]) if x.link >= 0 else x for x in shapes]


def _at_one_joint(robot: Morphology, outer: int, inner: int) -> bool:
    """Whether all hinges between two links turn about one point, as those of an ankle do."""
    tree = robot.tree
    chain = tree.chain(outer)
    if inner >= 0 and inner not in chain:
        return False
    between = chain[chain.index(inner) + 1 :] if inner >= 0 else chain
    anchors = tree.anchors[list(between)]
    reach = np.linalg.norm(anchors - anchors[0], axis=1).max()
    return bool(reach < _ONE_JOINT * robot.rig.hip_height)
