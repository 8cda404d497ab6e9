"""A clip posed: where its soles, parts and mass are in every frame, computed once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from sim.report.lowest import lowest_points
from sim.report.mass import Mass, human_mass, model_mass
from sim.report.model_poses import ModelPoses, pose_model
from sim.trajectory import ModelTrajectory, Subject
from spark.errors import SkeletonError
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.feet import Sole, sole_positions
from spark.rig.flesh import RADII
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_mul

# They have soles, or lie inside other flesh.
_NO_FLESH = ("foot", "toe", "clavicle")


@dataclass(frozen=True, eq=False)
class ClipPoses:
    """Where a moving body is in every frame [m, world].

    `corners` are those of the soles, on the feet `corner_feet` ("left foot"). `part_points` are
    what else may touch the floor, of the parts `part_names`: the other joints with a role, inside
    spheres of flesh of `part_radii` [m], or the lowest points of a model's own geoms (radius 0).
    `finger_points` are the joints of fingers, of the hands `finger_hands` ("left hand"): they may
    not be under the floor, and carry nothing. A model's are among its parts.
    `carriers` are the model's bodies that corners and parts belong to; none without a model.
    `hips` is the middle of the hip joints. `positions` and `rotations` are those of the joints as
    `forward` gives them, `since_tpose` their rotations G since the T-pose in world axes.
    `model_poses` are those of `body`, where the motion has a model.
    """

    motion: Motion
    rig: Rig
    corners: Float[np.ndarray, "T P 3"]
    corner_feet: tuple[str, ...]
    part_points: Float[np.ndarray, "T B 3"]
    part_names: tuple[str, ...]
    part_radii: Float[np.ndarray, "B"]
    finger_points: Float[np.ndarray, "T F 3"]
    finger_hands: tuple[str, ...]
    carriers: Int[np.ndarray, "N"]
    mass: Mass
    hips: Float[np.ndarray, "T 3"]
    positions: Float[np.ndarray, "T J 3"]
    rotations: Float[np.ndarray, "T J 4"]
    since_tpose: Float[np.ndarray, "T J 4"]
    body: ModelTrajectory | None
    model_poses: ModelPoses | None

    def __len__(self) -> int:
        return len(self.hips)


def pose_clip(subject: Subject) -> ClipPoses:
    """Pose a motion frame by frame, on its model where it has one.

    Raises SkeletonError where the rig has no foot or no leg to stand on, and where the body has
    another number of frames.
    """
    motion, rig, body = subject.motion, subject.rig, subject.body
    check_frames(subject)
    positions, rotations = forward(motion)
    since_tpose = quat_mul(rotations, quat_conj(rig.tpose))
    fingers = rig.fingers if body is None else {}
    if body is None:
        model_poses, mass = None, human_mass(rig, positions, rotations)
        part_names, part_points, part_radii = _flesh(rig, positions)
        part_bodies: tuple[int, ...] = ()
    else:
        model_poses = pose_model(body)
        mass = model_mass(body, model_poses)
        part_names, part_points, part_bodies = lowest_points(body, model_poses, _feet_of(body, rig))
        part_radii = np.zeros(len(part_names))
    soles = soles_of(rig)
    corner_feet = feet_of(soles)
    corner_bodies = [] if body is None else _bodies_of(body, rig, soles)
    corners = np.concatenate([sole_positions(s, positions, rotations) for s in soles], axis=1)
    return ClipPoses(
        motion=motion,
        rig=rig,
        corners=corners,
        corner_feet=corner_feet,
        part_points=part_points,
        part_names=part_names,
        part_radii=part_radii,
        finger_points=positions[:, [*fingers.values()]],
        finger_hands=tuple(f"{bone.side} hand" for bone in fingers),
        carriers=np.array([*corner_bodies, *part_bodies], dtype=int),
        mass=mass,
        hips=positions[:, rig.hips].mean(axis=1),
        positions=positions,
        rotations=rotations,
        since_tpose=since_tpose,
        body=body,
        model_poses=model_poses,
    )


def check_frames(subject: Subject) -> None:
    """Raise SkeletonError where a subject's body has another number of frames than its motion."""
    motion, body = subject.motion, subject.body
    if body is not None and len(body.qpos) != len(motion):
        raise SkeletonError(
            f"the body has {len(body.qpos)} frames, the motion {len(motion)}; expected as many"
        )


def soles_of(rig: Rig) -> tuple[Sole, ...]:
    """The soles that a rig stands on. Raises SkeletonError where it has none."""
    if not rig.soles:
        raise SkeletonError(
            "the body has no foot, so its floor contact can't be measured: one without legs has no "
            "report; of another one, name the feet in a role map"
        )
    return rig.soles


def feet_of(soles: tuple[Sole, ...]) -> tuple[str, ...]:
    """The foot ("left foot") of each corner of some soles."""
    return tuple(f"{sole.side} foot" for sole in soles for _ in sole.joints)


def _flesh(
    rig: Rig, positions: Float[np.ndarray, "T J 3"]
) -> tuple[tuple[str, ...], Float[np.ndarray, "T B 3"], Float[np.ndarray, "B"]]:
    """The joints with flesh around them: names, places, radii."""
    others = [
        (j, role)
        for j, role in enumerate(rig.roles.roles)
        if role is not None and role.part not in _NO_FLESH
    ]
    radii = rig.standing_height * np.array([RADII[role.part] for _, role in others])
    names = tuple(role.replace("_", " ") for _, role in others)
    return names, positions[:, [j for j, _ in others]], radii


def _bodies_of(body: ModelTrajectory, rig: Rig, soles: tuple[Sole, ...]) -> list[int]:
    """The model's body below each corner."""
    names = rig.skeleton.names
    return [int(body.model.body(names[j]).id) for sole in soles for j in sole.joints.tolist()]


def _feet_of(body: ModelTrajectory, rig: Rig) -> dict[int, str]:
    """The model's parts that carry soles, by the number of their first body."""
    names, model = rig.skeleton.names, body.model
    return {
        int(model.body_weldid[model.body(names[j]).id]): f"{sole.side} foot"
        for sole in rig.soles
        for j in sole.joints.tolist()
    }
