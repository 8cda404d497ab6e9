"""One frame of a source as a robot's targets: what `robots.solver.targets` makes of a clip, without
what needs the whole clip, in a tenth of its time."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.contacts import has_feet
from robots.solver.targets import source_feet
from robots.solver.window_targets import PoseTargets
from robots.stream.copied_pose import Copier
from robots.stream.source_points import SourceFollower
from robots.stream.source_poses import SourcePoses
from spark.errors import FrameError
from spark.rig.contacts import standing_heights
from spark.rig.rig import Rig
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.noise import Noise, without_noise

LATENCY = 2  # [frames] between the newest frame of a stream and its answer
_ONES = np.ones((4, 1))
_MAX_NORM_ERROR = 0.05  # of a quaternion: beyond, it is not one that was merely rounded


class Frame(NamedTuple):
    """One frame of a source, as `spark.motion.Motion` has them: the root's place [m, world, Z up],
    local rotations (`q_parent_joint`, wxyz) of all joints and, where these move against their
    parents, all joints' local places [m]."""

    root_pos: Float[np.ndarray, "3"]
    rotations: Float[np.ndarray, "N 4"]
    translations: Float[np.ndarray, "N 3"] | None = None


@dataclass(frozen=True, eq=False)
class Ground:
    """The floor under a clip: its height `z` [m], and the lowest heights [m] of heel and toe of the
    feet that the robot's soles follow (1st percentile); and the clip's noise, where contacts don't
    bear it."""

    z: float
    low: Float[np.ndarray, "S 2"]
    noise: Noise | None = None


@dataclass(frozen=True, eq=False)
class FrameTargets(PoseTargets):
    """`robots.solver.targets.Targets` of one frame, or of some (T).

    `bones` are in the order of `FrameReader.bones`. `com` is the source's centre of mass, scaled.
    `feet` are the source's heel and toe of each of the robot's soles [m, the source's own world],
    `clearance` is how high its soles are, scaled, and `pitched` where the points of the robot's
    would be: from the middle of its toes along the foot and to its left, and above the lowest of
    them [m]. `parts` are its joints that may touch the ground, in the order of `FrameReader.parts`
    [m, the source's own world].
    """

    com: Float[np.ndarray, "*T 3"]
    feet: Float[np.ndarray, "*T S 2 3"]
    clearance: Float[np.ndarray, "*T S"]
    pitched: Float[np.ndarray, "*T P 3"]
    parts: Float[np.ndarray, "*T K 3"]


def raised(targets: FrameTargets, by: float) -> FrameTargets:
    """The targets of a body that is higher by so much [m]."""
    if not by:
        return targets
    up = np.array([0.0, 0.0, by])
    return replace(
        targets,
        hips=targets.hips + up,
        com=targets.com + up,
        clearance=targets.clearance + by,
    )


def joined(frames: Sequence[FrameTargets]) -> FrameTargets:
    """Those of some frames."""
    names = [field.name for field in fields(FrameTargets)]
    return FrameTargets(*(np.stack([getattr(frame, name) for frame in frames]) for name in names))


def move_on(targets: FrameTargets, newest: FrameTargets) -> None:
    """Take the targets of some frames on by one, in place."""
    new = vars(newest)
    for name, part in vars(targets).items():
        part[:-1] = part[1:]
        part[-1] = new[name]


def ground_of(source: CanonicalMotion, robot: Morphology) -> Ground:
    """The floor of a clip; of a T-pose alone, its soles' height."""
    source, noise, _ = without_noise(source)
    feet = source_feet(source, canonical_positions(source), robot)
    exist, low = has_feet(feet), np.zeros(feet.shape[1:3])
    if exist.any():
        low[exist] = standing_heights(feet[:, exist], source.rig.standing_height)
    return Ground(source.floor_z, low, noise)


class FrameReader:
    """Turns frames of motions on one rig into targets for one robot."""

    def __init__(self, source: Rig, robot: Morphology, ground: Ground) -> None:
        self.source, self.robot, self.ground = source, robot, ground
        self.scale = robot.rig.hip_height / source.hip_height
        self._poses = SourcePoses(source.skeleton)
        self._offsets = offsets = source.skeleton.offsets
        self._shapes = offsets[0].shape, source.tpose.shape, offsets.shape
        self._follower = SourceFollower(source, robot, self.scale, ground.z)
        self._copier = Copier(source, robot, ground.z)
        self.bones, self.parts = self._follower.bones, self._follower.parts
        self.has_feet, self.hands = self._follower.has_feet, self._follower.hands

    def targets(self, frame: Frame) -> FrameTargets:
        """The targets that a frame sets for the robot.

        Raises `FrameError` where it is not a frame of the source's skeleton.
        """
        world, joints = self._world(frame)
        points = self._follower.of(world, joints)
        copied = self._copier.of(world, joints, points)
        return FrameTargets(
            world=copied.world,
            chest=copied.chest,
            hips=points.hips,
            com=points.com,
            bones=points.bones,
            hands=points.hands,
            feet=points.feet,
            clearance=points.clearance,
            pitched=copied.pitched,
            parts=points.parts,
        )

    def _world(self, frame: Frame) -> tuple[Float[np.ndarray, "N 3 3"], Float[np.ndarray, "N 3"]]:
        """Rotations and places [m] of the source's joints."""
        root, rotations, translations = frame
        local = self._offsets if translations is None else translations
        shapes = np.shape(root), np.shape(rotations), np.shape(local)
        moved = root if translations is None else np.append(root, local)
        if shapes != self._shapes or not np.isfinite(moved).all():
            self._refuse(root, rotations, local)
        length = np.sqrt(np.square(rotations) @ _ONES)
        if not np.abs(length - 1).max() <= _MAX_NORM_ERROR:  # nor where it is not a number
            self._refuse(root, rotations, local)
        return self._poses.of(root, rotations / length, local)

    def _refuse(
        self,
        root: Float[np.ndarray, "..."],
        rotations: Float[np.ndarray, "..."],
        local: Float[np.ndarray, "..."],
    ) -> None:
        """Say what is wrong with a frame."""
        names, offsets = self.source.skeleton.names, self.source.skeleton.offsets
        for what, array, like in (
            ("root_pos", root, offsets[0]),
            ("rotations", rotations, self.source.tpose),
            ("translations", local, offsets),
        ):
            if np.shape(array) != like.shape:
                raise FrameError(
                    f"{what} has shape {np.shape(array)}; expected {like.shape}, as the source's "
                    "skeleton has it"
                )
            if not np.isfinite(array).all():
                where = f" of joint {names[_first_bad(array)]!r}" * (like.ndim - 1)
                raise FrameError(f"{what}{where} is not finite; leave the frame out")
        length = np.sqrt((rotations * rotations).sum(1))
        j = int(np.abs(length - 1).argmax())
        raise FrameError(
            f"the quaternion of joint {names[j]!r} has length {length[j]:.3g}; expected 1"
        )


def _first_bad(values: Float[np.ndarray, "N *D"]) -> int:
    return int(np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(1))[0])
