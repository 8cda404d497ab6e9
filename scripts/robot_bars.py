"""Measure retargeting onto robots: a table of each clip, and of plain copy beside it.

    python scripts/robot_bars.py --data DIR --robots unitree_g1 h1.xml [--clips 'cmu_asf/*.bvh' ...]

A foot is planted while the source's toe moves along the floor at less than 0.15 m/s, lower than
6 cm above its own 1st percentile. A clip leaves the floor where, for 0.2 s on end, a toe rests more
than 10 cm above that while no toe is planted: it climbs, or its ground is uneven. The bars need not
hold for such a clip alone; for each of the others, the last column names those that it misses.
"""

import argparse
import time
from pathlib import Path

import mujoco
import numpy as np

from robots.model.known import known
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.solve import copy, retarget
from robots.solver.targets import bone_directions
from robots.stream.frame_targets import LATENCY, Frame, ground_of
from robots.stream.stream import Stream
from spark.io.recording import read_recording
from spark.rig.rig import understand
from spark.rig.roles import Role
from spark.runs import true_runs
from spark.transfer.canonical import (
    CanonicalMotion,
    canonical_positions,
    from_canonical,
    to_canonical,
)

COLUMNS = {  # name: format
    "sunk %": "6.2f",
    "deep cm": "7.2f",
    "float %": "7.2f",
    "skate": "6.2f",
    "(src)": "6.2f",
    "limbs": "6.2f",
    "limit %": "7.1f",
    "rad/s": "6.1f",
    "jerk": "7.0f",
    "self %": "6.2f",
    "fps": "6.0f",
}

BARS = {
    "sunk %": 1.0,
    "deep cm": 1.0,
    "float %": 1.5,
    "skate": 4.0,
    "limbs": 6.0,
    "limit %": 4.0,
    "rad/s": 15.0,
    "jerk": 400.0,
    "self %": 0.2,
}
DANCES_JERK = 800.0
SLOW, PLANTED, RAISED, RESTS = 0.15, 0.06, 0.10, 0.2  # [m/s], [m], [m], [s]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--robots", nargs="+", required=True)
    folders = ["cmu_asf/*", "animateddrawings/*", "reactidle/*"]
    parser.add_argument("--clips", nargs="+", default=folders)
    parser.add_argument("--dances", nargs="+", default=["dab", "jesse_dance"], help="by name")
    parser.add_argument("--quiet", action="store_true", help="means only")
    parser.add_argument("--no-collisions", action="store_true")
    parser.add_argument("--stream", action="store_true", help="frame by frame, not whole clips")
    args = parser.parse_args()
    clips = sorted(path for pattern in args.clips for path in args.data.glob(f"{pattern}"))
    sources = {}
    for path in clips:
        if path.suffix == ".bvh":
            motion = read_recording(path).motion
            sources[path.stem] = to_canonical(motion, understand(motion))
    for name in args.robots:
        robot = known(name)
        print(f"\n{Path(name).stem}: {len(robot.mj_joints)} joints")
        print(" " * 22 + " ".join(f"{c:>{int(f.split('.')[0])}}" for c, f in COLUMNS.items()))
        for method in (copy, follow if args.stream else retarget):
            rows, weights, missing, on_floor = [], [], 0, 0
            for clip, source in sources.items():
                start = time.perf_counter()
                result = method(source, robot)
                fps = len(source) / (time.perf_counter() - start)
                rows.append([*measure(source, result, not args.no_collisions), fps])
                weights.append(len(source))
                if method is copy:
                    continue
                verdict = "off the floor"
                if stays_on_floor(source):
                    missed = misses(rows[-1], dance=clip in args.dances)
                    verdict = f"misses {', '.join(missed)}" if missed else "pass"
                    missing, on_floor = missing + bool(missed), on_floor + 1
                if not args.quiet:
                    show(clip, rows[-1], verdict)
            mean = np.average(rows, axis=0, weights=weights)
            mean[1], mean[7] = np.max(rows, axis=0)[[1, 7]]
            show(f"{method.__name__}: mean", mean.tolist())
            if method is not copy:
                print(f"{on_floor - missing} of {on_floor} clips that stay on the floor pass")


def follow(source: CanonicalMotion, robot: Morphology) -> RobotMotion:
    """Frame by frame, each answer beside the frame that it is for."""
    motion = from_canonical(source)
    stream = Stream(source.rig, robot, motion.frame_time, ground_of(source, robot))
    places = [None] * len(motion) if motion.translations is None else motion.translations
    frames = [Frame(*part) for part in zip(motion.root_pos, motion.rotations, places, strict=True)]
    qpos = [stream.step(frame) for frame in [*frames, *frames[-1:] * LATENCY]]
    return RobotMotion(robot, robot.from_qpos(np.array(qpos[LATENCY:])), motion.frame_time)


def stays_on_floor(source: CanonicalMotion) -> bool:
    """Whether no toe rests on anything higher than the floor."""
    toes = canonical_positions(source)[:, source.rig.contact_joints]
    speed = np.linalg.norm(np.gradient(toes, source.frame_time, axis=0), axis=-1)
    height = toes[..., 2] - np.percentile(toes[..., 2], 1, axis=0)
    raised = ((speed < SLOW) & (height > RAISED)).any(1) & (height > PLANTED).all(1)
    longest = max((stop - start for start, stop in true_runs(raised)), default=0)
    return bool(longest * source.frame_time < RESTS)


def misses(row: list[float], *, dance: bool) -> list[str]:
    """The columns of the table that are over their bars."""
    bars = {**BARS, "jerk": DANCES_JERK if dance else BARS["jerk"]}
    return [c for c, value in zip(COLUMNS, row, strict=True) if c in bars and value > bars[c]]


def show(label: str, row: list[float], verdict: str = "") -> None:
    cells = " ".join(f"{v:{f}}" for v, f in zip(row, COLUMNS.values(), strict=True))
    print(f"{label:<21} {cells}  {verdict}".rstrip(), flush=True)


def measure(source: CanonicalMotion, result: RobotMotion, collisions: bool) -> list[float]:
    """The table's columns but for the last."""
    robot, dt = result.robot, source.frame_time
    theirs = canonical_positions(source)
    toes = theirs[:, source.rig.contact_joints]
    speed = np.linalg.norm(np.gradient(toes[..., :2], dt, axis=0), axis=-1)
    low = np.percentile(toes[..., 2], 1, axis=0)
    planted = (speed < SLOW) & (toes[..., 2] < low + PLANTED)
    corners = sole_corners_by_mujoco(result)  # T S C 3
    z = corners[..., 2]
    lowest = z.min(-1)
    corner_speed = np.linalg.norm(np.gradient(corners[..., :2], dt, axis=0), axis=-1)
    at = z.argmin(-1)
    skate = np.take_along_axis(corner_speed, at[..., None], -1)[..., 0]
    feet = planted[:, : lowest.shape[1]]
    n = max(int(feet.sum()), 1)
    angles = result.coordinates.angles
    tree = robot.tree
    near = np.minimum(angles - tree.lower, tree.upper - angles) < np.radians(0.5)
    velocity = np.diff(angles, axis=0) / dt
    jerk = np.diff(angles, 3, axis=0) / dt**3
    return [
        100 * float((lowest.min(1) < -0.01).mean()),
        100 * float(max(0.0, -lowest.min())),
        100 * float((feet & (lowest > 0.02)).sum() / n),
        100 * float(skate[feet].sum() / n),
        100 * float(speed[planted].sum() / max(int(planted.sum()), 1)),
        limb_error(source, theirs, result),
        100 * float(near.any(1).mean()),
        float(np.abs(velocity).max(initial=0.0)),
        float(np.sqrt((jerk**2).mean())) if len(jerk) else 0.0,
        100 * self_collision(result) if collisions else np.nan,
    ]


def sole_corners_by_mujoco(result: RobotMotion) -> np.ndarray:
    """The soles' corners as MuJoCo's kinematics place them."""
    robot, model = result.robot, result.robot.mjcf.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    local = []
    for sole in robot.soles:
        for link, point in zip(*robot.sole_points(sole), strict=True):
            body = int(model.jnt_bodyid[robot.mj_joints[link]])
            local.append((body, data.xmat[body].reshape(3, 3).T @ (point - data.xpos[body])))
    out = np.empty((len(result), len(local), 3))
    for t, qpos in enumerate(result.qpos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        for k, (body, point) in enumerate(local):
            out[t, k] = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point
    return out.reshape(len(result), len(robot.soles), -1, 3)


def limb_error(source: CanonicalMotion, theirs: np.ndarray, result: RobotMotion) -> float:
    """Mean angle [deg] between the limbs' segments, after one yaw."""
    robot = result.robot
    wanted = bone_directions(source.rig, theirs, source.rotations)
    motion = robot.motion(result.coordinates, source.frame_time)
    from spark.kinematics import forward

    positions, world = forward(motion)
    own = bone_directions(robot.rig, positions, world)
    has = robot.rig.roles
    roles = [r for r in wanted if r in own and next_joint(has, r) is not None]
    a = np.stack([wanted[r] for r in roles], 1)
    b = np.stack([own[r] for r in roles], 1)
    yaw = np.arctan2(
        (b[..., 0] * a[..., 1] - b[..., 1] * a[..., 0]).sum(),
        (b[..., 0] * a[..., 0] + b[..., 1] * a[..., 1]).sum(),
    )
    c, s = np.cos(yaw), np.sin(yaw)
    b = b @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return float(np.degrees(np.arccos(np.clip((a * b).sum(-1), -1, 1))).mean())


def next_joint(roles: object, role: Role) -> int | None:
    order = {
        "upper_leg": "lower_leg",
        "lower_leg": "foot",
        "upper_arm": "forearm",
        "forearm": "hand",
    }
    return roles.joint(Role(f"{role.side}_{order[role.part]}"))  # type: ignore[attr-defined]


def self_collision(result: RobotMotion) -> float:
    """Share of frames in which two bodies, not joined and not touching in the T-pose, are deeper
    than 1 cm in each other."""
    robot: Morphology = result.robot
    model = robot.mjcf.model
    data = mujoco.MjData(model)

    def deep() -> set[tuple[int, int]]:
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found = set()
        for k in range(data.ncon):
            contact = data.contact[k]
            bodies = sorted(int(model.geom_bodyid[g]) for g in contact.geom)
            if contact.dist < -0.01 and bodies[0] > 0:
                found.add((bodies[0], bodies[1]))
        return found

    data.qpos[:] = robot.to_qpos(robot.tpose)[0]
    always = deep()
    bad = 0
    for qpos in result.qpos:
        data.qpos[:] = qpos
        bad += bool(deep() - always)
    return bad / len(result)


if __name__ == "__main__":
    main()
