"""What carries a robot through the world: the body that all of it hangs on, and its free joint."""

from pathlib import Path

import mujoco
import numpy as np

from sim.body.mj_joints import FREE, SLIDE
from spark.errors import SkeletonError

_DOFS = 6  # of a body in the world
_RIVAL_SHARE = 0.5  # a second tree with this share of the first one's joints is another robot


def find_root(spec: mujoco.MjSpec, path: Path) -> str:
    """The name of the world's child that carries the humanoid; unnamed bodies get names.

    Raises `SkeletonError` where nothing has joints, or as many hang on several.
    """
    for number, body in enumerate(spec.bodies):
        if not body.name:
            body.name = f"body_{number}"
    counts = {body.name: _hinges_below(body) for body in spec.worldbody.bodies}
    ranked = sorted((name for name in counts if counts[name]), key=lambda n: -counts[n])
    if not ranked:
        raise SkeletonError(f"{path}: the model has no joints; expected a humanoid with hinges")
    first, others = ranked[0], ranked[1:]
    rivals = [n for n in others if counts[n] >= _RIVAL_SHARE * counts[first]]
    if rivals:
        both = ", ".join(repr(n) for n in (first, *rivals))
        if any(_is_free(j) for n in (first, *rivals) for j in spec.body(n).joints):
            what = "holds several robots; expected one: keep one of them in the file"
        else:
            what = "has limbs that hang on the world itself; give the trunk a body that holds them"
        raise SkeletonError(f"{path}: the model {what} (bodies {both})")
    return first


def _hinges_below(body: mujoco.MjsBody) -> int:
    own = sum(not _is_free(joint) for joint in body.joints)
    return own + sum(_hinges_below(child) for child in body.bodies)


def _is_free(joint: mujoco.MjsJoint) -> bool:
    return int(joint.type) == FREE


def free_root(spec: mujoco.MjSpec, root: str, path: Path, notes: list[str]) -> None:
    """Give the root a free joint: it has none, or moves by a chain of slides and hinges.

    Raises `SkeletonError` where it turns, but can't move.
    """
    body = spec.body(root)
    joints = _base_joints(body)
    if any(_is_free(joint) for joint in joints):
        return
    if joints and not any(int(joint.type) == SLIDE for joint in joints):
        raise SkeletonError(
            f"{path}: the root {root!r} turns about {joints[0].name!r} but can't move; expected a "
            "free joint, or none"
        )
    for key in list(spec.keys):  # of other coordinates
        spec.delete(key)
    if joints:
        names = [joint.name for joint in joints]
        for element in [*(a for a in spec.actuators if a.target in names), *joints]:
            spec.delete(element)
        moves = ", ".join(map(repr, names))
        notes.append(f"the root {root!r} moves by {moves}; in qpos a free joint stands for them")
    else:
        notes.append(f"no free joint: one was given to {root!r}, its first 7 numbers in qpos")
    body.add_freejoint(name=f"{root}_free")


def _base_joints(root: mujoco.MjsBody) -> list[mujoco.MjsJoint]:
    """The joints that take the root through the world: its own, and where it slides those of the
    bodies below it, as long as nothing else hangs on them and no shape."""
    joints, body = list(root.joints), root
    while (
        any(int(joint.type) == SLIDE for joint in joints)
        and len(list(body.bodies)) == 1
        and not list(body.geoms)
        and len(joints) + len(list(body.bodies[0].joints)) <= _DOFS
    ):
        body = body.bodies[0]
        joints += list(body.joints)
    return joints


def stand(spec: mujoco.MjSpec, model: mujoco.MjModel, root: str) -> None:
    """Lift the root, which a URDF leaves at the origin, so that the lowest of the shapes is on the
    floor."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    if not model.ngeom:
        return
    up = data.geom_xmat[:, 6:]
    middle = data.geom_xpos[:, 2] + (up * model.geom_aabb[:, :3]).sum(1)
    low = float((middle - (np.abs(up) * model.geom_aabb[:, 3:]).sum(1)).min())
    body = int(model.body(root).id)
    model.body_pos[body, 2] -= low
    model.qpos0[int(model.jnt_qposadr[model.body_jntadr[body]]) + 2] -= low
    spec.body(root).pos = model.body_pos[body]
