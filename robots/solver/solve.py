"""Retargeting onto a robot: the whole trajectory at once.

Damped Gauss-Newton over the coordinates of all frames: every frame's pose against its targets,
footholds, the floor, limits (`robots.solver.objective`); neighbours coupled by their accelerations
(`robots.solver.smoothness`, `robots.least_squares`). It runs over two blocks of coordinates, one
after the other: base, trunk and legs, which the feet couple, up to the last step; then arms and
head, which hang on the trunk and don't move it. Where these carry the body they do, and both are
solved at once.
"""

from collections.abc import Sequence

from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.astray import led_back
from robots.solver.block import Block, blocks_of, carriers, whole_of
from robots.solver.crouch import less_deep
from robots.solver.descent import Steps, collision_candidates, collision_stride, solve_block
from robots.solver.foot_path import footing_of
from robots.solver.footholds import on_ground
from robots.solver.footprints import FootPlan, plan_feet, reachable
from robots.solver.ground import climb_of, climbs
from robots.solver.holds import Holds, joined
from robots.solver.marching import abrupt, calmed
from robots.solver.motion_plan import with_dynamics
from robots.solver.mounted import facing_ahead, on_mount
from robots.solver.projection import project
from robots.solver.repair import repair
from robots.solver.resting import leans, resting
from robots.solver.self_touch import on_itself
from robots.solver.smoothness import limit_speed
from robots.solver.stance import apart
from robots.solver.step_time import unhurried
from robots.solver.strays import without_strays
from robots.solver.stretches import by_stretches
from robots.solver.targets import Targets, poses_of, targets_of, with_firm_hands
from robots.solver.unparted import unparted
from robots.tree import Coordinates
from spark.threads import one_thread
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.in_place import with_travel
from spark.transfer.loops import continued
from spark.transfer.noise import without_noise
from spark.transfer.treads import treads_of

_TRUNK, _LIMBS = Steps(12, 0.02, 0.1), Steps(10, 0.05, 0.1)
_WHOLE = Steps(8, 0.05, 0.1)  # both blocks at once, nearly solved one after the other
# Splines through a solution. A foot whose hip comes to its limit in one frame and not in the next
# would hop, if that was only clipped.
_POLISH, POLISH_LIMBS = Steps(2, 0.0, 1.0, solves=2), Steps(1, 0.0, 1.0, solves=2)
_COARSE_INTERVAL = 1 / 20  # [s] between the frames that are solved first


def copy(source: CanonicalMotion, robot: Morphology) -> RobotMotion:
    """Each joint turned as its counterpart is, as far as its hinges can, and nothing more: the
    baseline."""
    if robot.mount is not None:
        source = facing_ahead(source)
    world, hips, notes = poses_of(source, canonical_positions(source), robot)
    q = on_mount(robot, project(robot, world, hips))
    return RobotMotion(robot, robot.following(q), source.frame_time, notes)


def retarget(source: CanonicalMotion, robot: Morphology) -> RobotMotion:
    """The motion of `source` on a robot, its feet planted where the source's are, within limits.

    Recordings of more than 20 fps are solved at about 20 fps first; splines through that are then
    polished in all frames. Long ones are solved a stretch at a time. Frames of the source that
    nothing leads to are passed over, and one that trembles is smoothed. A loop is solved as it goes
    on, and closes. A robot without legs stays where it is mounted.
    """
    if robot.mount is not None:
        source = facing_ahead(source)
    source, passed = without_strays(source)
    source, own = continued(source)
    source, noise, trembles = without_noise(source)
    stays = robot.mount is not None or source.terrain is not None
    source, travels = (source, ()) if stays else with_travel(source)
    treads = treads_of(source)
    source = less_deep(source, robot, treads.seats)
    climb = climb_of(source, treads, robot)
    notes = dict.fromkeys(
        (*robot.notes, *passed, *trembles, *travels, *climbs(treads, robot, source.floor_z))
    )

    def solved(start: int, stop: int) -> Coordinates:
        targets = targets_of(source.frames(start, stop), robot, noise, climb.frames(start, stop))
        notes.update(dict.fromkeys(targets.notes))
        return _trajectory(robot, targets)

    with one_thread():
        q = robot.following(by_stretches(solved, len(source), source.frame_time)).at(own)
        notes.update(dict.fromkeys(unparted(robot, q, collision_stride(source.frame_time))))
    terrain = None if climb.around is None else climb.around.terrain
    return RobotMotion(robot, q, source.frame_time, tuple(notes), terrain)


def _trajectory(robot: Morphology, targets: Targets) -> Coordinates:
    """That follows the targets: solved in few frames, then polished in all, around a centre of mass
    that physics accepts.

    Arms come last, on a trunk that stays: polishing moves it, and would lead hands that are done
    into thighs. Before, they are solved for what they weigh. A body that leans on its arms is
    polished as a whole.
    """
    feet, leaning = [on_ground(foot) for foot in plan_feet(robot, targets)], leans(robot, targets)
    q = _coarse(robot, targets, feet, leaning)
    feet = unhurried(_standing(robot, feet, q), targets.flight)
    targets, feet = with_dynamics(robot, targets, feet, q)
    if leaning:
        return polished(robot, targets, feet, q, whole_of(robot), _POLISH)
    trunk, limbs = blocks_of(robot)
    q = polished(robot, targets, feet, q, trunk, _POLISH)
    q = _with_arms(robot, targets, q, limbs)
    return polished(robot, with_firm_hands(robot, targets), feet, q, limbs, POLISH_LIMBS)


def _coarse(
    robot: Morphology, targets: Targets, feet: Sequence[FootPlan], leaning: bool
) -> Coordinates:
    """Few frames solved: base, trunk and legs, then arms and head for what they weigh, and of who
    is `leaning` on these both at once."""
    stride = coarse_stride(targets)
    coarse, few = targets.every(stride), [foot.every(stride) for foot in feet]
    q = idle_at_rest(robot, on_mount(robot, project(robot, coarse.world, coarse.hips)))
    q = limit_speed(robot, robot.following(q), coarse.frame_time)
    trunk, limbs = blocks_of(robot)
    q, few = _posed(robot, coarse, few, q, trunk, _TRUNK)
    q = _parted(robot, coarse, few, q, trunk, _TRUNK)
    q, _ = _posed(robot, coarse, few, q, limbs, _LIMBS)
    if leaning:
        q = _parted(robot, coarse, few, q, limbs, _LIMBS)
        q, few = _posed(robot, coarse, few, q, whole_of(robot), _WHOLE)
        q = _parted(robot, coarse, few, q, whole_of(robot), _WHOLE)
    return q.upsampled(stride, len(targets))


def _with_arms(robot: Morphology, targets: Targets, q: Coordinates, limbs: Block) -> Coordinates:
    """Arms and head solved in few frames, on a trunk that stays."""
    stride = coarse_stride(targets)
    arms = _parted(robot, targets.every(stride), [], q.every(stride), limbs, _LIMBS)
    return q.with_joints(limbs.joints, arms.upsampled(stride, len(targets)))


def idle_at_rest(robot: Morphology, q: Coordinates) -> Coordinates:
    """`q` with the joints that no block moves as in the T-pose."""
    idle = [link for link, carrier in enumerate(carriers(robot)) if carrier != link]
    angles = q.angles.copy()
    angles[:, idle] = robot.tpose.angles[0, idle]
    balls = q.ball_quats
    if balls is not None and robot.tpose.ball_quats is not None:
        balls = balls.copy()
        balls[:, idle] = robot.tpose.ball_quats[0, idle]
    return Coordinates(q.pos, q.quat, angles, balls)


def coarse_stride(targets: Targets) -> int:
    """From each frame that is solved first to the next [frames]."""
    return min(max(1, round(_COARSE_INTERVAL / targets.frame_time)), max(len(targets) // 4, 1))


def _posed(
    robot: Morphology,
    targets: Targets,
    feet: list[FootPlan],
    q: Coordinates,
    block: Block,
    steps: Steps,
) -> tuple[Coordinates, list[FootPlan]]:
    """Without collisions, on feet that may slide; and the feet where the legs then reach."""
    if not block.dofs:
        return q, feet
    sliding = _holds_of(robot, targets, feet, q, block).sliding()
    q = solve_block(robot, targets, sliding, q, block, steps)
    return q, _standing(robot, feet, q) if block.base else feet


def _standing(robot: Morphology, feet: Sequence[FootPlan], q: Coordinates) -> list[FootPlan]:
    """Feet where those of `q` stand on average, apart, and on the ground that is there."""
    return [on_ground(foot) for foot in apart(reachable(robot, feet, q))]


def _parted(
    robot: Morphology,
    targets: Targets,
    feet: list[FootPlan],
    q: Coordinates,
    block: Block,
    steps: Steps,
) -> Coordinates:
    """With collisions, and feet held where they came to rest; arms calmed, and all repaired."""
    if not block.dofs:
        return q
    holds = _holds_of(robot, targets, feet, q, block)
    near = collision_candidates(robot, targets, q, block)
    if near:
        q = solve_block(robot, targets, holds, q, block, steps, near)
    if not block.base:
        solved = q
        if (thrown := abrupt(robot, targets, q, block)).any():
            q = calmed(robot, targets, holds, q, block, thrown)
        q = led_back(robot, targets, holds, q, block)
        if q is not solved:
            near = collision_candidates(robot, targets, q, block)
            q = solve_block(robot, targets, holds, q, block, steps, near)
    return repair(robot, targets, holds, q, block)[0]


def polished(
    robot: Morphology,
    targets: Targets,
    feet: list[FootPlan],
    q: Coordinates,
    block: Block,
    steps: Steps,
) -> Coordinates:
    """What is nearly solved, in all frames, and repaired; arms that are left in something after
    that are marched around it."""
    if not block.dofs:
        return q
    q, holds = _followed(robot, targets, feet, q, block, steps)
    q, stuck = repair(robot, targets, holds, q, block)
    if block.base or not stuck.any():
        return q
    q = calmed(robot, targets, holds, q, block, stuck)
    q, holds = _followed(robot, targets, feet, q, block, steps)
    return repair(robot, targets, holds, q, block)[0]


def _followed(
    robot: Morphology,
    targets: Targets,
    feet: list[FootPlan],
    q: Coordinates,
    block: Block,
    steps: Steps,
) -> tuple[Coordinates, Holds]:
    """Solved in all frames, and what held it. Twice where parts rest: as these turn, other points
    of them are on the ground."""
    for _ in range(2 if targets.rests.any() else 1):
        holds = _holds_of(robot, targets, feet, q, block)
        near = collision_candidates(robot, targets, q, block)
        q = solve_block(robot, targets, holds, q, block, steps, near)
    return q, holds


def _holds_of(
    robot: Morphology, targets: Targets, feet: Sequence[FootPlan], q: Coordinates, block: Block
) -> Holds:
    """Of the feet, where the block moves them, and of what else of `q` touches the ground."""
    footings = [footing_of(robot, foot) for foot in feet] if block.base else []
    own = on_itself(robot, targets.self_touches, q, targets.frame_time)
    return joined([*footings, resting(robot, targets, q), own])
