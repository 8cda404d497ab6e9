"""Robots without legs, on wheels or a pedestal: an upper body that stays on its base.

To be compared with people they need a pelvis, an up and a forward. Thighs and shanks without shape
or joints, welded to the base below head and shoulders, give them that; nothing else sees them.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from robots.model.parts import skeleton_of, telling_names
from robots.model.posing import half_bent
from robots.model.segments import Segment
from robots.model.welded import Points
from robots.tree import ROOT, Tree
from spark.errors import SkeletonError
from spark.rig.anatomy import NoLegsError
from spark.rig.override import Override
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role, RoleMap

_NAMES = ("virtual_left_thigh", "virtual_left_shank", "virtual_right_thigh", "virtual_right_shank")
_HIP_HEIGHT, _KNEE_HEIGHT = 0.53, 0.285  # of the height of a human: Drillis and Contini 1966
_TRUNK = 1.5  # of an upper arm: from the shoulders down to the hips at least
_SHANK = 0.9  # of a thigh
_HALF_WIDTH = 0.05  # of the same, from the body's middle to a hip
_ARMS = tuple(
    Role(f"{side}_{part}") for side in ("left", "right") for part in ("upper_arm", "forearm")
)


def roles_and_parts(
    tree: Tree, segments: list[Segment], points: Points, override: Override | None
) -> tuple[RoleMap, list[Segment], Points, bool]:
    """The roles of a robot's parts; the parts, with virtual legs where it has none; and whether it
    has none. Raises `SkeletonError` where it has no arms either, or is no humanoid in another way.
    """

    def roles_of(segments: list[Segment], points: Points) -> RoleMap:
        skeleton = skeleton_of(segments, points, telling_names(segments))
        return assign_roles(skeleton, None, override, half_bent(tree, segments, skeleton))

    try:
        return roles_of(segments, points), segments, points, False
    except NoLegsError as error:
        try:
            return *_with_legs(segments, points, roles_of), True
        except SkeletonError:
            raise error from None


def _with_legs(
    segments: list[Segment], points: Points, roles_of: Callable[[list[Segment], Points], RoleMap]
) -> tuple[RoleMap, list[Segment], Points]:
    """The roles and the parts with virtual legs: under the middle of all parts first, then under
    head or shoulders. Raises `SkeletonError` where there are no arms."""
    middle, lateral = np.mean([s.center for s in segments], axis=0), np.array([0.0, 1, 0])
    highest = np.inf
    for _ in range(2):
        legged = [*segments, *_legs(segments, points, middle, lateral, highest)]
        shapes = [*points, *(np.zeros((0, 3)) for _ in _NAMES)]
        for k in (-3, -1):  # the shanks' ends
            thigh = legged[k].center - legged[k - 1].center
            shapes[k] = (legged[k].center + _SHANK * thigh)[None]
        found = roles_of(legged, shapes)
        left, elbow, right, _ = (legged[found.require(role)].center for role in _ARMS)
        across = (left - right) * np.array([1.0, 1, 0])
        lateral = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-6 else lateral
        tops = [j for r in (Role.HEAD, Role.NECK, Role.SPINE) for j in found.joints(r)[-1:]]
        middle = legged[tops[0]].center if tops else (left + right) / 2
        # below the trunk, or up would be down: a robot may stand on its waist
        highest = float(min(left[2], right[2], *(legged[j].center[2] for j in tops)))
        highest -= _TRUNK * float(np.linalg.norm(elbow - left))
    return found, legged, shapes


def _legs(
    segments: list[Segment],
    points: Points,
    middle: Float[np.ndarray, "3"],
    lateral: Float[np.ndarray, "3"],
    highest: float,
) -> list[Segment]:
    """Thighs and shanks as long as a human's of the robot's height, left before right; the hips
    under `middle`, at most `highest` [m]."""
    every = np.concatenate([np.array([s.center for s in segments]), *points])
    low, high = float(every[:, 2].min()), float(every[:, 2].max())
    height = high - low
    legs = []
    for k, name in enumerate(_NAMES):
        side, shank = (1.0, -1.0)[k // 2], k % 2
        z = min(low + height * _HIP_HEIGHT, highest)
        z -= height * (_HIP_HEIGHT - _KNEE_HEIGHT) if shank else 0.0
        center = np.array([*middle[:2], z]) + side * _HALF_WIDTH * height * lateral
        parent = len(segments) + k - 1 if shank else 0
        legs.append(Segment(parent, (), ROOT, segments[0].body, center, (name,)))
    return legs


def standing_height(points: Points, base: Float[np.ndarray, "3"]) -> float:
    """How high [m] the base is where the lowest of the shapes stands on the floor."""
    shaped = [own for own in points if len(own)]
    return float(base[2] - min(own[:, 2].min() for own in shaped)) if shaped else float(base[2])
