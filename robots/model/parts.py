"""A robot's rigid parts as the joints of a skeleton, and what they are called."""

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.mjcf import Mjcf
from robots.model.segments import Segment
from robots.model.shapes import surface
from robots.model.welded import Points, within, without
from spark.rig.name_hints import read_names
from spark.skeleton import Skeleton

_LEAST_MASS = 1e-3  # [kg] less is what bodies without a mass are given


def telling_names(segments: Sequence[Segment]) -> tuple[str, ...]:
    """For each part the name that says most about its role: of its first joint, its own body, or
    that joint's. Of equals the joint's wins: `Left_Elbow_Yaw` may move a `left_hand_link`."""
    candidates = [
        [_without_kind(segment.names[min(k, len(segment.names) - 1)]) for segment in segments]
        for k in (1, 0, 2)
    ]
    hints = [read_names(names) for names in candidates]
    telling = []
    for i in range(len(segments)):
        # A part named for sure counts 1; a side, then a finger or the like, breaks ties.
        scores = [
            max(h[i].parts.values(), default=0.0) + 0.1 * bool(h[i].side) + 0.05 * bool(h[i].aside)
            for h in hints
        ]
        telling.append(candidates[int(np.argmax(scores))][i])
    return tuple(telling)


def _without_kind(name: str) -> str:
    """The name without its ending for the kind of element: `left_knee_joint` -> `left_knee`."""
    for word in ("_joint", "_link", "_body"):
        if name.lower().endswith(word):
            return name[: -len(word)]
    return name


def shaped_parts(mjcf: Mjcf, segments: Sequence[Segment]) -> tuple[list[Segment], Points, Points]:
    """The parts, points on the surface of each [m, rest pose's world], and the same with those of
    what is welded to it. That is no part of its own where it does not reach beyond what carries
    it, as heads and hands do, and cameras and guards don't. The first of a part without shapes are
    where it ends by its masses."""
    points = [surface(mjcf, _welded_to(mjcf, segment.body, segments)) for segment in segments]
    inside = within(segments, points)
    shapes = list(points)
    for i in sorted(inside):
        above = segments[i].parent
        shapes[above] = np.concatenate([shapes[above], points[i]])
    ends = [
        own if len(own) else _mass_end(mjcf, segment, segments)
        for own, segment in zip(points, segments, strict=True)
    ]
    segments, kept = without(segments, inside)
    return segments, [ends[k] for k in kept], [shapes[k] for k in kept]


def _mass_end(
    mjcf: Mjcf, segment: Segment, segments: Sequence[Segment]
) -> Float[np.ndarray, "_ 3"]:
    """The point [m] of which a part's centre of mass is halfway from its joint, as of a rod; none
    without a mass."""
    bodies = _welded_to(mjcf, segment.body, segments)
    masses = mjcf.model.body_mass[bodies]
    if masses.sum() < _LEAST_MASS or not mjcf.model.body_ipos[bodies].any():  # not filled in
        return np.zeros((0, 3))
    data = mujoco.MjData(mjcf.model)
    mujoco.mj_kinematics(mjcf.model, data)
    mujoco.mj_comPos(mjcf.model, data)
    return (2 * np.average(data.xipos[bodies], axis=0, weights=masses) - segment.center)[None]


def _welded_to(mjcf: Mjcf, body: int, segments: Sequence[Segment]) -> list[int]:
    """The body and those that are welded to it, but for those that are parts of their own."""
    own = {segment.body for segment in segments} - {body}
    model = mjcf.model
    inside = {body}
    for other in mjcf.bodies():
        above = int(model.body_parentid[other])
        if above in inside and other not in own and not model.body_jntnum[other]:
            inside.add(other)
    return sorted(inside)


def skeleton_of(
    segments: Sequence[Segment],
    points: Sequence[Float[np.ndarray, "_ 3"]],
    names: tuple[str, ...],
) -> Skeleton:
    """The parts as joints of a skeleton; an End Site at the far end of each childless part."""
    parents = np.array([segment.parent for segment in segments])
    centers = np.array([segment.center for segment in segments])
    offsets = centers - np.where(parents[:, None] < 0, 0.0, centers[parents])
    leaves = [i for i in range(len(segments)) if i not in parents and len(points[i])]
    ends = [_far_end(points[i] - centers[i]) for i in leaves]
    return Skeleton(
        names=names,
        parents=parents,
        offsets=offsets,
        translating=np.arange(len(segments)) == 0,
        end_parents=np.array(leaves, dtype=np.int64),
        end_offsets=np.array(ends).reshape(-1, 3),
    )


def _far_end(points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "3"]:
    """The end [m, from the joint] of a part, on the line from its joint through its middle."""
    middle = (points.max(0) + points.min(0)) / 2
    length = float(np.linalg.norm(middle))
    if length < 1e-6:
        return points[int(np.argmax(np.linalg.norm(points, axis=1)))]
    along = middle / length
    return along * float((points @ along).max())
