"""The floor that a motion is simulated on, and what is on it."""

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.geoms import HIDDEN_GROUP
from sim.physics.overlaps import let_overlap
from sim.physics.stated import add_stated
from sim.physics.unaided import leave_unaided
from sim.trajectory import ModelTrajectory
from spark.errors import SkeletonError
from spark.terrain import Terrain

_SAME_HEIGHT, _SAME_TILT = 1e-3, 1e-3  # [m], [rad]: within these a plane is the floor
_AWAY = 100.0  # [m] below the floor: where no body comes
_PLANE = mujoco.mjtGeom.mjGEOM_PLANE


class Props(NamedTuple):
    """What is on the floor: stools that a body sits on, the middle of the seat of each [m, world],
    as wide as their `radius` [m] says; and the `terrain` that is stated [m, world]."""

    seats: Float[np.ndarray, "K 3"] = np.zeros((0, 3))
    radius: float = 0.0
    terrain: Terrain | None = None


NO_PROPS = Props()


def on_floor(
    body: ModelTrajectory, floor_z: float, notes: list[str], props: Props = NO_PROPS
) -> mujoco.MjSpec:
    """A copy of the body's spec with something that collides, a floor at the motion's, and props
    on it, and nothing else that holds it up; what was assumed is added to `notes`."""
    spec = body.spec.copy()
    leave_unaided(spec, body.model, body.root, notes)
    let_overlap(spec, body, notes)
    _let_something_collide(spec, notes)
    meets = {
        "contype": 1 | _bits(body.model, "conaffinity"),
        "conaffinity": 1 | _bits(body.model, "contype"),
    }
    if not _has_floor(spec, body.model, floor_z, notes):
        spec.worldbody.add_geom(type=_PLANE, size=[0, 0, 1], pos=[0, 0, floor_z], **meets)
    for x, y, z in props.seats.tolist():
        half, middle = (z - floor_z) / 2, (z + floor_z) / 2
        if half > 0:
            size, cylinder = [props.radius, half, 0], mujoco.mjtGeom.mjGEOM_CYLINDER
            spec.worldbody.add_geom(type=cylinder, size=size, pos=[x, y, middle], **meets)
    if props.terrain is not None:
        add_stated(spec, props.terrain, floor_z, meets, notes)
    return spec


def _has_floor(
    spec: mujoco.MjSpec, model: mujoco.MjModel, floor_z: float, notes: list[str]
) -> bool:
    """Whether the model has a plane of its own where the motion's floor is. Planes that are
    elsewhere, of which the motion knows nothing, are put away."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    elements, found, others = list(spec.geoms), False, []
    for plane in np.flatnonzero(np.asarray(model.geom_type) == int(_PLANE)).tolist():
        up, height = data.geom_xmat[plane].reshape(3, 3)[:, 2], float(data.geom_xpos[plane, 2])
        tilt = float(np.arctan2(np.hypot(up[0], up[1]), up[2]))
        if tilt < _SAME_TILT and abs(height - floor_z) < _SAME_HEIGHT:
            found = found or _collides(model, plane)
            continue
        _put_away(elements[plane], data, int(model.geom_bodyid[plane]), floor_z)
        if _collides(model, plane):
            tilted = f", tilted by {np.degrees(tilt):.3g} degrees" if tilt >= _SAME_TILT else ""
            others.append(f"at z = {height:.3g} m{tilted}")
    if others:
        whose = "the model's own plane is" if len(others) == 1 else "planes of the model are"
        notes.append(
            f"{whose} not at the motion's floor ({'; '.join(others)}) and left out here: the body "
            f"stands on a floor at z = {floor_z:.3g} m"
        )
    return found


def _put_away(plane: mujoco.MjsGeom, data: mujoco.MjData, body: int, floor_z: float) -> None:
    """Place a plane, level, where nothing touches it. Contact pairs and sensors may name it, so it
    is not deleted."""
    turn, level = data.xmat[body].reshape(3, 3).T, np.zeros(4)
    mujoco.mju_mat2Quat(level, turn.flatten())
    plane.quat = level
    plane.pos = turn @ (np.array([0.0, 0.0, floor_z - _AWAY]) - data.xpos[body])


def _collides(model: mujoco.MjModel, geom: int) -> bool:
    """Whether anything may touch a shape, by its bits or by a contact pair."""
    pairs = (model.pair_geom1, model.pair_geom2)
    named = any(bool((np.asarray(each) == geom).any()) for each in pairs)
    return named or bool(model.geom_contype[geom] | model.geom_conaffinity[geom])


def _let_something_collide(spec: mujoco.MjSpec, notes: list[str]) -> None:
    """Some files leave contacts to the scene that includes them: with the floor at least."""
    shapes = [geom for body in spec.bodies if body.name != "world" for geom in body.geoms]
    if any(int(geom.contype) | int(geom.conaffinity) for geom in shapes):
        return
    if not shapes:
        raise SkeletonError("the model has no shapes: it would fall through the floor")
    meant = [geom for geom in shapes if int(geom.group) >= HIDDEN_GROUP]
    for geom in meant or shapes:
        geom.conaffinity = 1
    what = f"those of group {HIDDEN_GROUP} and above" if meant else "all of them"
    notes.append(f"no shape of the model is set to collide: {what} do here, with the floor alone")


def _bits(model: mujoco.MjModel, field: str) -> int:
    return int(np.bitwise_or.reduce(getattr(model, f"geom_{field}"), initial=0))
