"""HumanML3D's features, 263 numbers a frame, as positions of its 22 joints.

Guo et al., "Generating Diverse and Natural 3D Human Motions from Text" (2022), `motion_process.py`:
of the root how fast it turns about Y (half angles, a frame), its velocity on the floor and its
height; then the joints' places, as seen from the root. Rotations, velocities and contacts follow,
which say the same again.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.rotation import quat_conj, quat_rotate

WIDTH, FPS = 263, 20.0
_JOINTS = 22
_HEIGHTS = (0.02, 3.0)  # [m] of hips, nine tenths of the time; normalised ones are about zero


def positions_of_features(
    features: Float[np.ndarray, "T 263"], path: Path
) -> Float[np.ndarray, "T 22 3"]:
    """Where the joints are [m], Y up. Raises `FileFormatError` where features are normalised."""
    height = float(np.percentile(features[:, 3], 10))
    if not _HEIGHTS[0] < height < _HEIGHTS[1]:
        raise FileFormatError(
            path,
            None,
            f"holds 263 numbers a frame, as HumanML3D's features, but hips {height:.2g} m high: "
            "they seem normalised; undo it with the model's own Mean.npy and Std.npy "
            "(features * Std + Mean)",
        )
    half = np.concatenate([[0.0], np.cumsum(features[:-1, 0])])
    facing = np.zeros((len(features), 4))
    facing[:, 0], facing[:, 2] = np.cos(half), np.sin(half)
    back = quat_conj(facing)
    step = np.zeros((len(features), 3))
    step[1:, [0, 2]] = features[:-1, 1:3]
    root = np.cumsum(quat_rotate(back, step), axis=0)
    root[:, 1] = features[:, 3]
    seen = features[:, 4 : 4 + 3 * (_JOINTS - 1)].reshape(-1, _JOINTS - 1, 3)
    joints = quat_rotate(back[:, None], seen)
    joints[..., [0, 2]] += root[:, None, [0, 2]]
    return np.concatenate([root[:, None], joints], axis=1)
