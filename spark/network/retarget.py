"""Retargeting with a trained network: motions of any length, by windows that overlap and blend.

The network reads 30 frames a second and its own window's length. A window says how the motion
differs from the analytic transfer; where two overlap their answers are blended, the weights rising
and falling linearly. The windows lie on a fixed grid, so how many are worked on at a time changes
nothing. What was found at 30 fps is carried to the motion's own frame rate.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from jaxtyping import Float, Int

from spark.errors import DependencyError, name_list
from spark.network.features import (
    BodyFeatures,
    body_features,
    canonical_from_features,
    pose_features,
)
from spark.network.forward import Network
from spark.network.known_bodies import nearness
from spark.network.names import NameNetwork
from spark.network.weights import Weights
from spark.network.windows import Windows
from spark.resample import rotations_at, values_at
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_mul, quat_normalize
from spark.transfer.analytic import correspond, transfer
from spark.transfer.canonical import FRAME_TIME, CanonicalMotion, at_frame_time

_AT_A_TIME = 32


class NetworkRetargeter:
    """The network of a checkpoint, ready to run. Raises `FileFormatError` where it is damaged."""

    def __init__(self, weights: Weights) -> None:
        try:
            self.network = Network(weights)
            self._encode = _names_of(weights)
            self.window = int(weights.settings.get("window", 64))
            self.bodies = weights.bodies
        except (KeyError, TypeError, ValueError) as error:
            raise weights.damaged(error) from error

    def __call__(
        self, source: CanonicalMotion, target: Rig, *, window: int | None = None
    ) -> CanonicalMotion:
        """`source`'s motion on `target`; any length, 1 frame too.

        `window` [frames at 30 fps] is the training's where it is not given. Where the transfer has
        nothing to guess, or the network has met no body like the target, what corrects guesses
        leaves them as they are; less is corrected the less they are alike.
        """
        start = transfer(source, target)
        bodies = body_features(source.rig), body_features(target)
        unmatched = unmatched_joints(source.rig, bodies[1])
        share = 1.0
        if self.network.config.residual:
            if not (unmatched >= 0).any():
                return start
            names = [
                target.skeleton.names[bodies[1].joints[j]]
                for j in np.unique(unmatched[unmatched >= 0])
            ]
            share = nearness(bodies[1], self.bodies)
            who = "the network fills them in" if share else "interpolated, or following"
            note = f"no counterpart in the source: {name_list(names)}; {who}"
            start = replace(start, notes=(*start.notes, note))
            if not share:
                return start
        slow_source, slow_start = (at_frame_time(c, FRAME_TIME) for c in (source, start))
        slow = self._blended(
            slow_source, slow_start, bodies, unmatched, share, window or self.window
        )
        if slow_start is start:
            return slow
        turned = quat_mul(slow.rotations, quat_conj(slow_start.rotations))
        at = np.arange(len(start)) * start.frame_time / FRAME_TIME
        return replace(
            start,
            rotations=quat_mul(rotations_at(turned, at), start.rotations),
            hips=start.hips + values_at(slow.hips - slow_start.hips, at),
        )

    def _blended(
        self,
        source: CanonicalMotion,
        start: CanonicalMotion,
        bodies: tuple[BodyFeatures, BodyFeatures],
        unmatched: Int[np.ndarray, "J"],
        share: float,
        window: int,
    ) -> CanonicalMotion:
        """The windows' answers laid over one another; quaternions are averaged as vectors."""
        count, size = len(start), min(window, len(start))
        hop = max(3 * size // 4, 1)
        firsts = sorted({*range(0, count - size + 1, hop), count - size})
        rise = np.minimum(np.arange(size) + 1, np.arange(size)[::-1] + 1).astype(np.float64)
        rotations, hips = np.zeros_like(start.rotations), np.zeros_like(start.hips)
        total = np.zeros(count)
        for k in range(0, len(firsts), _AT_A_TIME):
            spans = [slice(at, at + size) for at in firsts[k : k + _AT_A_TIME]]
            given = [source.frames(span.start, span.stop) for span in spans]
            copied = [start.frames(span.start, span.stop) for span in spans]
            answers = self._answers(given, copied, bodies, unmatched, share)
            for span, answer in zip(spans, answers, strict=True):
                same = np.sign((answer.rotations * start.rotations[span]).sum(-1, keepdims=True))
                rotations[span] += (
                    rise[:, None, None] * np.where(same < 0, -1, 1) * answer.rotations
                )
                hips[span] += rise[:, None] * answer.hips
                total[span] += rise
        return replace(start, rotations=quat_normalize(rotations), hips=hips / total[:, None])

    def _answers(
        self,
        sources: list[CanonicalMotion],
        starts: list[CanonicalMotion],
        bodies: tuple[BodyFeatures, BodyFeatures],
        unmatched: Int[np.ndarray, "J"],
        share: float,
    ) -> list[CanonicalMotion]:
        """What the network makes of windows of one length."""
        given, asked = bodies
        read = [pose_features(window, given) for window in sources]
        copied = [pose_features(window, asked) for window in starts]
        known, wanted = (
            np.concatenate([self._encode(body.skeleton.names), body.sides], -1) for body in bodies
        )
        latent = self.network.encode(_windows(given, read), known)
        if self.network.config.residual:
            out = self.network.correct(latent, wanted, _windows(asked, copied), unmatched, share)
        else:
            out = self.network.decode(latent, wanted, asked)
        return [
            canonical_from_features(out.rotations[w], out.root[w], copied[w][2], asked, starts[w])
            for w in range(len(starts))
        ]


def unmatched_joints(source: Rig, target: BodyFeatures) -> Int[np.ndarray, "J"]:
    """`Correspondence.unmatched` in the network's numbering of the target's joints."""
    place = {int(j): k for k, j in enumerate(target.joints)}
    found = correspond(source, target.rig).unmatched[target.joints]
    return np.array([place.get(int(j), -1) for j in found])


def _names_of(weights: Weights) -> Callable[[Sequence[str]], Float[np.ndarray, "_ E"]]:
    """What turns a rig's names into vectors, each rig's once."""
    encode: Callable[[tuple[str, ...]], Float[np.ndarray, "_ E"]]
    if "t5" in weights.names:
        try:
            from spark.network.t5 import NAME_CACHE, T5Names
        except ImportError as error:
            raise DependencyError(
                f"a network with T5's names needs {error.name}: pip install 'spark-sim[t5]'"
            ) from error
        t5 = T5Names(str(weights.names["t5"]), NAME_CACHE)
        encode = cache(lambda names: t5.encode(names).numpy())
    else:
        encode = cache(NameNetwork(weights).encode)
    return lambda names: encode(tuple(names))


def _windows(body: BodyFeatures, read: Sequence[tuple[np.ndarray, np.ndarray, object]]) -> Windows:
    return Windows(body, np.stack([r[0] for r in read]), np.stack([r[1] for r in read]))
