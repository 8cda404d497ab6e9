"""Files of the SMPL family that are one array, a row a frame: Motion-X and PHUMA."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.arrays import numbers
from spark.io.smpl_motion import SmplMotion

WIDTHS = (69, 73, 165, 322)
"""Numbers a frame in the layouts that are one array."""


def from_array(array: np.ndarray, path: Path) -> SmplMotion:
    """The motion in one array (T, 322) or (T, 165) of Motion-X, or (T, 69) or (T, 73) of PHUMA."""
    values = numbers({"it": array}, "it", path)
    if values.ndim != 2 or not len(values) or values.shape[1] not in WIDTHS:
        raise FileFormatError(
            path,
            None,
            f"is {' x '.join(map(str, array.shape)) or 'one number'}; expected frames x 69 or 73 "
            "(PHUMA), x 165 or 322 (Motion-X)",
        )
    width = values.shape[1]
    if width in (69, 73):
        body = values[:, 3:69].reshape(-1, 22, 3)
        note = () if width == 69 else ("its foot contacts are not read",)
        return SmplMotion(body, values[:, :3], "PHUMA", "y", smplx=True, notes=note)
    if width == 165:
        rotvecs = values.reshape(-1, 55, 3)
        notes = ("165 numbers a frame are SMPL-X's rotations; it has no positions",)
        jaw, last = rotvecs[:, 22], rotvecs[:, 52]
        if _turns(rotvecs[:, 53:]) == 0 and not _is_jaw(jaw) and _is_jaw(last):
            # As in Motion-X's 322: hands before the jaw, and none of the eyes.
            rotvecs = rotvecs[:, [*range(22), 52, 53, 54, *range(22, 52)]]
            notes = ("165 numbers a frame: Motion-X's rotations, hands before the jaw",)
        return SmplMotion(rotvecs, None, "Motion-X", "y", notes=notes)
    rotvecs = np.zeros((len(values), 55, 3))
    rotvecs[:, :22] = values[:, :66].reshape(-1, 22, 3)
    rotvecs[:, 25:] = values[:, 66:156].reshape(-1, 30, 3)
    rotvecs[:, 22] = values[:, 156:159]
    betas = np.median(values[:, 312:], axis=0)
    notes = ("the face's expression and shape are not read",)
    return SmplMotion(rotvecs, values[:, 309:312], "Motion-X", "y", betas=betas, notes=notes)


def _turns(rotvecs: Float[np.ndarray, "T *n 3"]) -> float:
    return float(np.abs(rotvecs).max(initial=0.0))


def _is_jaw(rotvecs: Float[np.ndarray, "T 3"]) -> bool:
    """Whether the rotations open and shut a mouth: about x alone, up to 45 degrees."""
    most = np.abs(rotvecs).max(axis=0)
    return bool(most[0] < np.pi / 4 and most[1:].max() <= 0.5 * most[0] and most[0] > 0)
