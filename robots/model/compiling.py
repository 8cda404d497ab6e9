"""A spec compiled: as it is, or else with what MuJoCo misses, or without what it can't read."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from robots.model import model_cache
from sim.body.compiling import one_line
from spark.errors import FileFormatError, name_list

_MIN_MASS, _MIN_INERTIA = 1e-4, 1e-8  # [kg], [kg m²] of bodies whose mass went with their meshes


def compiled_or_cached(
    spec: mujoco.MjSpec, path: Path, notes: list[str], key: Callable[[], str | None]
) -> mujoco.MjModel:
    """The model of a spec; from the disk where it was stored under this `key`, which is worked out
    from files that may change.

    What had to be changed in the spec is added to `notes`; such a model is not stored. Raises
    FileFormatError where MuJoCo can't compile it, or a body's mass is below 0.
    """
    _check_masses(spec, path)
    name = key()
    stored = None if name is None else model_cache.load(name)
    if stored is not None:
        return stored
    before = len(notes)
    # MuJoCo's own cache takes a mesh for the one it had, if both were written in one second.
    mujoco.mj_clearCache(mujoco.mj_getCache())
    model = _compile(spec, path, notes)
    if name is not None and len(notes) == before and key() == name:
        model_cache.store(name, model)
    return model


def _compile(spec: mujoco.MjSpec, path: Path, notes: list[str]) -> mujoco.MjModel:
    try:
        return spec.compile()
    except Exception as error:  # of MuJoCo or its binding, which has several kinds
        message = one_line(error)
    if "mjMINVAL" in message and not spec.compiler.boundmass:
        spec.compiler.boundmass, spec.compiler.boundinertia = _MIN_MASS, _MIN_INERTIA
        at = len(notes)
        model = _compile(spec, path, notes)
        notes.insert(at, f"some bodies move without mass, and get next to none: {_least(model)}")
        return model
    dropped: list[str] = []
    meshes, last, lost = bool(list(spec.meshes)), "", ""
    first = _drop_extras if _compiles_without_extras(spec) else _drop_assets
    for parts, drop in sorted(_SPARED, key=lambda part: part[1] is not first):
        if drop is _drop_assets and not _has_assets(spec):
            continue
        drop(spec)
        dropped.append(parts)
        if drop is _drop_assets and meshes:
            lost = ": shapes and masses are incomplete"
        try:
            model = spec.compile()
        except Exception as error:
            last = one_line(error)
            continue
        notes.append(f"read without {', '.join(dropped)} ({message}){lost}")
        return model
    raise FileFormatError(
        path,
        None,
        f"MuJoCo can't compile it: {message}"
        + (f"; nor without {', '.join(dropped)}: {last}" if last != message else ""),
    )


def _check_masses(spec: mujoco.MjSpec, path: Path) -> None:
    """Raise where a mass or a moment that is given for a body is below 0. MuJoCo says it is too
    small, or lifts it to the least that the file allows."""
    for body in spec.bodies[1:]:
        least = min(body.mass, *body.inertia)
        if body.explicitinertial and least < 0:
            what = f"mass={body.mass:g}" if body.mass < 0 else f"moments of {least:g} kg m²"
            raise FileFormatError(
                path, None, f"body {body.name!r}: its <inertial> has {what}; expected more than 0"
            )


def _least(model: mujoco.MjModel) -> str:
    """The names of the moving bodies that have the mass or a moment of those without one."""
    light = model.body_mass <= _MIN_MASS
    light |= (model.body_inertia <= _MIN_INERTIA).any(axis=1)
    return name_list([model.body(b).name for b in np.flatnonzero(light & (model.body_dofnum > 0))])


def _compiles_without_extras(spec: mujoco.MjSpec) -> bool:
    without = spec.copy()
    _drop_extras(without)
    try:
        without.compile()
    except Exception:
        return False
    return True


def _has_assets(spec: mujoco.MjSpec) -> bool:
    files = any(mesh.file for mesh in spec.meshes)
    named = any(geom.material for geom in spec.geoms)
    return bool(files or named or list(spec.textures) or list(spec.hfields))


def _drop_extras(spec: mujoco.MjSpec) -> None:
    """Delete what is no part of the body, and names parts that may not be there."""
    for kind in ("sensors", "keys", "tuples"):
        for element in list(getattr(spec, kind)):
            spec.delete(element)


def _drop_drives(spec: mujoco.MjSpec) -> None:
    """Delete what moves the body, or says which of its shapes touch."""
    for kind in ("actuators", "tendons", "pairs", "excludes"):
        for element in list(getattr(spec, kind)):
            spec.delete(element)


def _drop_assets(spec: mujoco.MjSpec) -> None:
    """Delete whatever needs a file, and give massless bodies a little mass."""
    for geom in list(spec.geoms):
        if geom.meshname or geom.hfieldname:
            spec.delete(geom)
        else:
            geom.material = ""
    for site in spec.sites:
        site.material = ""
    for kind in ("skins", "materials", "textures", "hfields", "meshes"):
        for element in list(getattr(spec, kind)):
            spec.delete(element)
    spec.compiler.boundmass = _MIN_MASS
    spec.compiler.boundinertia = _MIN_INERTIA


# What a model is read without where it can't be compiled with it, one after another.
_SPARED: tuple[tuple[str, Callable[[mujoco.MjSpec], None]], ...] = (
    ("meshes and textures", _drop_assets),
    ("sensors and keyframes", _drop_extras),
    ("motors, tendons and contact pairs", _drop_drives),
)
