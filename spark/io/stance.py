"""What standing feet tell of a body: they stay where they are while it moves over them."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.kinematics import forward
from spark.motion import Motion

# [m/s] Ball and ankle of a foot that stands flat are slower; a swinging one moves at 1 to 4 m/s,
# and the ankle of one that rolls over its toes at 0.3.
_BALL_STANDS, _ANKLE_STANDS = 0.25, 0.15
_MOVES = 0.25  # [m/s] of a foot against the hips; slower ones say little of lengths
_ENOUGH = 1.0  # [s] of standing feet under moving hips: a few steps
_SCALES = (0.85, 1.15)  # beyond, people are rare, and slides that look like steps are not
_ROUNDS = 10


def stance_scale(
    balls: Float[np.ndarray, "T F 2"],
    ankles: Float[np.ndarray, "T F 2"],
    hips: Float[np.ndarray, "T 2"],
    frame_time: float,
) -> float | None:
    """By how much a body must be larger for its standing feet to stand still.

    `balls` and `ankles` are level positions [m] relative to the hips, whose own path is `hips`.
    Where a foot stands, hips + scale * ball does not move: least squares over those frames, which
    are found anew with each scale. None where the motion has too few.
    """
    if len(hips) < 3:
        return None
    ball_v, ankle_v = np.diff(balls, axis=0) / frame_time, np.diff(ankles, axis=0) / frame_time
    hips_v = np.repeat(np.diff(hips, axis=0)[:, None] / frame_time, balls.shape[1], axis=1)
    moves = np.linalg.norm(ball_v, axis=-1) > _MOVES
    scale = 1.0
    for _ in range(_ROUNDS):
        stands = moves & (np.linalg.norm(hips_v + scale * ball_v, axis=-1) < _BALL_STANDS)
        stands &= np.linalg.norm(hips_v + scale * ankle_v, axis=-1) < _ANKLE_STANDS
        if stands.sum() * frame_time < _ENOUGH:
            return None
        own, path = ball_v[stands], hips_v[stands]
        scale = float(-(own * path).sum() / (own**2).sum())
        if not _SCALES[0] < scale < _SCALES[1]:
            return None
    return scale


def walked(motion: Motion, feet: list[int], up: int) -> Motion:
    """The motion with its hips moved so that the lowest of `feet` stands where it is, on a floor at
    zero along axis `up`. Steps come out; flights do not."""
    still = replace(motion, root_pos=np.zeros_like(motion.root_pos))
    positions = forward(still)[0][:, feet]
    lowest = np.argmin(positions[..., up], axis=1)
    frames = np.arange(1, len(motion))
    moved = positions[frames, lowest[1:]] - positions[frames - 1, lowest[1:]]
    root_pos = np.concatenate([np.zeros((1, 3)), -np.cumsum(moved, axis=0)])
    root_pos[:, up] = -positions[np.arange(len(motion)), lowest, up]
    placed = motion.translations
    if placed is not None:
        placed = placed.copy()
        placed[:, 0] = root_pos
    return replace(motion, root_pos=root_pos, translations=placed)
