"""What a robot is asked to do: the source's pose, path and contacts in the robot's own measures."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from robots.model.morphology import Morphology
from robots.solver.contacts import has_feet, schedule, touching_joint
from robots.solver.ground import Climb, level_climb, under_soles
from robots.solver.hands import between_hands
from robots.solver.level_feet import level_across
from robots.solver.limb_jerk import limb_jerks
from robots.solver.palms import laid, resting_palms
from robots.solver.trunk import bowing
from spark.blocks import blocks
from spark.rig.directions import bone_directions
from spark.rig.feet import ends_of_feet, lowest_points
from spark.rig.rig import Rig
from spark.rig.roles import HANDS, Role
from spark.rotation import matrix_from_quat, quat_mul
from spark.transfer.analytic import copied
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.distance_field import DistanceField
from spark.transfer.noise import Noise
from spark.transfer.self_touch import SelfTouch, self_touches

HOVERS = (
    "in most frames nothing of the source stands on the floor, though it does not fall: does it "
    "walk in place, as on a treadmill? The robot's feet pass over the floor and carry nothing there"
)


@dataclass(frozen=True, eq=False)
class Targets:
    """Over frames, floor at z = 0: `world`, the rig's joints' rotations (`q_world_joint`); `chest`,
    that of the topmost part of the trunk; `hips`, the path of the hips' middle [m]; `bones`, unit
    directions by the role at a segment's upper end; `contacts`, whether heel and toe of each of the
    robot's soles stand, `parts`, whether those of `part_roles` touch the floor, `rests`, whether
    they also stay in place, `palms`, how far (0 to 1) hands are firm, `flight`, whether nothing
    holds the body; `com_acceleration`, the source's, scaled [m/s²]; `part_paths` and `feet`, the
    paths of the source's parts, and of its heels and toes, over the floor [m]; `part_ground`, how
    high that under each part is, `ground` and `floor`, those of each sole (`GroundUnderSoles`), and
    `clearance`, how high the source's soles are over it, scaled; `jerks`, how jerky the source's
    limbs are (`robots.solver.limb_jerk`); `seats`, how high the hips are where the body sits on
    something, else 0 [m]; `hands`, from the right hand to the left [m]; `self_touches`, what hands
    touch of their own body; `around`, the distance from stated ground. `com` [m] is planned where
    it is known.
    """

    frame_time: float
    world: Float[np.ndarray, "T J 4"]
    chest: Float[np.ndarray, "T 4"]
    hips: Float[np.ndarray, "T 3"]
    bones: dict[Role, Float[np.ndarray, "T 3"]]
    contacts: Bool[np.ndarray, "T S 2"]
    parts: Bool[np.ndarray, "T B"]
    rests: Bool[np.ndarray, "T B"]
    part_roles: tuple[Role, ...]
    part_paths: Float[np.ndarray, "T B 2"]
    part_ground: Float[np.ndarray, "T B"]
    palms: dict[Role, Float[np.ndarray, "T"]]
    flight: Bool[np.ndarray, "T"]
    com_acceleration: Float[np.ndarray, "T 3"]
    feet: Float[np.ndarray, "T S 2 2"]
    clearance: Float[np.ndarray, "T S"]
    jerks: Float[np.ndarray, "T 4"]
    ground: Float[np.ndarray, "T S"]
    floor: Float[np.ndarray, "T S"]
    seats: Float[np.ndarray, "T"]
    hands: Float[np.ndarray, "T 3"] | None
    self_touches: tuple[SelfTouch, ...]
    notes: tuple[str, ...]
    around: DistanceField | None = None
    com: Float[np.ndarray, "T 3"] | None = None

    def __len__(self) -> int:
        return len(self.hips)

    @cached_property
    def turns(self) -> Float[np.ndarray, "J 3 3 T"]:
        """`world` as matrices."""
        return np.ascontiguousarray(np.moveaxis(matrix_from_quat(self.world), 0, -1))

    @cached_property
    def chest_turn(self) -> Float[np.ndarray, "3 3 T"]:
        """`chest` as matrices."""
        return np.ascontiguousarray(np.moveaxis(matrix_from_quat(self.chest), 0, -1))

    def every(self, stride: int) -> "Targets":
        """Those of every `stride`-th frame."""
        coarse = self.at(slice(None, None, stride))
        return replace(coarse, frame_time=stride * self.frame_time)

    def at(self, frames: slice | Int[np.ndarray, "S"]) -> "Targets":
        """Those of some frames."""
        return replace(
            self,
            world=self.world[frames],
            chest=self.chest[frames],
            hips=self.hips[frames],
            bones={role: bone[frames] for role, bone in self.bones.items()},
            contacts=self.contacts[frames],
            parts=self.parts[frames],
            rests=self.rests[frames],
            part_paths=self.part_paths[frames],
            part_ground=self.part_ground[frames],
            palms={role: palm[frames] for role, palm in self.palms.items()},
            flight=self.flight[frames],
            com_acceleration=self.com_acceleration[frames],
            feet=self.feet[frames],
            clearance=self.clearance[frames],
            jerks=self.jerks[frames],
            ground=self.ground[frames],
            floor=self.floor[frames],
            seats=self.seats[frames],
            com=None if self.com is None else self.com[frames],
            hands=None if self.hands is None else self.hands[frames],
            self_touches=tuple(touch.at(frames) for touch in self.self_touches),
        )


def targets_of(
    source: CanonicalMotion,
    robot: Morphology,
    noise: Noise | None = None,
    climb: Climb | None = None,
) -> Targets:
    """The targets that `source` sets for `robot`; `noise` is what its recording trembled by, and
    `climb` what it stands on: a level floor where it is not given."""
    positions = canonical_positions(source)
    world, hips, notes = poses_of(source, positions, robot)
    rig = source.rig
    own_chest = robot.rig.chest
    bones = bone_directions(rig, positions, source.rotations)
    paths = source_feet(source, positions, robot)
    clearance = source_clearance(source, positions, robot)
    climb = level_climb(source) if climb is None else climb
    under = for_soles(climb.heights, rig, robot)
    paths[..., 2] -= under[..., None]
    relief = None if climb.relief is None else for_soles(climb.relief, rig, robot)
    if relief is not None:
        paths[..., 2] -= relief
    scale = robot.rig.hip_height / rig.hip_height
    sides = [sole.side for sole in robot.soles]
    touches = schedule(source, positions, paths, sides, climb.ground, noise)
    touching = [j for r in touches.part_roles if (j := touching_joint(rig, r)) is not None]
    own_ground = under_soles(under, touches.feet, paths[:, :, 1, :2])
    if relief is not None:  # the soles' own floor is level then, and below the stated ground
        own_ground = own_ground._replace(floor=np.zeros_like(own_ground.floor))
    palms = resting_palms(robot, touches.part_roles, touches.rests, source.frame_time)
    for role in palms:
        j, rests = robot.rig.roles.require(role), touches.rests[:, touches.part_roles.index(role)]
        world[:, j] = laid(world[:, j], rests, source.frame_time)
    for s, sole in enumerate(robot.soles):
        flat = np.all(touches.feet[:, s], axis=1)
        for j in set(sole.joints.tolist()):
            world[:, j] = level_across(world[:, j], robot.rig.tpose[j], flat)
    return Targets(
        frame_time=source.frame_time,
        world=world,
        chest=quat_mul(source.rotations[:, rig.chest], robot.rig.tpose[own_chest]),
        hips=hips,
        bones=bones,
        jerks=limb_jerks(bones, source.frame_time),
        contacts=touches.feet,
        parts=touches.parts,
        rests=touches.rests,
        part_roles=touches.part_roles,
        part_paths=scale * positions[:, touching, :2],
        part_ground=scale * climb.ground.under(positions[:, touching]),
        palms=palms,
        flight=touches.flight,
        com_acceleration=scale * touches.com_acceleration,
        feet=scale * paths[..., :2],
        clearance=scale * (clearance - own_ground.ground),
        ground=scale * own_ground.ground,
        floor=scale * own_ground.floor,
        seats=scale * climb.seats,
        around=climb.around,
        hands=between_hands(rig, positions, robot),
        self_touches=self_touches(source, dict(enumerate(positions.swapaxes(0, 1))), robot.rig),
        notes=(*notes, HOVERS) if has_feet(paths).any() and touches.hovers else notes,
    )


def poses_of(
    source: CanonicalMotion, positions: Float[np.ndarray, "T S 3"], robot: Morphology
) -> tuple[Float[np.ndarray, "T J 4"], Float[np.ndarray, "T 3"], tuple[str, ...]]:
    """The poses of a source, whose joints are at `positions` [m], on the robot's rig: its joints'
    rotations (`q_world_joint`), the path of the hips' middle [m] over a floor at z = 0, and notes.
    """
    moved = copied(source, robot.rig)
    turns, pelvis = moved.rotations, robot.rig.pelvis
    turns[:, pelvis] = bowing(source.rig, robot, turns[:, pelvis], positions, source.floor_z)
    for block in blocks(len(turns)):
        turns[block] = quat_mul(turns[block], robot.rig.tpose)
    return turns, moved.hips - np.array([0.0, 0.0, moved.floor_z]), moved.notes


def source_feet(
    source: CanonicalMotion, positions: Float[np.ndarray, "T J 3"], robot: Morphology
) -> Float[np.ndarray, "T S 2 3"]:
    """The source's heel and toe [m] for each of the robot's soles; 0 where it has no such foot."""
    rig = source.rig
    world = quat_mul(source.rotations, rig.tpose)
    return for_soles(ends_of_feet(rig.soles, rig.roles, positions, world), rig, robot)


def source_clearance(
    source: CanonicalMotion, positions: Float[np.ndarray, "T J 3"], robot: Morphology
) -> Float[np.ndarray, "T S"]:
    """The height [m] over the floor of the lowest point of the source's sole, for each of the
    robot's; 0 where it has no such foot."""
    rig = source.rig
    world = quat_mul(source.rotations, rig.tpose)
    return for_soles(lowest_points(rig.soles, positions, world) - source.floor_z, rig, robot)


def for_soles(
    values: Float[np.ndarray, "T F *n"], rig: Rig, robot: Morphology
) -> Float[np.ndarray, "T S *n"]:
    """What each of a rig's soles has, for each of the robot's; 0 where the rig has no such foot."""
    out = np.zeros((len(values), len(robot.soles), *values.shape[2:]))
    sides = {sole.side: k for k, sole in enumerate(rig.soles)}
    for s, sole in enumerate(robot.soles):
        if sole.side in sides:
            out[:, s] = values[:, sides[sole.side]]
    return out


def with_firm_hands(robot: Morphology, targets: Targets) -> Targets:
    """The same with all hands followed as firmly as those that lie on the ground."""
    firm = {
        role: np.ones(len(targets)) for role in HANDS if robot.rig.roles.joint(role) is not None
    }
    return replace(targets, palms=firm)
