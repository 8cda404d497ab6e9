"""States of InterMimic (Xu et al., CVPR 2025), in which OmniRetarget has its recordings of OMOMO:
tensors of frames x 591. Among the numbers of a frame are the positions of SMPL-H's joints [m]."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.smpl_body import joints_of
from spark.io.tensors import Tensor, read_tensors

_WIDTH, _FIRST = 591, 162  # numbers of a frame, and the first that is a position
_SIDES = ("left", "right")
_LEG = ("hip", "knee", "ankle", "foot")
_TRUNK = ("spine1", "spine2", "spine3", "neck", "head")
_FINGERS = ("index", "middle", "pinky", "ring", "thumb")
_KNUCKLES = (f"{finger}{k}" for finger in _FINGERS for k in (1, 2, 3))
_ARM = ("collar", "shoulder", "elbow", "wrist", *_KNUCKLES)
_JOINTS = (
    "pelvis",
    *(f"{side}_{part}" for side in _SIDES for part in _LEG),
    *_TRUNK,
    *(f"{side}_{part}" for side in _SIDES for part in _ARM),
)
"""A limb after the other, by SMPL-H's names."""


def holds_states(path: Path) -> bool:
    """Whether a file of `torch.save` is such a tensor."""
    try:
        return _is_states(read_tensors(path))
    except FileFormatError:
        return False


def read_states(path: Path) -> Float[np.ndarray, "T 52 3"]:
    """Where the joints are [m], in the order of SMPL-H. Raises `FileFormatError` where the file
    holds something else."""
    states = read_tensors(path)
    if not _is_states(states):
        raise FileFormatError(path, None, f"has no states; expected a tensor of frames x {_WIDTH}")
    numbers = states.array()[:, _FIRST : _FIRST + 3 * len(_JOINTS)]
    order = [_JOINTS.index(name) for name in joints_of(len(_JOINTS))[0]]
    positions: Float[np.ndarray, "T 52 3"] = numbers.reshape(-1, len(_JOINTS), 3)[:, order]
    return positions.astype(np.float64)


def _is_states(found: object) -> bool:
    return isinstance(found, Tensor) and len(found.shape) == 2 and found.shape[1] == _WIDTH
