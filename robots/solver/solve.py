"""Retargeting onto a robot: the whole trajectory at once.

Gauss-Newton over the coordinates of all frames: every frame's pose against its targets, planted
feet, the floor, limits; neighbours tied by their accelerations (`robots.solver.objective`,
`robots.least_squares`). It runs in two stages, each with everything below it free: base, trunk and
legs, which the feet tie together, then arms and head, which hang on the trunk and don't move it.
"""

from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.block import Stage
from robots.solver.collision import collisions_of
from robots.solver.descent import solve_stage, stride_of
from robots.solver.footprints import Footing, plan_footing, within_reach
from robots.solver.projection import project
from robots.solver.repair import mend
from robots.solver.smoothness import unhurried
from robots.solver.targets import Targets, targets_of
from robots.tree import Coordinates, forward_kinematics
from spark.transfer.canonical import CanonicalMotion

_STEPS = (12, 10)  # Gauss-Newton steps of the stages, at most
_LITTLE = (0.02, 0.05)  # a stage ends where a step lessens the cost by less than this share,
_REFUSED = 0.1  # and no more of the frames refuse it
_POLISH = (1, 0.0, 1.0)  # one step, where splines are nearly right
_COARSE = 1 / 20  # [s] between the frames that are solved first


def copy(source: CanonicalMotion, robot: Morphology) -> RobotMotion:
    """Each joint turned as its counterpart is, as far as its hinges can, and nothing more: the row
    to compare with."""
    targets = targets_of(source, robot)
    q = project(robot, targets.world, targets.hips)
    return RobotMotion(robot, q, source.frame_time, targets.notes)


def retarget(source: CanonicalMotion, robot: Morphology) -> RobotMotion:
    """The motion of `source` on a robot, its feet planted where the source's are, within limits.

    Fast recordings are solved in some of their frames first; splines between these are the start.
    """
    targets = targets_of(source, robot)
    footing = plan_footing(robot, targets)
    stride = stride_between(targets)
    few = targets.every(stride)
    q = unhurried(robot, project(robot, few.world, few.hips), few.frame_time)
    q = solve(robot, few, [foot.every(stride) for foot in footing], q)
    if stride > 1:
        q = solve(robot, targets, footing, q.upsampled(stride, len(targets)), polish=True)
    return RobotMotion(robot, q, source.frame_time, (*robot.notes, *targets.notes))


def stride_between(targets: Targets) -> int:
    """From each frame that is solved first to the next."""
    return min(max(1, round(_COARSE / targets.frame_time)), max(len(targets) // 4, 1))


def solve(
    robot: Morphology,
    targets: Targets,
    footing: list[Footing],
    q: Coordinates,
    *,
    polish: bool = False,
) -> Coordinates:
    """Stage by stage, from `q`: first as if parts could run through each other and feet could
    slide, then apart and with feet where they came to rest; what is still wrong is mended. To
    polish what is nearly solved, no need for the first."""
    for stage, steps, little in zip(stages_of(robot), _STEPS, _LITTLE, strict=True):
        if not stage.columns:
            continue
        ends = _POLISH if polish else (steps, little, _REFUSED)
        if not polish:
            sliding = [foot.sliding() for foot in footing]
            q = solve_stage(robot, targets, sliding, q, stage, *ends, apart=False)
        if stage.base:
            footing = within_reach(robot, footing, q)
        if polish or collisions_of(robot).near(
            forward_kinematics(robot.tree, q), stage, stride_of(targets)
        ):
            q = solve_stage(robot, targets, footing, q, stage, *ends, apart=True)
        q = mend(robot, targets, footing, q, stage)
    return q


def stages_of(robot: Morphology) -> tuple[Stage, Stage]:
    """Base, trunk and legs; then the rest."""
    tree = robot.tree
    links = {int(robot.links[robot.rig.chest])}
    links |= {int(link) for sole in robot.soles for link in sole.links}
    links |= {int(robot.links[j]) for j in robot.rig.contact_joints}
    first = sorted({j for link in links for j in tree.chain(link)})
    rest = tuple(j for j in range(len(tree)) if j not in first)
    return Stage(tree, tuple(first), True), Stage(tree, rest, False)
