"""What a body looks like and collides with: capsules along bones, a head, flat feet."""

import mujoco
import numpy as np
from jaxtyping import Float

from sim.anthropometry import RADII
from spark.feet import sole_corners, sole_positions, standing_height
from spark.kinematics import world_positions
from spark.rig import Rig
from spark.rotation import quat_conj, quat_rotate

_DETAIL = 0.006  # radius of fingers, face and helpers, as a fraction of the standing height
_HEAD = np.array([0.055, 0.045, 0.068])  # half axes of the head
_FOOT = 0.022  # half the height of a foot's box

LEFT_RGBA = (0.93, 0.52, 0.36, 1.0)
RIGHT_RGBA = (0.40, 0.60, 0.86, 1.0)
MIDDLE_RGBA = (0.82, 0.82, 0.80, 1.0)


def add_shapes(spec: mujoco.MjSpec, bodies: dict[int, mujoco.MjsBody], rig: Rig) -> None:
    """Give every body its geoms; those of joints with a role collide, the others are only seen."""
    height = standing_height(rig)
    for j, body in bodies.items():
        role = rig.roles.roles[j]
        kind = role.value.removeprefix("left_").removeprefix("right_") if role else ""
        if kind in ("foot", "toe"):
            continue
        if kind == "head":
            _add_head(spec, body, rig, j, height)
            continue
        radius = RADII.get(kind, _DETAIL) * height
        for tip in _bone_tips(rig, j):
            _add_capsule(spec, body, rig, j, tip, radius, collides=bool(kind))
    _add_feet(spec, bodies, rig, height)


def rgba_of(rig: Rig, joint: int) -> tuple[float, float, float, float]:
    """Warm on the left, cool on the right: a swapped side is seen at once."""
    for k in rig.skeleton.ancestors(joint):
        role = rig.roles.roles[k]
        if role is not None:
            if role.value.startswith("left"):
                return LEFT_RGBA
            return RIGHT_RGBA if role.value.startswith("right") else MIDDLE_RGBA
    return MIDDLE_RGBA


def _bone_tips(rig: Rig, joint: int) -> list[Float[np.ndarray, "3"]]:
    """Where the bones of a joint end, in its own axes: at children that carry on the body, or, at
    the end of a limb, at all children and End Sites."""
    skeleton = rig.skeleton
    children = [
        c for c in skeleton.children[joint] if any(rig.roles.roles[k] for k in skeleton.subtree(c))
    ] or list(skeleton.children[joint])
    tips = [skeleton.offsets[c] for c in children]
    if not tips or not any(rig.roles.roles[c] for c in skeleton.subtree(joint)[1:]):
        tips += list(skeleton.end_offsets[skeleton.end_parents == joint])
    return [tip for tip in tips if np.linalg.norm(tip) > 1e-4]


def _add_capsule(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    rig: Rig,
    joint: int,
    tip: Float[np.ndarray, "3"],
    radius: float,
    *,
    collides: bool,
) -> None:
    length = float(np.linalg.norm(tip))
    body.add_geom(
        spec.find_default("collision" if collides else "visual"),
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0, 0, 0, *tip],
        size=[min(radius, 0.5 * length + 0.004), 0, 0],
        rgba=rgba_of(rig, joint),
    )


def _add_head(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, rig: Rig, joint: int, height: float
) -> None:
    to_joint = quat_conj(rig.tpose[joint])
    center = quat_rotate(to_joint, np.array([0.015, 0, 0.055]) * height)
    body.add_geom(
        spec.find_default("collision"),
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        pos=center,
        quat=to_joint,
        size=_HEAD * height,
        rgba=rgba_of(rig, joint),
    )


def _add_feet(
    spec: mujoco.MjSpec, bodies: dict[int, mujoco.MjsBody], rig: Rig, height: float
) -> None:
    """A box under each foot and one under its toes, with their lower faces on the soles."""
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    for sole in sole_corners(rig):
        foot, toe = int(sole.joints[0]), int(sole.joints[-1])
        points = sole_positions(sole, positions, rig.tpose)
        if toe == foot:
            _add_box(spec, bodies[foot], rig, foot, points - positions[foot], height)
            continue
        _add_box(spec, bodies[foot], rig, foot, points[:4] - positions[foot], height)
        _add_box(spec, bodies[toe], rig, toe, points[2:] - positions[toe], height)
        instep = quat_rotate(quat_conj(rig.tpose[foot]), positions[toe] - positions[foot])
        _add_capsule(spec, bodies[foot], rig, foot, instep, RADII["foot"] * height, collides=False)


def _add_box(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    rig: Rig,
    joint: int,
    points: Float[np.ndarray, "P 3"],
    height: float,
) -> None:
    """A flat box over `points`: from the joint, in T-pose world axes; thinner than the ankle."""
    low, high = points.min(0), points.max(0)
    half = (high - low) / 2
    half[2] = min(_FOOT * height, max(-low[2], 0.01)) / 2
    to_joint = quat_conj(rig.tpose[joint])
    body.add_geom(
        spec.find_default("foot"),
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=quat_rotate(to_joint, (low + high) / 2 + [0, 0, half[2]]),
        quat=to_joint,
        size=half,
        rgba=rgba_of(rig, joint),
    )
