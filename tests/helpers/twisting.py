"""A body with twist bones, and one whose limbs turn as they are told."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.motion import Motion
from spark.rotation import quat_from_rotvec
from spark.skeleton import Skeleton
from tests.helpers.rigs import RIGS, build

# On each side: what carries the bone, which joint it lies towards, how far along, and its name.
BONES = (
    ("Arm", "ForeArm", 0.0, "ArmTwist01"),
    ("Arm", "ForeArm", 0.5, "ArmTwist02"),
    ("ForeArm", "Hand", 0.0, "ForeArmTwist01"),
    ("ForeArm", "Hand", 0.6, "ForeArmTwist02"),
    ("ForeArm", "Hand", 0.0, "ElbowShareBone"),
    ("UpLeg", "Leg", 0.25, "UpLegTwist01"),
    ("Leg", "Foot", 0.6, "LegTwist01"),
    ("Leg", "Foot", 0.0, "KneeShareBone"),
)


def plain() -> Skeleton:
    """The body without twist bones, which rests in the T-pose: its limbs are straight."""
    skeleton, _ = build(RIGS["lafan1"], ends=False)
    offsets = skeleton.offsets.copy()
    offsets[[n.endswith(("Arm", "Hand", "Leg", "Foot")) for n in skeleton.names], 0] = 0.0
    return replace(skeleton, offsets=offsets)


def with_bones(
    bones: tuple[tuple[str, str, float, str], ...] = BONES, aside: float = 0.0
) -> Skeleton:
    """The body with such bones on each side, `aside` [m] before the line of their segment."""
    skeleton = plain()
    names, parents = list(skeleton.names), skeleton.parents.tolist()
    offsets = skeleton.offsets.tolist()
    for side in ("Left", "Right"):
        for above, towards, along, name in bones:
            until = names.index(side + towards)
            names.append(side + name)
            parents.append(names.index(side + above))
            offsets.append((along * skeleton.offsets[until] + [aside, 0.0, 0.0]).tolist())
    return Skeleton(
        tuple(names),
        np.array(parents),
        np.array(offsets),
        np.arange(len(names)) == 0,
        skeleton.end_parents,
        skeleton.end_offsets,
    )


def turning(
    skeleton: Skeleton, turns: dict[str, Float[np.ndarray, "T 3"]], fps: float = 30.0
) -> Motion:
    """The body in T-pose, but for joints that turn by these rotation vectors [rad] against it."""
    count = len(next(iter(turns.values())))
    rotations = np.zeros((count, len(skeleton), 3))
    for name, rotvec in turns.items():
        rotations[:, skeleton.names.index(name)] = rotvec
    root = np.tile(skeleton.offsets[0], (count, 1))
    return Motion(skeleton, 1 / fps, root, quat_from_rotvec(rotations))
