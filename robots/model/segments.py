"""Hinge chains collapsed into one joint a limb segment: three hinges of a hip are one hip."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.joint_centers import joint_centers, nearest_point
from robots.model.mjcf import Mjcf
from robots.tree import ROOT, Tree
from sim.body.mj_joints import BALL

_COS_PARALLEL = np.cos(np.radians(30))
"""Consecutive hinges nearer to parallel are two joints, as a hip's pitch and a knee. Within a joint
of the registry's robots they are 90 degrees apart."""
_NO_LIMIT = 1e3  # [rad] files that ask for a limit get such a one where there is none
_MAX_OFFSET_OF_SIZE = 0.025
"""How far the axes of one joint may pass from its centre, as a share of the diagonal around all
anchors. The G1's pass up to 2.3 cm from it, with a diagonal of 1.1 m."""
_MAX_OFFSET_OF_LIMB = 0.1
"""The same, as a share of the chain's length below; the larger counts. The hips of dm_control's
humanoid are 6.5 cm off."""
_MAX_DOFS = 3  # of a joint: a rotation has no more


@dataclass(frozen=True, eq=False)
class Segment:
    """A rigid part of the robot and the joints by which it hangs on `parent` (-1: it is the root).

    `link` is the tree's link that moves it; a part that is welded on has no joints and its parent's
    link. `center` [m] is the joint's place in the rest pose. `names` are what the file calls it.
    """

    parent: int
    joints: tuple[int, ...]
    link: int
    body: int
    center: Float[np.ndarray, "3"]
    names: tuple[str, ...]


def tree_of(mjcf: Mjcf) -> tuple[Tree, list[int]]:
    """The robot's hinges and balls as a kinematic tree, and the MuJoCo joint behind each."""
    model = mjcf.model
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0
    mujoco.mj_kinematics(model, data)
    joints = mjcf.joints()
    last: dict[int, int] = {mjcf.root: ROOT}
    parents = []
    for i, joint in enumerate(joints):
        body = int(model.jnt_bodyid[joint])
        above = body
        while above not in last:
            above = int(model.body_parentid[above])
        parents.append(last[above])
        last[body] = i
    ranges = model.jnt_range[joints] - model.qpos0[model.jnt_qposadr[joints]][:, None]
    limited = model.jnt_limited[joints].astype(bool) & (np.abs(ranges) < _NO_LIMIT).all(axis=1)
    tree = Tree(
        parents=np.array(parents, dtype=np.int64),
        anchors=data.xanchor[joints].reshape(-1, 3).copy(),
        axes=data.xaxis[joints].reshape(-1, 3).copy(),
        balls=np.array([int(model.jnt_type[j]) == BALL for j in joints], dtype=bool),
        lower=np.where(limited, ranges[:, 0], -np.inf),
        upper=np.where(limited, ranges[:, 1], np.inf),
        base=data.xpos[mjcf.root].copy(),
    )
    return tree, joints


def segments_of(mjcf: Mjcf, tree: Tree, joints: Sequence[int]) -> list[Segment]:
    """The robot's parts, parents first; the root is the first."""
    model = mjcf.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    groups = _groups(tree, [int(body) for body in model.jnt_bodyid[joints]])
    centers = joint_centers(tree, groups)
    segments = [Segment(-1, (), ROOT, mjcf.root, tree.base, (mjcf.body_name(mjcf.root),))]
    of_link = {ROOT: 0}
    of_body = {mjcf.root: 0}
    for group, center in zip(groups, centers, strict=True):
        body = int(model.jnt_bodyid[joints[group[-1]]])
        first = int(model.jnt_bodyid[joints[group[0]]])
        parent = of_link[int(tree.parents[group[0]])]
        of_link[group[-1]] = of_body[body] = len(segments)
        names = (
            mjcf.body_name(body),
            model.joint(joints[group[0]]).name,
            mjcf.body_name(first),
        )
        segments.append(Segment(parent, group, group[-1], body, center, names))
    welded = _welded(mjcf, of_body)
    for body in welded:
        parent = of_body[int(model.body_parentid[body])]
        name = (mjcf.body_name(body),)
        segments.append(
            Segment(parent, (), segments[parent].link, body, data.xpos[body].copy(), name)
        )
    return segments


def _welded(mjcf: Mjcf, of_body: dict[int, int]) -> list[int]:
    """Bodies with a shape that are fixed to a moving one and carry nothing: hands, feet, a head."""
    model = mjcf.model
    carrying = {int(model.body_parentid[body]) for body in mjcf.bodies()}
    return [
        body
        for body in mjcf.bodies()
        if body not in of_body
        and not model.body_jntnum[body]
        and model.body_geomnum[body]
        and int(model.body_parentid[body]) in of_body
        and body not in carrying
        and model.body(body).name
    ]


def _groups(tree: Tree, bodies: Sequence[int]) -> list[tuple[int, ...]]:
    """The tree's joints in groups that make one joint of a skeleton: consecutive hinges whose axes
    nearly meet, at most three; the joints of one body belong together in any case."""
    lengths = _chain_lengths(tree)
    size = float(np.linalg.norm(np.ptp(tree.anchors, axis=0))) if len(tree) else 0.0
    units: list[list[int]] = []
    for i, body in enumerate(bodies):
        if i and bodies[i - 1] == body:
            units[-1].append(i)
        else:
            units.append([i])
    carried = np.bincount(tree.parents[[unit[0] for unit in units]] + 1, minlength=len(tree) + 1)

    def meet(above: list[int], unit: list[int]) -> bool:
        """Whether they make one joint with the one that carries them alone."""
        parent, both = int(tree.parents[unit[0]]), [*above, *unit]
        if carried[parent + 1] != 1 or len(both) > _MAX_DOFS or tree.balls[both].any():
            return False
        parallel = abs(tree.axes[unit[0]] @ tree.axes[parent]) > _COS_PARALLEL
        _, offset = nearest_point(tree.anchors[both], tree.axes[both])
        allowed = max(_MAX_OFFSET_OF_SIZE * size, _MAX_OFFSET_OF_LIMB * lengths[unit[-1]])
        return bool(not parallel and offset <= allowed)

    groups: list[list[int]] = []
    of_joint: dict[int, int] = {}
    for unit in units:
        at = of_joint.get(int(tree.parents[unit[0]]))
        if at is not None and meet(groups[at], unit):
            groups[at] = [*groups[at], *unit]
        else:
            at = len(groups)
            groups.append(unit)
        of_joint.update(dict.fromkeys(unit, at))
    _leave_girdles_out(tree, groups, of_joint, meet)
    return [tuple(group) for group in groups]


def _leave_girdles_out(
    tree: Tree,
    groups: list[list[int]],
    of_joint: dict[int, int],
    meet: Callable[[list[int], list[int]], bool],
) -> None:
    """Where a limb begins with two hinges that meet, of which the second one also meets the next
    two, these three are its ball, as a shoulder's. The first one is a joint of its own, as a
    clavicle's, though its axis passes through theirs."""
    for lower in groups:
        parent = int(tree.parents[lower[0]])
        upper = groups[of_joint[parent]] if parent >= 0 else []
        above = int(tree.parents[upper[0]]) if upper else ROOT
        begins = above < 0 or int((tree.parents == above).sum()) > 1
        pairs = begins and len(upper) == len(lower) == 2 and parent == upper[1]
        if pairs and meet(upper[1:], lower[:1]) and meet([upper[1], lower[0]], lower[1:]):
            lower.insert(0, upper.pop())
            of_joint[lower[0]] = of_joint[lower[1]]


def _chain_lengths(tree: Tree) -> Float[np.ndarray, "N"]:
    """The length [m] of the longest chain of joints below each joint."""
    length = np.zeros(len(tree))
    for i in range(len(tree) - 1, -1, -1):
        parent = int(tree.parents[i])
        if parent >= 0:
            step = float(np.linalg.norm(tree.anchors[i] - tree.anchors[parent]))
            length[parent] = max(length[parent], length[i] + step)
    return length
