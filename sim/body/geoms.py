"""The geoms of a body, seen and collided with: capsules along bones, a head, flat feet.

All of it is placed in T-pose world axes, from the joint that carries it: those are a body's axes.
"""

from collections.abc import Mapping

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.mesh import Hull
from sim.body.parts import DETAIL, LINK, part_of, side_of
from spark.kinematics import end_positions, world_positions
from spark.rig.feet import sole_positions
from spark.rig.flesh import RADII
from spark.rig.rig import Rig

# Fractions of the standing height.
_DETAIL_RADIUS = 0.006  # of fingers, face and helpers
_HEAD_SIZE = np.array([0.055, 0.045, 0.068])  # half axes of the ellipsoid
_NO_BONE = 1e-4  # [m] shorter ones have no shape: a toe may lie in its ankle
_HEAD_CENTER = np.array([0.015, 0.0, 0.055])  # from the head's joint
_INSIDE = 0.95  # of the thickness of what hangs on a link, so that it ends inside of that
_AT_JOINT = np.zeros(3)
HIDDEN_GROUP = 3
"""From this group on viewers don't show geoms: by custom those to collide with."""
_FOOT_HEIGHT = 0.022  # of a foot's box

# Warm on the left, cool on the right: a swapped side is seen at once.
_MATERIALS = {
    "left": (0.93, 0.52, 0.36, 1.0),
    "right": (0.40, 0.60, 0.86, 1.0),
    "middle": (0.82, 0.82, 0.80, 1.0),
}


def add_materials(spec: mujoco.MjSpec) -> None:
    """The colours of the body's sides."""
    for name, rgba in _MATERIALS.items():
        spec.add_material(name=name, rgba=rgba)


def material_of(rig: Rig, joint: int) -> str:
    """The colour of what a joint carries."""
    return side_of(rig, joint) or "middle"


def add_geoms(
    spec: mujoco.MjSpec,
    bodies: dict[int, mujoco.MjsBody],
    rig: Rig,
    hulls: Mapping[int, Hull],
) -> None:
    """Give every body its geoms: its hull where it has one, else simple ones. Those of details, and
    what lies in a foot, are only seen: feet stand on boxes, which a foot's hull hides."""
    geoms = _GeomBuilder(spec, bodies, rig)
    for j in bodies:
        part = part_of(rig, j)
        if j in hulls:
            geoms.hull(j, hulls[j])
        elif part == "head":
            geoms.head(j)
        elif part not in ("foot", "toe"):
            geoms.bones(j, part)
    geoms.feet(hulls)


class _GeomBuilder:
    """Adds geoms to the bodies of a rig in its T-pose."""

    def __init__(self, spec: mujoco.MjSpec, bodies: dict[int, mujoco.MjsBody], rig: Rig) -> None:
        self.spec, self.bodies, self.rig = spec, bodies, rig
        self.height = rig.standing_height
        self.pos = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
        self.ends = end_positions(rig.skeleton, self.pos, rig.tpose)

    def bones(self, joint: int, part: str) -> None:
        """A capsule along each of the joint's bones; what leads to a foot ends above the sole. A
        chest that carries an arm itself has a shoulder, from beside the neck. A link is as thick as
        what hangs on it, but for those between the floor and the pelvis."""
        tips = self._tips(joint)
        necks = [tip for end, tip in tips if end in ("neck", "head")]
        for end, tip in tips:
            shoulder = part == "spine" and end == "upper_arm"
            inside = part == LINK and end != "pelvis"
            flesh = "clavicle" if shoulder else end if inside else part
            radius = RADII.get(flesh, _DETAIL_RADIUS) * self.height * (_INSIDE if inside else 1)
            start = _AT_JOINT
            if shoulder and necks:
                start = necks[0] * np.clip(tip @ necks[0] / (necks[0] @ necks[0]), 0, 1)
            if part == "lower_leg" or end == "foot":
                tip = tip * max(0.5, 1.0 - radius / float(np.linalg.norm(tip)))
            self._capsule(joint, tip, radius, self._class(joint), start)

    def hull(self, joint: int, hull: Hull) -> None:
        """A convex mesh."""
        name = self.rig.skeleton.names[joint]
        self.spec.add_mesh(
            name=name, uservert=hull.vertices.ravel(), userface=hull.faces.astype(np.int32).ravel()
        )
        self.bodies[joint].add_geom(
            self.spec.find_default(self._class(joint)),
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            material=material_of(self.rig, joint),
        )

    def head(self, joint: int) -> None:
        """An ellipsoid, upright on its joint."""
        self.bodies[joint].add_geom(
            self.spec.find_default("collision"),
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            pos=_HEAD_CENTER * self.height,
            size=_HEAD_SIZE * self.height,
            material=material_of(self.rig, joint),
        )

    def feet(self, hulls: Mapping[int, Hull]) -> None:
        """A box under each foot and one under its toes, their lower corners the soles' points; out
        of sight where the foot has a hull."""
        for sole in self.rig.soles:
            foot, toe = sole.foot, sole.toe
            points = sole_positions(sole, self.pos, self.rig.tpose)
            radius = RADII["foot"] * self.height
            if toe is None:
                self._box(foot, points, hidden=foot in hulls)
                ball = points.mean(axis=0) + np.array([0, 0, radius])
            else:
                self._box(foot, points[:4], hidden=foot in hulls)
                self._box(toe, points[2:], hidden=toe in hulls)
                ball = self.pos[toe]
            if foot not in hulls:
                self._capsule(foot, ball - self.pos[foot], radius, "visual")

    def _tips(self, joint: int) -> list[tuple[str, Float[np.ndarray, "3"]]]:
        """The bones of a joint, each with the part that it leads to: to children that carry on the
        body, or, at the end of a limb, to all children and End Sites."""
        rig, skeleton = self.rig, self.rig.skeleton
        children = skeleton.children[joint]
        kept = [c for c in children if part_of(rig, c) != DETAIL]
        tips = [(self._leads_to(c), self.pos[c] - self.pos[joint]) for c in kept or children]
        if not kept:
            ends = self.ends[skeleton.end_parents == joint] - self.pos[joint]
            tips += [(DETAIL, end) for end in ends]
        return [(end, bone) for end, bone in tips if np.linalg.norm(bone) > _NO_BONE]

    def _leads_to(self, joint: int) -> str:
        """A joint's part, or, of a link, that of what hangs on it."""
        parts = (part_of(self.rig, k) for k in self.rig.skeleton.subtree(joint))
        return next((part for part in parts if part != LINK), LINK)

    def _capsule(
        self,
        joint: int,
        tip: Float[np.ndarray, "3"],
        radius: float,
        default: str,
        start: Float[np.ndarray, "3"] = _AT_JOINT,
    ) -> None:
        length = float(np.linalg.norm(tip - start))
        if length < _NO_BONE:
            return
        self.bodies[joint].add_geom(
            self.spec.find_default(default),
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*start, *tip],
            size=[min(radius, 0.5 * length + 0.004), 0, 0],
            material=material_of(self.rig, joint),
            group=HIDDEN_GROUP
            if self._loose(joint)
            else self.spec.find_default(default).geom.group,
        )

    def _loose(self, joint: int) -> bool:
        """Hair, cloth, props, face: beside the flesh, so that they would float in pictures."""
        parts = {part_of(self.rig, k) for k in self.rig.skeleton.ancestors(joint)}
        return part_of(self.rig, joint) == DETAIL and not parts & {"hand", "foot"}

    def _class(self, joint: int) -> str:
        above = self.rig.skeleton.ancestors(joint)
        foot = any(part_of(self.rig, k) == "foot" for k in above)
        return "visual" if foot or part_of(self.rig, joint) == DETAIL else "collision"

    def _box(self, joint: int, points: Float[np.ndarray, "P 3"], *, hidden: bool) -> None:
        """A flat box between points of the sole; thinner than the joint is high."""
        low, high = points.min(0) - self.pos[joint], points.max(0) - self.pos[joint]
        half = np.maximum((high - low) / 2, _NO_BONE)
        half[2] = min(_FOOT_HEIGHT * self.height, max(-low[2], 0.01)) / 2
        box = self.bodies[joint].add_geom(
            self.spec.find_default("foot"),
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=(low + high) / 2 + [0, 0, half[2]],
            size=half,
            material=material_of(self.rig, joint),
        )
        if hidden:
            box.group = HIDDEN_GROUP
