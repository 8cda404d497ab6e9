"""A stick man made by hand: round numbers, rest pose = T-pose: answers work out on paper."""

from dataclasses import replace

import numpy as np

from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from spark.skeleton import Skeleton

# name, parent, offset [m]: hips 0.9 m above the sole, ankles 0.1 m, thighs and shanks 0.4 m.
JOINTS: tuple[tuple[Role, Role | None, tuple[float, float, float]], ...] = (
    (Role.PELVIS, None, (0.0, 0.0, 0.9)),
    (Role.LEFT_UPPER_LEG, Role.PELVIS, (0.0, 0.1, 0.0)),
    (Role.LEFT_LOWER_LEG, Role.LEFT_UPPER_LEG, (0.0, 0.0, -0.4)),
    (Role.LEFT_FOOT, Role.LEFT_LOWER_LEG, (0.0, 0.0, -0.4)),
    (Role.LEFT_TOE, Role.LEFT_FOOT, (0.13, 0.0, -0.08)),
    (Role.RIGHT_UPPER_LEG, Role.PELVIS, (0.0, -0.1, 0.0)),
    (Role.RIGHT_LOWER_LEG, Role.RIGHT_UPPER_LEG, (0.0, 0.0, -0.4)),
    (Role.RIGHT_FOOT, Role.RIGHT_LOWER_LEG, (0.0, 0.0, -0.4)),
    (Role.RIGHT_TOE, Role.RIGHT_FOOT, (0.13, 0.0, -0.08)),
    (Role.SPINE, Role.PELVIS, (0.0, 0.0, 0.2)),
    (Role.NECK, Role.SPINE, (0.0, 0.0, 0.3)),
    (Role.HEAD, Role.NECK, (0.0, 0.0, 0.1)),
    (Role.LEFT_UPPER_ARM, Role.SPINE, (0.0, 0.2, 0.25)),
    (Role.LEFT_FOREARM, Role.LEFT_UPPER_ARM, (0.0, 0.3, 0.0)),
    (Role.LEFT_HAND, Role.LEFT_FOREARM, (0.0, 0.25, 0.0)),
    (Role.RIGHT_UPPER_ARM, Role.SPINE, (0.0, -0.2, 0.25)),
    (Role.RIGHT_FOREARM, Role.RIGHT_UPPER_ARM, (0.0, -0.3, 0.0)),
    (Role.RIGHT_HAND, Role.RIGHT_FOREARM, (0.0, -0.25, 0.0)),
)


def stick_rig() -> Rig:
    """The stick man's rig; toe tips and crown are End Sites."""
    order = [role for role, _, _ in JOINTS]
    toes = [order.index(Role.LEFT_TOE), order.index(Role.RIGHT_TOE)]
    parents = [-1 if parent is None else order.index(parent) for _, parent, _ in JOINTS]
    skeleton = Skeleton(
        names=tuple(role.value for role in order),
        parents=np.array(parents),
        offsets=np.array([offset for _, _, offset in JOINTS]),
        translating=np.array([parent is None for _, parent, _ in JOINTS]),
        end_parents=np.array([*toes, order.index(Role.HEAD)]),
        end_offsets=np.array([[0.07, 0.0, 0.0], [0.07, 0.0, 0.0], [0.0, 0.0, 0.2]]),
    )
    count = len(JOINTS)
    return Rig(
        skeleton=skeleton,
        roles=RoleMap(tuple(order), (1.0,) * count, ("by hand",) * count),
        groups=tuple(frozenset() for _ in JOINTS),
        tpose=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        root_joint=0,
        hip_height=0.9,
    )


def scaled(rig: Rig, factor: float) -> Rig:
    """The rig in another size."""
    skeleton = replace(
        rig.skeleton,
        offsets=factor * rig.skeleton.offsets,
        end_offsets=factor * rig.skeleton.end_offsets,
    )
    return replace(rig, skeleton=skeleton, hip_height=factor * rig.hip_height)


def stick_with(*rows: tuple[str, Role | str]) -> Rig:
    """The stick man with joints, each by its name and what it hangs on: a hand, or a name."""
    rig = stick_rig()
    skeleton, size = rig.skeleton, len(rig.skeleton) + len(rows)
    names = [*skeleton.names, *(name for name, _ in rows)]
    outwards = [[0.0, 0.1 if names.index(str(on)) < 15 else -0.1, 0] for _, on in rows]
    return replace(
        rig,
        skeleton=Skeleton(
            tuple(names),
            np.append(skeleton.parents, [names.index(str(on)) for _, on in rows]),
            np.concatenate([skeleton.offsets, outwards]),
            np.append(skeleton.translating, [False] * len(rows)),
            skeleton.end_parents,
            skeleton.end_offsets,
        ),
        roles=RoleMap((*rig.roles.roles, *[None] * len(rows)), (1.0,) * size, ("",) * size),
        tpose=np.tile([1.0, 0, 0, 0], (size, 1)),
    )


def joint(role: Role) -> int:
    """The stick man's joint with this role."""
    return [r for r, _, _ in JOINTS].index(role)


def standing(rig: Rig, frames: int, fps: float = 60.0) -> Motion:
    """The rig in its T-pose, soles on z = 0, for a while."""
    return Motion(
        skeleton=rig.skeleton,
        frame_time=1.0 / fps,
        root_pos=np.tile(rig.skeleton.offsets[0], (frames, 1)),
        rotations=np.tile([1.0, 0.0, 0.0, 0.0], (frames, len(rig.skeleton), 1)),
    )


def without(rig: Rig, *gone: Role) -> Rig:
    """The rig, under names of its own, where the joints of some roles have none."""
    roles = tuple(None if role in gone else role for role in rig.roles.roles)
    names = tuple(f"j{j}" for j in range(len(roles)))
    skeleton = replace(rig.skeleton, names=names)
    return replace(rig, skeleton=skeleton, roles=replace(rig.roles, roles=roles))
