"""What the measures look at: a motion's points, centre of mass and path, computed once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sim.anthropometry import RADII, Segments, segments
from spark.errors import SkeletonError
from spark.feet import SOLE_POINTS, sole_corners, sole_positions, standing_height
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig import Rig
from spark.roles import Role
from spark.rotation import quat_conj, quat_mul, quat_rotate, yaw_from_quat

# They have soles, or lie inside other flesh.
_NO_FLESH = ("foot", "toe", "clavicle")


@dataclass(frozen=True, eq=False)
class Track:
    """A motion's points over time [m, world].

    `points` are the soles' corners, named by `point_names` ("left heel inner") and `sides` ("left
    foot"); `joints` are the other joints with a role, named by `joint_names`, inside a sphere of
    flesh of radius `flesh` [m]. `com` is the centre of mass, `segment_coms` are those of the pieces
    of `body`; `hips` is the middle of the hip joints, `heading` [rad] the pelvis's turn about Z
    since the T-pose, without jumps. `positions` and `world` are the joints' as `forward` gives
    them; `since_tpose` is G, each joint's rotation since the T-pose in world axes.
    """

    motion: Motion
    rig: Rig
    points: Float[np.ndarray, "T P 3"]
    point_names: tuple[str, ...]
    sides: tuple[str, ...]
    joints: Float[np.ndarray, "T B 3"]
    joint_names: tuple[str, ...]
    flesh: Float[np.ndarray, "B"]
    segment_coms: Float[np.ndarray, "T S 3"]
    com: Float[np.ndarray, "T 3"]
    hips: Float[np.ndarray, "T 3"]
    heading: Float[np.ndarray, "T"]
    positions: Float[np.ndarray, "T J 3"]
    world: Float[np.ndarray, "T J 4"]
    since_tpose: Float[np.ndarray, "T J 4"]
    body: Segments

    def __len__(self) -> int:
        return len(self.com)

    @property
    def lowest_point(self) -> Float[np.ndarray, "T"]:
        """Height [m, world] of the lowest sole corner in each frame."""
        return self.points[..., 2].min(axis=1)


def track(motion: Motion, rig: Rig) -> Track:
    """Follow the motion. Raises SkeletonError where the rig has no foot or no leg to stand on."""
    soles = sole_corners(rig)
    if not soles:
        raise SkeletonError(
            "the body has no foot: floor contact can't be measured; name its feet in a role map"
        )
    positions, world = forward(motion)
    since_tpose = quat_mul(world, quat_conj(rig.tpose))
    body = segments(rig)
    coms = positions[:, body.joints] + quat_rotate(world[:, body.joints], body.coms)
    height = standing_height(rig)
    others = [
        (j, role)
        for j, role in enumerate(rig.roles.roles)
        if role is not None and kind_of(role) not in _NO_FLESH
    ]
    return Track(
        motion=motion,
        rig=rig,
        points=np.concatenate([sole_positions(s, positions, world) for s in soles], axis=1),
        point_names=tuple(f"{sole.side} {name}" for sole in soles for name in SOLE_POINTS),
        sides=tuple(f"{sole.side} foot" for sole in soles for _ in SOLE_POINTS),
        joints=positions[:, [j for j, _ in others]],
        joint_names=tuple(role.replace("_", " ") for _, role in others),
        flesh=height * np.array([RADII[kind_of(role)] for _, role in others]),
        segment_coms=coms,
        com=np.einsum("s,tsx->tx", body.masses, coms),
        hips=positions[:, rig.hips].mean(axis=1),
        heading=np.unwrap(yaw_from_quat(since_tpose[:, rig.pelvis])),
        positions=positions,
        world=world,
        since_tpose=since_tpose,
        body=body,
    )


def kind_of(role: Role) -> str:
    """`left_foot` to `foot`."""
    return role.removeprefix("left_").removeprefix("right_")
