"""Where files of the SMPL family keep what, by names: AMASS, GVHMR, and others like them.

All say rotations from parent to joint since the model's rest pose, as rotation vectors; they differ
in names, in what is left out, and in the axis that points up.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from spark.errors import FileFormatError
from spark.io.arrays import Arrays, first_of, held, numbers, rate_in
from spark.io.convention import Up
from spark.io.smpl_motion import SmplMotion
from spark.io.smpl_rotations import BODY, POSES, ROOT, rotations_in
from spark.io.tensors import Tensor, Unknown, read_tensors

# Names of one thing in files of different tools.
_TRANS = ("trans", "transl", "translation", "smpl_trans", "root_trans", "trans_world")
_BETAS = ("betas", "beta", "shape", "smpl_betas")
_GENDER = ("gender", "sex")

KEYS = frozenset({*POSES, *ROOT, *BODY} - {"pose"})
"""An npz with one of these holds a body of the family."""

SIGNS = frozenset({"betas", "v_template", "surface_model_type"})
"""An npz with one of these has to do with the family, though it may be no motion."""

# Of the vectors in a dict of a video method, those in the world come first.
_WORLD_FIRST = ("smpl_params_global", "smplx_params_global", "world", "global")


def from_npz(arrays: Arrays, path: Path) -> SmplMotion:
    """The motion in the named arrays of an npz. Raises `FileFormatError` where it has none."""
    if "v_template" in arrays:
        raise FileFormatError(
            path, None, "is a body model and no motion; give it with --body-model beside a motion"
        )
    if not KEYS & arrays.keys():
        raise FileFormatError(
            path,
            None,
            f"has no motion of a body: expected 'poses', or 'root_orient' and 'pose_body'; it "
            f"holds {held(arrays)}",
        )
    amass = bool({"mocap_framerate", "mocap_frame_rate"} & {*arrays, *arrays.pickled})
    motion = _named(arrays, path, "AMASS" if amass else "SMPL", "z" if amass else "y")
    if arrays.pickled:
        left = ", ".join(map(repr, arrays.pickled))
        motion = replace(motion, notes=(*motion.notes, f"Python objects are not read: {left}"))
    return motion


def from_tensors(path: Path) -> SmplMotion:
    """The motion in a file of `torch.save`, GVHMR's `hmr4d_results.pt` and others' like it."""
    found = _find(read_tensors(path), 0)
    if found is None:
        raise FileFormatError(
            path,
            None,
            "has no motion of a body; expected a dict with 'smpl_params_global' (GVHMR), or with "
            "'global_orient', 'body_pose' and 'transl'",
        )
    name, content = found
    arrays = {
        key: value.array() if isinstance(value, Tensor) else np.asarray(value)
        for key, value in content.items()
        if isinstance(key, str) and isinstance(value, Tensor | int | float | str)
    }
    arrays = {key: array[0] if _batched(array) else array for key, array in arrays.items()}
    if name == "smpl_params_global":
        return replace(_named(arrays, path, "GVHMR", "y"), smplx=True)
    return _named(arrays, path, "SMPL", "y")


def _named(arrays: Mapping[str, np.ndarray], path: Path, origin: str, up: Up) -> SmplMotion:
    """The motion in named arrays."""
    notes: list[str] = []
    rotvecs = rotations_in(arrays, path, notes)
    count = len(rotvecs)
    trans = None
    if (name := first_of(arrays, _TRANS)) is not None:
        trans = numbers(arrays, name, path).reshape(-1, arrays[name].shape[-1])
        if trans.shape != (count, 3):
            raise FileFormatError(
                path,
                None,
                f"{name!r} has {len(trans)} rows of {trans.shape[1]} for {count} frames; expected "
                "three numbers a frame",
            )
    betas = None
    if (name := first_of(arrays, _BETAS)) is not None and arrays[name].size:
        given = numbers(arrays, name, path)
        betas = np.median(given.reshape(-1, given.shape[-1] if given.ndim else 1), axis=0)
    fps = rate_in(arrays, path, notes)
    return SmplMotion(
        rotvecs,
        trans,
        origin,
        up,
        betas=betas,
        gender=_text(arrays, _GENDER),
        fps=fps,
        notes=tuple(notes),
    )


def _text(arrays: Mapping[str, np.ndarray], names: Iterable[str]) -> str | None:
    """A word, which tools write as text or as bytes."""
    name = first_of(arrays, names)
    if name is None or arrays[name].dtype.kind not in "US" or not arrays[name].size:
        return None
    word = arrays[name].ravel()[0]
    return (word.decode("latin-1") if isinstance(word, bytes) else str(word)).strip().lower()


def _batched(array: np.ndarray) -> bool:
    """Whether it is one motion of several: (1, T, n)."""
    return array.ndim == 3 and len(array) == 1 and array.shape[2] != 3


def _find(content: object, depth: int) -> tuple[str, dict[object, object]] | None:
    """The dict that holds a body's motion, in the world where there are several; and its name."""
    if not isinstance(content, dict) or depth > 4 or isinstance(content, Unknown):
        return None
    names = [str(key) for key in content]
    if any(n in names for n in POSES[:-1]) or (
        any(n in names for n in ROOT) and any(n in names for n in BODY)
    ):
        return "", content
    for key in sorted(content, key=lambda k: (str(k) not in _WORLD_FIRST, "cam" in str(k))):
        found = _find(content[key], depth + 1)
        if found is not None:
            return found[0] or str(key), found[1]
    return None
