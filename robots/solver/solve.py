"""Retargeting onto a robot: the whole trajectory at once.

Damped Gauss-Newton over the coordinates of all frames: every frame's pose against its targets,
footholds, the floor, limits (`robots.solver.objective`); neighbours coupled by their accelerations
(`robots.solver.smoothness`, `robots.least_squares`). It runs over two blocks of coordinates, one
after the other: base, trunk and legs, which the feet couple, then arms and head, which hang on the
trunk and don't move it. Where these carry the body they do, and both are solved at once.
"""

from collections.abc import Sequence

from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.block import blocks_of, carriers, whole_of
from robots.solver.descent import collision_candidates, solve_block
from robots.solver.foot_path import footing_of
from robots.solver.footprints import FootPlan, plan_feet, reachable
from robots.solver.holds import Holds, joined
from robots.solver.marching import abrupt, calmed
from robots.solver.motion_plan import with_dynamics
from robots.solver.mounted import facing_ahead, on_mount
from robots.solver.projection import project
from robots.solver.repair import repair
from robots.solver.resting import leans, resting
from robots.solver.smoothness import limit_speed
from robots.solver.stance import apart
from robots.solver.strays import without_strays
from robots.solver.stretches import by_stretches
from robots.solver.targets import Targets, poses_of, targets_of
from robots.tree import Coordinates
from spark.threads import one_thread
from spark.transfer.canonical import CanonicalMotion, canonical_positions

_MAX_ITER = (12, 10)  # Gauss-Newton steps, by block
_REL_TOL = (0.02, 0.05)  # of the cost: a block ends where a step gains less,
_MAX_REJECTED = 0.1  # and no larger share of the frames rejects it
_WHOLE = (8, 0.05)  # the same of both blocks at once, nearly solved one after the other
_POLISH = (2, 0.0, 1.0)  # the same three where splines through a solution are nearly right
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
    nothing leads to are passed over. A robot without legs stays where it is mounted.
    """
    if robot.mount is not None:
        source = facing_ahead(source)
    source, passed = without_strays(source)
    notes = dict.fromkeys((*robot.notes, *passed))

    def solved(start: int, stop: int) -> Coordinates:
        targets = targets_of(source.frames(start, stop), robot)
        notes.update(dict.fromkeys(targets.notes))
        return _trajectory(robot, targets)

    with one_thread():
        q = robot.following(by_stretches(solved, len(source), source.frame_time))
    return RobotMotion(robot, q, source.frame_time, tuple(notes))


def _trajectory(robot: Morphology, targets: Targets) -> Coordinates:
    """That follows the targets."""
    feet = plan_feet(robot, targets)
    stride = coarse_stride(targets)
    coarse = targets.every(stride)
    q = idle_at_rest(robot, on_mount(robot, project(robot, coarse.world, coarse.hips)))
    q = robot.following(q)
    q = limit_speed(robot, q, coarse.frame_time)
    q = solve(robot, coarse, [foot.every(stride) for foot in feet], q)
    if stride > 1:
        q = q.upsampled(stride, len(targets))
    targets, feet = with_dynamics(robot, targets, apart(reachable(robot, feet, q)), q)
    return solve(robot, targets, feet, q, polish=True)


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


def solve(
    robot: Morphology,
    targets: Targets,
    feet: list[FootPlan],
    q: Coordinates,
    *,
    polish: bool = False,
) -> Coordinates:
    """Block by block, from `q`: first without collisions and with feet that may slide; then with
    collisions, and feet held where they came to rest; then repaired. To `polish` what is nearly
    solved, without the first, and twice where parts rest: as these turn, other points of them are
    on the ground. A body that leans on its arms is solved as a whole at last.
    """
    stages = [*zip(blocks_of(robot), _MAX_ITER, _REL_TOL, strict=True)]
    if leans(robot, targets):
        stages = [*([] if polish else stages), (whole_of(robot), *_WHOLE)]
    for block, max_iter, rel_tol in stages:
        if not block.dofs:
            continue
        ends = _POLISH if polish else (max_iter, rel_tol, _MAX_REJECTED)
        if not polish:
            sliding = _holds_of(robot, targets, feet, q).sliding()
            q = solve_block(robot, targets, sliding, q, block, *ends)
        if block.base and not polish:
            feet = apart(reachable(robot, feet, q))
        for _ in range(2 if polish and targets.rests.any() else 1):
            holds = _holds_of(robot, targets, feet, q)
            near = collision_candidates(robot, targets, q, block)
            if polish or near:
                q = solve_block(robot, targets, holds, q, block, *ends, near)
        if not block.base and not polish and (thrown := abrupt(robot, targets, q, block)).any():
            q = calmed(robot, targets, holds, q, block, thrown)
            near = collision_candidates(robot, targets, q, block)
            q = solve_block(robot, targets, holds, q, block, *ends, near)
        q = repair(robot, targets, holds, q, block)
    return q


def _holds_of(
    robot: Morphology, targets: Targets, feet: Sequence[FootPlan], q: Coordinates
) -> Holds:
    """Of the feet, and of what else of `q` touches the ground."""
    return joined([*(footing_of(robot, foot) for foot in feet), resting(robot, targets, q)])
