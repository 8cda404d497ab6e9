"""Models of humanoids, MJCF or URDF: any that MuJoCo can compile, with a free joint where there is
none.

Only the kinematics matter here, so a file whose meshes are missing is read without them.
"""

import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model import model_cache
from robots.model.base import find_root, free_root, stand
from robots.model.compiling import compiled_or_cached
from robots.model.finite import check_finite, nan_in
from robots.model.mjcf_source import read_source
from robots.model.urdf import is_urdf, read_urdf
from sim.body.compiling import one_line, warnings_as_notes
from sim.body.mj_joints import SLIDE, body_name, hinges_and_balls, joint_name
from sim.trajectory import subtree
from spark.errors import FileFormatError, name_list
from spark.summary import brief, counted

_EQ_JOINT = int(mujoco.mjtEq.mjEQ_JOINT)
_MESH = mujoco.mjtGeom.mjGEOM_MESH


@dataclass(frozen=True, eq=False)
class Mjcf:
    """A compiled model and the spec it comes from; `root` is the body with the free joint of the
    one humanoid."""

    model: mujoco.MjModel
    spec: mujoco.MjSpec
    root: int
    path: Path
    notes: tuple[str, ...] = ()

    __repr__ = brief

    @property
    def base_qpos(self) -> int:
        """Where `qpos` has the root's position [m], and then its quaternion (wxyz)."""
        return int(self.model.jnt_qposadr[self.model.body_jntadr[self.root]])

    @property
    def base_dof(self) -> int:
        """Where `qvel` has the root's linear velocity, and then its angular one."""
        return int(self.model.jnt_dofadr[self.model.body_jntadr[self.root]])

    def bodies(self) -> list[int]:
        """The root and all bodies below it, parents first."""
        return subtree(self.model, self.root)

    def joints(self) -> list[int]:
        """The hinges and balls of the robot in the order of the tree."""
        return hinges_and_balls(self.model, self.root)

    def followers(self) -> list[tuple[int, int, Float[np.ndarray, "5"]]]:
        """The joints that follow others (mimic joints), those others, and the polynomial that takes
        their turn since the rest pose to the followers'."""
        model, own = self.model, set(self.joints())
        pairs = [
            (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]), model.eq_data[k, :5].copy())
            for k in range(model.neq)
            if int(model.eq_type[k]) == _EQ_JOINT and model.eq_active0[k]
        ]
        return [pair for pair in pairs if pair[0] in own and pair[1] in own]

    def joint_name(self, joint: int) -> str:
        """The joint's name, or where it sits if it has none."""
        return joint_name(self.model, joint)

    def body_name(self, body: int) -> str:
        """The body's name, or its number if it has none."""
        return body_name(self.model, body)


def read_mjcf(path: str | Path, *, visuals: bool = True) -> Mjcf:
    """Read and compile an MJCF (or a scene that includes one), or a URDF.

    Without `visuals`, meshes that do not collide are left out: coordinates are the same, and
    reading is several times faster. Raises FileFormatError where MuJoCo can't compile the file, and
    SkeletonError where it holds no robot or several.
    """
    path = Path(path)
    notes: list[str] = []
    with warnings_as_notes(notes):
        spec, text = parse_model(path, notes, visuals=visuals)
        if not visuals:
            _drop_visuals(spec)
        root = find_root(spec, path)
        free_root(spec, root, path, notes)
        model = compiled_or_cached(spec, path, notes, partial(model_cache.key, spec, text, visuals))
    if is_urdf(path):
        stand(spec, model, root)
    _note_others(model, root, notes)
    _note_ignored(model, notes)
    check_finite(model, path)
    return Mjcf(model, spec, int(model.body(root).id), path, tuple(notes))


def parse_model(path: Path, notes: list[str], *, visuals: bool = True) -> tuple[mujoco.MjSpec, str]:
    """The spec of a file, and the text that MuJoCo was given."""
    if is_urdf(path):
        return read_urdf(path, notes, visuals=visuals)
    source = read_source(path)
    try:
        spec = mujoco.MjSpec.from_string(source.text, include=source.models)
    except Exception as error:  # of MuJoCo or its binding, which has several kinds
        message = one_line(error) if source.whole else re.sub(r",? line \d+", "", one_line(error))
        raise FileFormatError(path, None, f"MuJoCo can't read it: {message}") from error
    if any("'NaN'" in note for note in notes):
        raise FileFormatError(path, None, f"{nan_in(path, source.text)} is no number")
    spec.modelfiledir = str(path.parent)
    return spec, source.text


def _drop_visuals(spec: mujoco.MjSpec) -> None:
    """Delete the meshes that don't collide, of bodies that have other shapes or a mass given."""
    for body in spec.bodies:
        if body.name == "world":
            continue
        seen = [
            g for g in body.geoms if g.type == _MESH and not int(g.contype) | int(g.conaffinity)
        ]
        if len(seen) < len(list(body.geoms)) and body.explicitinertial:
            for geom in seen:
                spec.delete(geom)
    used = {g.meshname for g in spec.geoms if g.type == _MESH}
    skins = bool(list(spec.skins))
    for mesh in list(spec.meshes):
        if mesh.name and mesh.name not in used and not skins:
            spec.delete(mesh)


def _note_others(model: mujoco.MjModel, root: str, notes: list[str]) -> None:
    """What else moves in the world, and where the base is in qpos where that begins with others."""
    body = int(model.body(root).id)
    roots = {int(model.body_rootid[int(b)]) for b in model.jnt_bodyid} - {body}
    if not roots:
        return
    names = name_list([model.body(b).name for b in sorted(roots)])
    base = int(model.jnt_qposadr[model.body_jntadr[body]])
    where = f"; the base is in columns {base} to {base + 6} of qpos, after theirs" if base else ""
    notes.append(f"beside the robot {root!r}, {names} can move, and stay where they are{where}")


def _note_ignored(model: mujoco.MjModel, notes: list[str]) -> None:
    slides = [model.joint(j).name for j in range(model.njnt) if int(model.jnt_type[j]) == SLIDE]
    if slides:
        stay = "stays" if len(slides) == 1 else "stay"
        notes.append(f"{counted(len(slides), 'sliding joint')} {stay} at 0: {name_list(slides)}")
    following = sum(int(kind) == _EQ_JOINT for kind in model.eq_type)
    if following:
        who = "1 joint follows another" if following == 1 else f"{following} joints follow others"
        notes.append(f"{who}, as the model's constraints say")
    if model.neq > following:
        others = counted(model.neq - following, "other equality constraint")
        notes.append(f"ignored: {others}")
