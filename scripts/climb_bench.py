"""OmniRetarget and ours on climbs over measured boxes, 30 frames a second, on a Unitree G1.

    python -m scripts.climb_bench CLIMBS OUT

`CLIMBS` has a folder a climb: the positions of its joints (.npy) and its boxes (box_models/*.obj,
together multi_boxes.obj), as `holosoma-retargeting` on PyPI has them. `OUT` has what OmniRetarget,
which is told the boxes, makes of them:

    python examples/robot_retarget.py --data_path CLIMBS --task-type climbing --data_format mocap \\
      --robot-config.robot-urdf-file models/g1/g1_29dof_spherehand.urdf --save_dir OUT \\
      --task-name NAME

Ours is judged twice: told nothing, when its boxes are put where the robot's course is and are
scaled as that is, and told the boxes (`--terrain`). MuJoCo says how deep its shapes are in them.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import Delaunay

import spark_sim
from robots.kinematics import forward_kinematics
from robots.metrics import measure
from robots.model.morphology import Morphology
from robots.solver.floor import sole_paths
from robots.tree import Coordinates
from sim.outline import solid
from spark.kinematics import forward
from spark.rig.feet import sole_positions

FPS: Final = 30
ROBOT: Final = "unitree_g1"
THEIR_SCALE: Final = 1.32 / 1.78  # of all lengths: their G1's height over that of their people
DEEP, OFF = 0.01, 0.02  # [m] in a box, and over what a foot should stand on
_SLOW, _LOW = 0.15, 0.08  # [m/s], [m] of a standing foot of the source: its soles are drawn high
_NEAR = 0.05  # [m] from a box within which a shape is measured
_COLUMNS = (
    *("feet in boxes %", "deepest cm", "others in boxes %", "deepest cm", "feet off %", "by cm"),
    *("skate cm/s", "hips acc.", "limbs °", "jerk", "limit %"),
)

Boxes = Sequence[Float[np.ndarray, "V 3"]]


class Climb(NamedTuple):
    """How a robot climbs boxes: how deep [m] `feet` and `others` are in them, how high each of its
    soles is over what is below it, and how fast [m/s] its lowest point there is."""

    feet: Float[np.ndarray, "T"]
    others: Float[np.ndarray, "T"]
    over: Float[np.ndarray, "T S"]
    speed: Float[np.ndarray, "T S"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("climbs", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    print(f"| | {' | '.join(_COLUMNS)} |\n|---|{'---|' * len(_COLUMNS)}")
    rows: dict[str, list[Float[np.ndarray, C]]] = {"OmniRetarget": [], "ours": [], "ours, told": []}
    for path in sorted(args.climbs.glob("*/*.npy")):
        clip = spark_sim.load(path).resampled(FPS)
        boxes, theirs = boxes_of(path.parent), args.out / f"{path.parent.name}_original.npz"
        ours = spark_sim.retarget(clip, ROBOT)
        told = spark_sim.retarget(clip, ROBOT, terrain=path.parent / "multi_boxes.obj")
        made = {"ours": (ours, along(clip, ours, boxes)), "ours, told": (told, parts_of(told))}
        if theirs.exists():
            scaled = [THEIR_SCALE * box for box in boxes]
            made["OmniRetarget"] = spark_sim.load(theirs, robot=ROBOT), scaled
        for tool, (result, placed) in made.items():
            rows[tool].append(values_of(clip, boxes, result, placed))
            show(f"{tool}: {path.parent.name}", rows[tool][-1])
    for tool, values in rows.items():
        if values:
            worst = np.max(values, axis=0)
            depths = ["deepest" in column for column in _COLUMNS]
            show(f"{tool}: mean of {len(values)}", np.where(depths, worst, np.mean(values, axis=0)))


def show(name: str, values: Float[np.ndarray, "C"]) -> None:
    print(f"| {name} | {' | '.join(f'{value:.3g}' for value in values)} |", flush=True)


def boxes_of(folder: Path) -> Boxes:
    """The corners [m] of the boxes of a climb."""
    boxes = []
    for path in sorted((folder / "box_models").glob("*.obj")):
        lines = (line.split() for line in path.read_text(encoding="utf-8").splitlines())
        boxes.append(np.array([line[1:4] for line in lines if line[:1] == ["v"]], dtype=float))
    return boxes


def parts_of(made: spark_sim.RobotClip) -> Boxes:
    """The corners [m] of the boxes that a robot was told, in its world."""
    terrain = made.terrain
    assert terrain is not None
    parts = np.unique(terrain.parts).tolist()
    return [terrain.corners[terrain.parts == part].reshape(-1, 3) for part in parts]


def along(clip: spark_sim.Clip, made: spark_sim.RobotClip, boxes: Boxes) -> Boxes:
    """The boxes as large, and where, the course of a robot is that was told nothing of them."""
    source, own = (
        forward(each.motion)[0][:, each.rig.hips].mean(axis=1)[:, :2] for each in (clip, made)
    )
    middle, own_middle = source.mean(axis=0), own.mean(axis=0)
    size = ((source - middle) * (own - own_middle)).sum() / ((source - middle) ** 2).sum()
    scale = np.array([size, size, made.rig.hip_height / clip.rig.hip_height])
    return [scale * box + [*(own_middle - size * middle), 0.0] for box in boxes]


def values_of(
    clip: spark_sim.Clip, boxes: Boxes, made: spark_sim.RobotClip, placed: Boxes
) -> Float[np.ndarray, "C"]:
    """A row of the table, of a climb over `boxes` by a robot for which they are `placed`."""
    count = min(len(clip.motion), len(made.qpos))
    robot, q = made.on_robot.robot, made.on_robot.coordinates.at(np.arange(count))
    climb = climbed(robot, q, placed, 1 / FPS)
    stands = standing(clip, boxes)[:count]
    over, speed = climb.over[stands], climb.speed[stands]
    same = clip.motion.picked(slice(0, count))
    bars = measure(same, clip.rig, made.part(end=count / FPS).on_robot)
    values = (
        *(100 * (climb.feet > DEEP).mean(), 100 * climb.feet.max(initial=0.0)),
        *(100 * (climb.others > DEEP).mean(), 100 * climb.others.max(initial=0.0)),
        *(100 * (over > OFF).mean(), 100 * over.mean(), 100 * speed.mean()),
        *(bars.hips_acceleration or np.nan, np.degrees(bars.limb_error_rad)),
        *(bars.jerk_rad_s3, 100 * bars.at_limit),
    )
    return np.array(values)


def climbed(robot: Morphology, q: Coordinates, boxes: Boxes, frame_time: float) -> Climb:
    """How a robot is in and over boxes [m], whose corners are given."""
    poses = forward_kinematics(robot.tree, q)
    soles = [sole_paths(robot, poses, sole) for sole in robot.soles]
    over, speed = np.zeros((2, len(q), len(soles)))
    for s, paths in enumerate(soles):
        heights = paths[..., 2] - under(paths, boxes)
        lowest = heights.argmin(axis=1)[:, None]
        moved = np.gradient(paths[..., :2], frame_time, axis=0)
        over[:, s] = np.take_along_axis(heights, lowest, 1)[:, 0]
        speed[:, s] = np.take_along_axis(np.linalg.norm(moved, axis=-1), lowest, 1)[:, 0]
    return Climb(*_depths(robot, q, boxes), over, speed)


def standing(clip: spark_sim.Clip, boxes: Boxes) -> Bool[np.ndarray, "T S"]:
    """When each of the source's soles is slow, and near what is below it."""
    positions, world = forward(clip.motion)
    out = []
    for sole in clip.rig.soles:
        path = sole_positions(sole, positions, world).mean(axis=1, keepdims=True)
        speed = np.linalg.norm(np.gradient(path, clip.motion.frame_time, axis=0), axis=-1)
        near = np.abs(path[..., 2] - under(path, boxes)) < _LOW
        out.append((near & (speed < _SLOW))[:, 0])
    return np.stack(out, axis=1)


def under(points: Float[np.ndarray, "T P 3"], boxes: Boxes) -> Float[np.ndarray, "T P"]:
    """How high [m] the highest box is below points or around them; 0 beside all boxes."""
    out = np.zeros(points.shape[:-1])
    for box in boxes:
        inside = Delaunay(box[:, :2]).find_simplex(points[..., :2]) >= 0
        out[inside] = np.maximum(out[inside], box[:, 2].max())
    return out


def _depths(
    robot: Morphology, q: Coordinates, boxes: Boxes
) -> tuple[Float[np.ndarray, "T"], Float[np.ndarray, "T"]]:
    """How deep [m] feet and other parts are in the boxes."""
    spec, names = robot.whole.spec.copy(), [f"climbed {k}" for k in range(len(boxes))]
    for name, box in zip(names, boxes, strict=True):
        spec.add_mesh(name=name, uservert=box.ravel().tolist())
        mesh = mujoco.mjtGeom.mjGEOM_MESH
        spec.worldbody.add_geom(name=name, type=mesh, meshname=name)
    model = spec.compile()
    data, around = mujoco.MjData(model), [model.geom(name).id for name in names]
    soles = {int(link) for sole in robot.soles for link in robot.sole_points(sole)[0]}
    feet = {int(robot.whole.model.jnt_bodyid[robot.mj_joints[link]]) for link in soles}
    bodies = list(robot.whole.bodies())
    shapes = solid(model, np.flatnonzero(np.isin(model.geom_bodyid, bodies)).tolist())
    depths, ends = np.zeros((2, len(q))), np.zeros(6)
    for t, qpos in enumerate(robot.to_qpos(q)):
        data.qpos = qpos
        mujoco.mj_kinematics(model, data)
        for shape in shapes:
            kind = 0 if int(model.geom_bodyid[shape]) in feet else 1
            for box in around:
                distance = mujoco.mj_geomDistance(model, data, shape, box, _NEAR, ends)
                depths[kind, t] = max(depths[kind, t], -distance)
    return depths[0], depths[1]


if __name__ == "__main__":
    main()
