"""The rotations of a body of the SMPL family in named arrays: whole or in parts (root, body, hands,
face), as vectors or as matrices."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.arrays import first_of, numbers
from spark.rotation import quat_from_matrix, rotvec_from_quat

# Names of one thing in files of different tools.
POSES = ("poses", "fullpose", "full_pose", "smpl_poses", "smplx_poses", "thetas", "pose")
ROOT = ("root_orient", "global_orient", "root_pose", "smpl_root_orient")
BODY = ("pose_body", "body_pose", "smpl_body_pose")
_LEFT = ("left_hand_pose", "pose_lhand", "lhand_pose")
_RIGHT = ("right_hand_pose", "pose_rhand", "rhand_pose")
_FACE = (("pose_jaw", "jaw_pose"), ("leye_pose",), ("reye_pose",))

_SQUARE = 1e-2  # as far as a network's rotation matrix is from one
_JOINTS = (22, 24, 52, 55)


def rotations_in(
    arrays: Mapping[str, np.ndarray], path: Path, notes: list[str]
) -> Float[np.ndarray, "T J 3"]:
    """Rotation vectors of a body's joints, the root's first: of 22, 24 (SMPL), 52 (SMPL-H) or 55
    (SMPL-X). Raises `FileFormatError` where the arrays have no such; `notes` says what is left
    out."""
    poses, root = first_of(arrays, POSES), first_of(arrays, ROOT)
    if poses is None:
        return _in_parts(arrays, path, notes)
    whole = _vectors(arrays, poses, path)
    if whole.shape[1] in (21, 23):
        if root is None:
            raise FileFormatError(
                path,
                None,
                f"{poses!r} has {whole.shape[1]} joints, all but the root; expected "
                "'root_orient' or 'global_orient' beside it",
            )
        whole = np.concatenate([_part(arrays, root, path, len(whole), 1), whole], axis=1)
    if whole.shape[1] not in _JOINTS:
        raise FileFormatError(
            path,
            None,
            f"{poses!r} has {whole.shape[1]} joints; expected 22, 24 (SMPL), 52 (SMPL-H) or "
            "55 (SMPL-X), three numbers each",
        )
    return whole


def _in_parts(
    arrays: Mapping[str, np.ndarray], path: Path, notes: list[str]
) -> Float[np.ndarray, "T J 3"]:
    """Rotations from arrays for the root, the body, the face and the hands."""
    root, body = first_of(arrays, ROOT), first_of(arrays, BODY)
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
    hands = _hands(arrays, path, len(whole), notes)
    if not hands:
        return whole
    return np.concatenate([whole[:, :22], *_face(arrays, path, len(whole)), *hands], axis=1)


def _hands(
    arrays: Mapping[str, np.ndarray], path: Path, count: int, notes: list[str]
) -> list[Float[np.ndarray, "T J 3"]]:
    """The rotations of the fingers of `count` frames, left and then right; none where a file has
    none, or only a model's PCA of them."""
    if "pose_hand" in arrays:
        both = _vectors(arrays, "pose_hand", path)
        return [both] if both.shape[1] == 30 and len(both) == count else []
    left, right = first_of(arrays, _LEFT), first_of(arrays, _RIGHT)
    if not left or not right:
        return []
    sizes = arrays[left].size, arrays[right].size
    if sizes == (count * 45, count * 45):
        return [_part(arrays, name, path, count, 15) for name in (left, right)]
    if any(sizes):
        notes.append("hands are not 15 rotations each (a model's PCA?): left out")
    return []


def _face(
    arrays: Mapping[str, np.ndarray], path: Path, count: int
) -> list[Float[np.ndarray, "T _ 3"]]:
    """The rotations of jaw and eyes; none where a file has none."""
    face = []
    for names in _FACE:
        name = first_of(arrays, names)
        fits = name is not None and arrays[name].size == count * 3
        face.append(_part(arrays, name or "", path, count, 1) if fits else np.zeros((count, 1, 3)))
    if "pose_eye" in arrays and arrays["pose_eye"].size == count * 6:
        face[1:] = [_part(arrays, "pose_eye", path, count, 2)]
    return face


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
