"""Whether a model's numbers are some, and where they are not."""

from pathlib import Path

import mujoco
import numpy as np

from robots.model.xml import parse_xml
from spark.errors import FileFormatError

_MAX_OFFSET = 1e4  # [m] of a body from its parent: beyond, floats lose millimetres; it is a mistake
_NUMBERS = (
    *("qpos0", "body_quat", "body_mass", "body_inertia", "body_ipos", "body_iquat"),
    *("jnt_pos", "jnt_axis", "jnt_range", "geom_pos", "geom_quat", "geom_size"),
    *("site_pos", "site_quat", "mesh_vert"),
)
_KINDS = {"body": "body", "jnt": "joint", "geom": "geom", "site": "site"}


def check_finite(model: mujoco.MjModel, path: Path) -> None:
    """Raise FileFormatError where a number of the model is none, or no length or mass that is."""
    for what in ("body", "jnt", "geom"):
        places = np.abs(getattr(model, f"{what}_pos"))
        if not (places < _MAX_OFFSET).all():
            place = _named(model, what, int(np.argmin((places < _MAX_OFFSET).all(axis=1))))
            raise FileFormatError(
                path, None, f"{place}: its place is no number of metres below {_MAX_OFFSET:g}"
            )
    for name in _NUMBERS:
        values = np.isfinite(getattr(model, name))
        if not values.all():
            what, _, number = name.partition("_")
            row = int(np.argmin(values.reshape(len(values), -1).all(axis=1)))
            place = f"{_named(model, what, row)}: " if what in _KINDS else ""
            raise FileFormatError(
                path, None, f"{place}has numbers that are not finite ({number or what})"
            )


def _named(model: mujoco.MjModel, what: str, row: int) -> str:
    """What an element of the model is called, by MuJoCo's prefix of its kind."""
    return f"{_KINDS[what]} {getattr(model, what)(row).name or row!r}"


def nan_in(path: Path, text: str) -> str:
    """Where the MJCF of a file has NaN."""
    for element in parse_xml(path, text.encode("utf-8", "replace"), "utf-8").iter():
        for name, value in element.attrib.items():
            if "nan" in value.lower().split():
                return f"{element.tag} {element.get('name', '')!r}: {name}={value[:60]!r}"
    return "NaN"
