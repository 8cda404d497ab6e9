"""Retargeting with a trained network: motions of any length, by windows that overlap and blend.

The network reads windows of the length that it was trained on, at 30 frames a second. Its output
for a window is a correction of the analytic transfer; where windows overlap their outputs are
blended, with weights that rise and fall linearly. The windows lie on a fixed grid, so that the
result does not depend on how many are run at once. The correction is then resampled to the motion's
frame rate.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from jaxtyping import Float, Int

from spark.blocks import in_blocks
from spark.errors import DependencyError, name_list
from spark.inference.names import NameNetwork
from spark.inference.weights import Weights
from spark.network.features import (
    BodyFeatures,
    body_features,
    canonical_from_features,
    pose_features,
)
from spark.network.forward import Network
from spark.network.known_bodies import similarity
from spark.network.recorded import as_recorded, tokens_of
from spark.network.recorded_weights import PREFIX, RecordedWeights
from spark.network.windows import Windows
from spark.resample import rotations_at, values_at
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_mul, quat_normalize
from spark.transfer.analytic import correspond, transfer
from spark.transfer.canonical import FRAME_TIME, CanonicalMotion, at_frame_time
from spark.transfer.own_soles import fit_body, on_own_soles

_WINDOWS_AT_ONCE = 32  # bounds memory


class NetworkRetargeter:
    """Retargets by a trained network, run on numpy or as `network` does. Raises `FileFormatError`
    where its checkpoint is damaged."""

    def __init__(self, weights: Weights, network: type[Network] = Network) -> None:
        try:
            self.network = network(weights)
            self._encode = _name_encoder(weights)
            self.window = int(weights.settings.get("window", 64))
            self.bodies = weights.bodies
            self.recorded = RecordedWeights(weights) if weights.below(PREFIX) else None
        except (KeyError, TypeError, ValueError) as error:
            raise weights.damaged(error) from error

    def __call__(self, source: CanonicalMotion, target: Rig) -> CanonicalMotion:
        """`source`'s motion on `target`; any length, 1 frame too.

        A residual network corrects the joints that the analytic transfer leaves unmatched, the less
        the less the target resembles the bodies that it was trained on (`similarity`); a body
        unlike all of them is left as it is.
        """
        start = transfer(source, target)
        bodies = body_features(source.rig), body_features(target)
        unmatched = unmatched_joints(source.rig, bodies[1])
        strength = 1.0
        if self.network.config.residual:
            if not (unmatched >= 0).any():
                return start
            names = [
                target.skeleton.names[bodies[1].joints[j]]
                for j in np.unique(unmatched[unmatched >= 0])
            ]
            strength = similarity(bodies[1], self.bodies)
            who = "the network fills them in" if strength else "interpolated, or following"
            note = f"no counterpart in the source: {name_list(names)}; {who}"
            start = replace(start, notes=(*start.notes, note))
            if not strength:
                return start
        source_30fps, start_30fps = (at_frame_time(c, FRAME_TIME) for c in (source, start))
        blended = self._blend_windows(source_30fps, start_30fps, bodies, unmatched, strength)
        if start_30fps is start:
            return blended
        correction = in_blocks(
            lambda block: quat_mul(
                blended.rotations[block], quat_conj(start_30fps.rotations[block])
            ),
            len(blended),
        )
        at = np.arange(len(start)) * start.frame_time / FRAME_TIME
        return replace(
            start,
            rotations=in_blocks(
                lambda block: quat_mul(rotations_at(correction, at[block]), start.rotations[block]),
                len(start),
            ),
            hips=start.hips + values_at(blended.hips - start_30fps.hips, at),
        )

    def fit_legs(
        self,
        source: CanonicalMotion,
        moved: CanonicalMotion,
        recording: CanonicalMotion | None = None,
    ) -> CanonicalMotion:
        """`moved`, the transfer of `source`, with its legs fitted by the two bodies' proportions,
        and where the network learned from recorded pairs, and met bodies like these two, as these
        have it (`spark.network.recorded`); on its own soles (`spark.transfer.own_soles`:
        `recording` is a motion of the target's own)."""
        if self.recorded is None:
            return fit_body(source, moved, recording)
        bodies = tokens_of(source.rig), tokens_of(moved.rig)
        known = self.recorded.known
        share = known.nearness(bodies[0]) * known.nearness(bodies[1])
        moved = replace(moved, notes=(*moved.notes, known.told(*bodies)))
        if not share:
            return fit_body(source, moved, recording)
        told = self.recorded.told
        doubt = told.doubt(*bodies)
        fitted = as_recorded(told, source, moved, share, bodies=bodies, doubt=doubt)
        return on_own_soles(source, fitted, recording)

    def _blend_windows(
        self,
        source: CanonicalMotion,
        start: CanonicalMotion,
        bodies: tuple[BodyFeatures, BodyFeatures],
        unmatched: Int[np.ndarray, "J"],
        strength: float,
    ) -> CanonicalMotion:
        """The windows' outputs, blended; quaternions are averaged as vectors."""
        count, size = len(start), min(self.window, len(start))
        hop = max(3 * size // 4, 1)
        starts = sorted({*range(0, count - size + 1, hop), count - size})
        weight = np.minimum(np.arange(size) + 1, np.arange(size)[::-1] + 1).astype(np.float64)
        rotations, hips = np.zeros_like(start.rotations), np.zeros_like(start.hips)
        total = np.zeros(count)
        for k in range(0, len(starts), _WINDOWS_AT_ONCE):
            spans = [slice(at, at + size) for at in starts[k : k + _WINDOWS_AT_ONCE]]
            sources = [source.frames(span.start, span.stop) for span in spans]
            copies = [start.frames(span.start, span.stop) for span in spans]
            outputs = self._run(sources, copies, bodies, unmatched, strength)
            for span, output in zip(spans, outputs, strict=True):
                same = np.sign((output.rotations * start.rotations[span]).sum(-1, keepdims=True))
                rotations[span] += (
                    weight[:, None, None] * np.where(same < 0, -1, 1) * output.rotations
                )
                hips[span] += weight[:, None] * output.hips
                total[span] += weight
        return replace(start, rotations=quat_normalize(rotations), hips=hips / total[:, None])

    def _run(
        self,
        sources: list[CanonicalMotion],
        starts: list[CanonicalMotion],
        bodies: tuple[BodyFeatures, BodyFeatures],
        unmatched: Int[np.ndarray, "J"],
        strength: float,
    ) -> list[CanonicalMotion]:
        """The network's output for windows of one length."""
        source_body, target_body = bodies
        source_features = [pose_features(window, source_body) for window in sources]
        start_features = [pose_features(window, target_body) for window in starts]
        source_names, target_names = (
            np.concatenate([self._encode(body.skeleton.names), body.sides], -1) for body in bodies
        )
        latent = self.network.encode(_windows(source_body, source_features), source_names)
        if self.network.config.residual:
            out = self.network.correct(
                latent, target_names, _windows(target_body, start_features), unmatched, strength
            )
        else:
            out = self.network.decode(latent, target_names, target_body)
        return [
            canonical_from_features(
                out.rotations[w], out.root[w], start_features[w][2], target_body, starts[w]
            )
            for w in range(len(starts))
        ]


def silence(network: NetworkRetargeter, source: Rig, target: Rig) -> str:
    """Why `network` leaves the analytic transfer between these rigs as it is; empty where it
    doesn't."""
    if not network.network.config.residual:
        return ""
    body = body_features(target)
    if not (unmatched_joints(source, body) >= 0).any():
        return "every joint of the target has a counterpart in the source"
    if not similarity(body, network.bodies):
        return "the target is unlike all bodies of the training"
    return ""


def unmatched_joints(source: Rig, target: BodyFeatures) -> Int[np.ndarray, "J"]:
    """`Correspondence.unmatched` in the network's numbering of the target's joints."""
    index = {int(j): k for k, j in enumerate(target.joints)}
    found = correspond(source, target.rig).unmatched[target.joints]
    return np.array([index.get(int(j), -1) for j in found])


def _name_encoder(weights: Weights) -> Callable[[Sequence[str]], Float[np.ndarray, "_ E"]]:
    """A function from a rig's names to vectors, which remembers rigs."""
    encode: Callable[[tuple[str, ...]], Float[np.ndarray, "_ E"]]
    if "t5" in weights.names:
        try:
            from spark.network.t5 import NAME_CACHE, T5Names
        except ImportError as error:
            raise DependencyError(
                f"a network with T5's names needs {error.name}: pip install 'spark-sim[t5]'"
            ) from error
        t5 = T5Names(str(weights.names["t5"]), NAME_CACHE, own=False)
        encode = cache(lambda names: t5.encode(names).numpy())
    else:
        encode = cache(NameNetwork(weights).encode)
    return lambda names: encode(tuple(names))


def _windows(
    body: BodyFeatures, features: Sequence[tuple[np.ndarray, np.ndarray, object]]
) -> Windows:
    return Windows(body, np.stack([f[0] for f in features]), np.stack([f[1] for f in features]))
