"""Retargeting with a trained network: motions of any length, by windows that overlap and blend.

The network reads 30 frames a second and its own window's length. A window says how the motion
differs from the analytic transfer; where two overlap their answers are blended, the weights rising
and falling linearly. The windows lie on a fixed grid, so how many are worked on at a time changes
nothing. What was found at 30 fps is carried to the motion's own frame rate.
"""

from dataclasses import replace

import numpy as np
import torch

from spark.batch import Collator
from spark.bodies import Pose
from spark.canonical import CanonicalMotion
from spark.checkpoint import Checkpoint
from spark.clips import FRAME_TIME, at_frame_time, positions_at, rotations_at
from spark.features import body_features, canonical_from_features, pose_features
from spark.rig import Rig
from spark.rotation import quat_conj, quat_mul, quat_normalize
from spark.train import name_vectors
from spark.transfer import transfer

_AT_A_TIME = 32


def retarget(
    source: CanonicalMotion, target: Rig, checkpoint: Checkpoint, *, window: int | None = None
) -> CanonicalMotion:
    """`source`'s motion on `target` by the network of `checkpoint`; any length, 1 frame too.

    `window` [frames at 30 fps] is the training's where it is not given.
    """
    window = window or int(checkpoint.settings.get("window", 64))
    start = transfer(source, target)
    slow_source, slow_start = (at_frame_time(c, FRAME_TIME) for c in (source, start))
    slow = _blended(slow_source, slow_start, checkpoint, window)
    if slow_start is start:
        return slow
    turned = quat_mul(slow.rotations, quat_conj(slow_start.rotations))
    at = np.arange(len(start)) * start.frame_time / FRAME_TIME
    return replace(
        start,
        rotations=quat_mul(rotations_at(turned, at), start.rotations),
        hips=start.hips + positions_at(slow.hips - slow_start.hips, at),
    )


def _blended(
    source: CanonicalMotion, start: CanonicalMotion, checkpoint: Checkpoint, window: int
) -> CanonicalMotion:
    """The windows' answers laid over one another; quaternions are averaged as vectors."""
    count, size = len(start), min(window, len(start))
    hop = max(size // 2, 1)
    firsts = sorted({*range(0, count - size + 1, hop), count - size})
    rise = np.minimum(np.arange(size) + 1, np.arange(size)[::-1] + 1).astype(np.float64)
    rotations, hips = np.zeros_like(start.rotations), np.zeros_like(start.hips)
    total = np.zeros(count)
    for k in range(0, len(firsts), _AT_A_TIME):
        spans = [slice(at, at + size) for at in firsts[k : k + _AT_A_TIME]]
        answers = _answers(
            [_cut(source, s) for s in spans], [_cut(start, s) for s in spans], checkpoint
        )
        for span, answer in zip(spans, answers, strict=True):
            same = np.sign((answer.rotations * start.rotations[span]).sum(-1, keepdims=True))
            rotations[span] += rise[:, None, None] * np.where(same < 0, -1, 1) * answer.rotations
            hips[span] += rise[:, None] * answer.hips
            total[span] += rise
    return replace(start, rotations=quat_normalize(rotations), hips=hips / total[:, None])


@torch.no_grad()
def _answers(
    sources: list[CanonicalMotion], starts: list[CanonicalMotion], checkpoint: Checkpoint
) -> list[CanonicalMotion]:
    """What the network makes of windows of one length."""
    model = checkpoint.model.eval()
    device = next(model.parameters()).device
    source_body, target_body = body_features(sources[0].rig), body_features(starts[0].rig)
    read = [pose_features(window, source_body) for window in sources]
    copied = [pose_features(window, target_body) for window in starts]
    collator = Collator(name_vectors(checkpoint.names))
    bodies = [collator.bodies([body], [len(sources)]) for body in (source_body, target_body)]
    poses = [
        Pose(
            *(
                torch.as_tensor(
                    np.stack([np.asarray(w[i]) for w in windows]), dtype=torch.float32
                ).to(device)
                for i in (0, 1)
            )
        )
        for windows in (read, copied)
    ]
    source, target = (type(body)(*(t.to(device) for t in body)) for body in bodies)
    torch.manual_seed(0)  # the paper's decoder starts from noise: the same for the same motion
    out = model(poses[0], source, target, poses[1])
    sixd, root = (t.double().cpu().numpy() for t in out)
    return [
        canonical_from_features(sixd[w], root[w], copied[w][2], target_body, starts[w])
        for w in range(len(starts))
    ]


def _cut(canonical: CanonicalMotion, span: slice) -> CanonicalMotion:
    return replace(canonical, rotations=canonical.rotations[span], hips=canonical.hips[span])
