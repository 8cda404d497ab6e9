"""Where files of the SMPL family keep what, by names: AMASS, GVHMR, and others like them.

All say rotations from parent to joint since the model's rest pose, as rotation vectors; they differ
in names, in what is left out, and in the axis that points up.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.arrays import Arrays, held, numbers
from spark.io.convention import Up
from spark.io.smpl_motion import SmplMotion
from spark.io.tensors import Tensor, Unknown, read_tensors
from spark.rotation import quat_from_matrix, rotvec_from_quat

# Names of one thing in files of different tools.
_POSES = ("poses", "fullpose", "full_pose", "smpl_poses", "smplx_poses", "thetas", "pose")
_ROOT = ("root_orient", "global_orient", "root_pose", "smpl_root_orient")
_BODY = ("pose_body", "body_pose", "smpl_body_pose")
_TRANS = ("trans", "transl", "translation", "smpl_trans", "root_trans", "trans_world")
_BETAS = ("betas", "beta", "shape", "smpl_betas")
_RATE = ("mocap_frame_rate", "mocap_framerate", "mocap_fps", "fps", "frame_rate", "framerate")
_GENDER = ("gender", "sex")
_LEFT = ("left_hand_pose", "pose_lhand", "lhand_pose")
_RIGHT = ("right_hand_pose", "pose_rhand", "rhand_pose")
_FACE = (("pose_jaw", "jaw_pose"), ("leye_pose",), ("reye_pose",))

KEYS = frozenset({*_POSES, *_ROOT, *_BODY} - {"pose"})
"""An npz with one of these holds a body of the family."""

SIGNS = frozenset({"betas", "v_template", "surface_model_type"})
"""An npz with one of these has to do with the family, though it may be no motion."""

_SQUARE = 1e-2  # as far as a network's rotation matrix is from one
_JOINTS = {66: 22, 72: 24, 156: 52, 165: 55}  # by the numbers in a pose

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
    if (poses := _first(arrays, _POSES)) is not None:
        rotvecs = _vectors(arrays, poses, path)
        if rotvecs.shape[1] in (21, 23):
            if (root := _first(arrays, _ROOT)) is None:
                raise FileFormatError(
                    path,
                    None,
                    f"{poses!r} has {rotvecs.shape[1]} joints, all but the root; expected "
                    "'root_orient' or 'global_orient' beside it",
                )
            rotvecs = np.concatenate([_part(arrays, root, path, len(rotvecs), 1), rotvecs], axis=1)
        if rotvecs.shape[1] not in _JOINTS.values():
            raise FileFormatError(
                path,
                None,
                f"{poses!r} has {rotvecs.shape[1]} joints; expected 22, 24 (SMPL), 52 (SMPL-H) or "
                "55 (SMPL-X), three numbers each",
            )
    else:
        rotvecs = _in_parts(arrays, path, notes)
    count = len(rotvecs)
    trans = None
    if (name := _first(arrays, _TRANS)) is not None:
        trans = numbers(arrays, name, path).reshape(-1, arrays[name].shape[-1])
        if trans.shape != (count, 3):
            raise FileFormatError(
                path,
                None,
                f"{name!r} has {len(trans)} rows of {trans.shape[1]} for {count} frames; expected "
                "three numbers a frame",
            )
    betas = None
    if (name := _first(arrays, _BETAS)) is not None and arrays[name].size:
        given = numbers(arrays, name, path)
        betas = np.median(given.reshape(-1, given.shape[-1] if given.ndim else 1), axis=0)
    return SmplMotion(
        rotvecs,
        trans,
        origin,
        up,
        betas=betas,
        gender=_text(arrays, _GENDER),
        fps=_rate(arrays, path),
        notes=tuple(notes),
    )


def _in_parts(
    arrays: Mapping[str, np.ndarray], path: Path, notes: list[str]
) -> Float[np.ndarray, "T J 3"]:
    """Rotations from arrays for the root, the body, the face and the hands."""
    root, body = _first(arrays, _ROOT), _first(arrays, _BODY)
    if body is None or root is None:
        missing = "'root_orient' or 'global_orient'" if root is None else "'pose_body'"
        raise FileFormatError(
            path, None, f"has no {missing}; it holds {', '.join(map(repr, arrays))}"
        )
    whole = _vectors(arrays, body, path)
    if whole.shape[1] in (21, 23):
        whole = np.concatenate([_part(arrays, root, path, len(whole), 1), whole], axis=1)
    elif whole.shape[1] not in (22, 24):
        raise FileFormatError(
            path, None, f"{body!r} has {whole.shape[1]} joints; expected 21 (SMPL-X) or 23 (SMPL)"
        )
    count, hands = len(whole), []
    if "pose_hand" in arrays:
        both = _vectors(arrays, "pose_hand", path)
        hands = [both] if both.shape[1] == 30 and len(both) == count else []
    elif (left := _first(arrays, _LEFT)) and (right := _first(arrays, _RIGHT)):
        sides = [arrays[left], arrays[right]]
        if all(side.size == count * 45 for side in sides):
            hands = [_part(arrays, name, path, count, 15) for name in (left, right)]
        elif any(side.size for side in sides):
            notes.append("hands are not 15 rotations each (a model's PCA?): left out")
    if not hands:
        return whole
    face = []
    for names in _FACE:
        name = _first(arrays, names)
        fits = name is not None and arrays[name].size == count * 3
        face.append(_part(arrays, name or "", path, count, 1) if fits else np.zeros((count, 1, 3)))
    if "pose_eye" in arrays and arrays["pose_eye"].size == count * 6:
        face[1:] = [_part(arrays, "pose_eye", path, count, 2)]
    return np.concatenate([whole[:, :22], *face, *hands], axis=1)


def _vectors(arrays: Mapping[str, np.ndarray], name: str, path: Path) -> Float[np.ndarray, "T J 3"]:
    """Rotation vectors in an array (T, J * 3) or (T, J, 3), or of matrices (T, J, 3, 3)."""
    values = _plain_vectors(arrays, name, path)
    if values.ndim not in (2, 3) or (values.ndim == 3 and values.shape[2] != 3):
        raise FileFormatError(
            path,
            None,
            f"{name!r} is {' x '.join(map(str, values.shape)) or 'one number'}; expected frames x "
            "joints x 3",
        )
    if values.ndim == 2 and values.shape[1] % 3:
        raise FileFormatError(
            path, None, f"{name!r} has {values.shape[1]} numbers a frame; expected 3 for each joint"
        )
    if not len(values):
        raise FileFormatError(path, None, "has no frames")
    return values.reshape(len(values), -1, 3)


def _part(
    arrays: Mapping[str, np.ndarray], name: str, path: Path, frames: int, joints: int
) -> Float[np.ndarray, "T J 3"]:
    values = _plain_vectors(arrays, name, path)
    if values.size != frames * joints * 3:
        raise FileFormatError(
            path,
            None,
            f"{name!r} is {' x '.join(map(str, values.shape))}; expected {frames} frames x "
            f"{3 * joints}",
        )
    return values.reshape(frames, joints, 3)


def _plain_vectors(arrays: Mapping[str, np.ndarray], name: str, path: Path) -> np.ndarray:
    """The array, rotation vectors in place of matrices."""
    values = numbers(arrays, name, path)
    if values.ndim not in (3, 4) or values.shape[-2:] != (3, 3):
        return values
    if values.ndim == 3:  # (T, 3, 3): of one joint; three joints are no part of a body
        values = values[:, None]
    square = values @ values.swapaxes(-1, -2)
    if np.abs(square - np.eye(3)).max(initial=0) > _SQUARE or (np.linalg.det(values) < 0).any():
        raise FileFormatError(path, None, f"{name!r} holds 3 x 3 matrices that are no rotations")
    return rotvec_from_quat(quat_from_matrix(values))


def _first(arrays: Mapping[str, np.ndarray], names: Iterable[str]) -> str | None:
    return next((name for name in names if name in arrays), None)


def _text(arrays: Mapping[str, np.ndarray], names: Iterable[str]) -> str | None:
    """A word, which tools write as text or as bytes."""
    name = _first(arrays, names)
    if name is None or arrays[name].dtype.kind not in "US" or not arrays[name].size:
        return None
    word = arrays[name].ravel()[0]
    return (word.decode("latin-1") if isinstance(word, bytes) else str(word)).strip().lower()


def _rate(arrays: Mapping[str, np.ndarray], path: Path) -> float | None:
    name = _first(arrays, _RATE)
    if name is None or arrays[name].size != 1:
        return None
    fps = float(numbers(arrays, name, path).ravel()[0])
    if not 1 <= fps <= 10000:
        raise FileFormatError(path, None, f"{name!r} is {fps:g}; expected frames a second")
    return fps


def _batched(array: np.ndarray) -> bool:
    """Whether it is one motion of several: (1, T, n)."""
    return array.ndim == 3 and len(array) == 1 and array.shape[2] != 3


def _find(content: object, depth: int) -> tuple[str, dict[object, object]] | None:
    """The dict that holds a body's motion, in the world where there are several; and its name."""
    if not isinstance(content, dict) or depth > 4 or isinstance(content, Unknown):
        return None
    names = [str(key) for key in content]
    if any(n in names for n in _POSES[:-1]) or (
        any(n in names for n in _ROOT) and any(n in names for n in _BODY)
    ):
        return "", content
    for key in sorted(content, key=lambda k: (str(k) not in _WORLD_FIRST, "cam" in str(k))):
        found = _find(content[key], depth + 1)
        if found is not None:
            return found[0] or str(key), found[1]
    return None
