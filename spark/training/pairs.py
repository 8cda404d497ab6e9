"""Training pairs with exact answers: one motion on two skeletons, made while training runs.

A clip is kept on its own skeleton in canonical form. For a batch, windows of it are put onto two
variants of that skeleton, random ones or itself; on both, the feet are planted again while the
recording's stand, and as high. The network gets the first, its analytic transfer to the second, and
must find the second.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.errors import SkeletonError
from spark.network.features import BodyFeatures
from spark.network.windows import Windows
from spark.rotation import (
    quat_angle,
    quat_from_yaw,
    quat_rotate,
    quat_slerp,
    sixd_from_quat,
    yaw_from_quat,
)
from spark.training.mirror import mirrored_body, mirrored_motion
from spark.training.sizes import Sizes, sizes_of_variants
from spark.training.staging import (
    StagedBody,
    foot_lift,
    in_concatenation,
    interpolated_rows,
    local_rows,
    pose_bodies,
    starts_of,
)
from spark.training.variants import random_variant, same_body, split_body
from spark.transfer.analytic import Correspondence, correspond

_MAX_LOG_SPEED = 0.3  # a clip is played slower or faster by up to exp(0.3) = 1.35
# A body is drawn in proportion to this power of how much it turns in all: ten times the motion
# counts 1.6 times as often.
_DRAW_EXPONENT = 0.2
_MAX_TRIES = 10  # draws of a source before one with nothing unmatched is taken after all


@dataclass(frozen=True, eq=False)
class TrainingClip:
    """A recording in canonical form on the network's view of its own body, at 30 fps.

    `rotations` are world rotations since the T-pose, `hips` the hips' path over the floor in hip
    heights, `planted` whether the left and the right foot stand.
    """

    name: str
    body: BodyFeatures
    rotations: Float[np.ndarray, "T K 4"]
    hips: Float[np.ndarray, "T 3"]
    planted: Bool[np.ndarray, "T 2"]
    frame_time: float

    @cached_property
    def lift(self) -> Float[np.ndarray, "T 2 2"]:
        """How much higher ankle and toe of each foot are than in the T-pose [hip heights]."""
        rotations, hips = (np.asarray(x, np.float64) for x in (self.rotations, self.hips))
        return foot_lift(self.body, rotations, hips).astype(np.float32)


class Pairs(NamedTuple):
    """W windows on two bodies; `start` is the analytic transfer of `source` to the target, and
    `unmatched` its `Correspondence.unmatched`."""

    source: Windows
    target: Windows
    start: Windows
    unmatched: Int[np.ndarray, "J"]
    planted: Bool[np.ndarray, "W T 2"]
    frame_time: float


class PairMaker:
    """Draws pairs from clips. Draw `n` of a seed is always the same, whatever was drawn before.

    Making a skeleton costs as much as using it many times, so each body has a fixed set of
    `variants`, made when they are first met: itself, itself with joints split as in SAN, and random
    ones. With `varied`, the target is the body itself under its own names, as real targets are;
    half of the draws are seen in a mirror, half are slowed down or sped up by up to a third, and
    sources are drawn again where the analytic transfer matches every joint: there is nothing to
    learn there.

    Bodies are drawn by how much they turn, but the more of one there is the less each counts: what
    is to be learned differs between people more than within one.
    """

    def __init__(
        self,
        clips: Sequence[TrainingClip],
        *,
        window: int = 64,
        variants: int = 256,
        seed: int = 0,
        varied: bool = False,
    ) -> None:
        self.window, self.variants, self.seed = window, variants, seed
        self.varied = varied
        by_body: dict[int, list[TrainingClip]] = {}
        for clip in clips:
            if len(clip.hips) >= window:
                by_body.setdefault(id(clip.body), []).append(clip)
        self._bodies = list(by_body.values())
        if not self._bodies:
            raise SkeletonError(f"no clip has {window} frames: expected at least one to train on")
        weights = (
            np.array([sum(map(_total_rotation, group)) for group in self._bodies]) ** _DRAW_EXPONENT
        )
        self._weights = weights / weights.sum()
        self._seen: dict[tuple[int, bool], BodyFeatures] = {}
        self._staged_bodies: dict[tuple[int, bool, int], StagedBody] = {}
        self._links: dict[tuple[StagedBody, StagedBody], Correspondence] = {}

    @property
    def sizes(self) -> Sizes:
        """What holds every draw."""
        return sizes_of_variants([group[0].body for group in self._bodies])

    def draw(self, n: int, windows: int) -> Pairs:
        """Draw number `n`: `windows` windows of one body's clips on one pair of its variants."""
        return self.draws([n], windows)[0]

    def draws(self, numbers: Sequence[int], windows: int) -> list[Pairs]:
        """The draws of these numbers, made together, which is faster."""
        drawn = [self._sample(n, windows) for n in numbers]
        D = len(drawn)
        staged = [one.source for one in drawn] + [one.target for one in drawn]
        bodies = [body.variant.body for body in staged]
        links = [one.link for one in drawn]
        hips = np.stack([one.hips for one in drawn])
        planted = np.stack([one.planted for one in drawn])
        lift = np.stack([one.lift for one in drawn])
        rows = pose_bodies(
            staged,
            2 * starts_of([one.rotations for one in drawn]),
            np.concatenate([one.rotations for one in drawn]),
            np.concatenate([hips, hips]),
            np.concatenate([planted, planted]),
            np.concatenate([lift, lift]),
        )
        starts = starts_of([body.joints for body in bodies])
        copied = interpolated_rows(
            rows,
            in_concatenation([link.first for link in links], starts[:D]),
            in_concatenation([link.second for link in links], starts[:D]),
            np.concatenate([link.mix for link in links]),
        )
        # Windows are seen from their first frames, as `spark.network.features.pose_features` sees
        # one. The pelvis turns alike on all bodies.
        from_heading = quat_from_yaw(-yaw_from_quat(rows[starts[:D], :, :1]))
        roots = quat_rotate(from_heading, hips - hips[:, :, :1] * np.array([1, 1, 0], hips.dtype))
        bodies += bodies[D:]
        local = local_rows(
            np.concatenate([rows, copied]), bodies, np.tile(from_heading, (3, 1, 1, 1))
        )
        poses = np.moveaxis(sixd_from_quat(local), 0, 2)
        ends = starts_of([body.joints for body in bodies])[1:]
        seen = [
            Windows(body, own, roots[k % D])
            for k, (body, own) in enumerate(zip(bodies, np.split(poses, ends, 2), strict=True))
        ]
        return [
            Pairs(
                seen[k],
                seen[D + k],
                seen[2 * D + k],
                links[k].unmatched,
                planted[k],
                one.frame_time,
            )
            for k, one in enumerate(drawn)
        ]

    def _sample(self, n: int, windows: int) -> "_Draw":
        rng = np.random.default_rng((self.seed, n))
        k = int(rng.choice(len(self._bodies), p=self._weights))
        clips = self._bodies[k]
        mirrored = self.varied and bool(rng.random() < 0.5)
        for _ in range(_MAX_TRIES if self.varied else 1):
            performer, receiver = rng.integers(self.variants, size=2).tolist()
            if self.varied:
                receiver = 0
            source, target = (
                self._staged_body(k, mirrored, number) for number in (performer, receiver)
            )
            link = self._link(source, target)
            if (link.unmatched >= 0).any():
                break
        rotations, hips, planted, lift = self._windows(clips, windows, rng)
        if mirrored:
            rotations, hips, planted = mirrored_motion(rotations, hips, planted)
            lift = lift[:, :, ::-1]
        rows = np.ascontiguousarray(np.moveaxis(rotations, 2, 0))
        return _Draw(source, target, link, rows, hips, planted, lift, clips[0].frame_time)

    def _windows(
        self, clips: list[TrainingClip], windows: int, rng: np.random.Generator
    ) -> tuple[
        Float[np.ndarray, "W T K 4"],
        Float[np.ndarray, "W T 3"],
        Bool[np.ndarray, "W T 2"],
        Float[np.ndarray, "W T 2 2"],
    ]:
        lengths = np.array([len(c.hips) for c in clips], float)
        chosen = [clips[i] for i in rng.choice(len(clips), windows, p=lengths / lengths.sum())]
        spans, speeds = [], np.ones((windows, 1))
        for w, clip in enumerate(chosen):
            speed = float(np.exp(rng.uniform(-_MAX_LOG_SPEED, _MAX_LOG_SPEED)))
            frames = int(np.ceil((self.window - 1) * speed)) + 1
            if not self.varied or rng.random() < 0.5 or frames > len(clip.hips):
                frames, speed = self.window, 1.0
            at, speeds[w] = int(rng.integers(0, len(clip.hips) - frames + 1)), speed
            spans.append(slice(at, at + frames))
        times = np.arange(self.window) * speeds
        last = np.array([[span.stop - span.start - 1] for span in spans])
        before, nearest = times.astype(int), np.minimum(times.round().astype(int), last)
        rotations = _gather([clip.rotations for clip in chosen], spans, before)
        hips = _gather([clip.hips for clip in chosen], spans, before)
        planted = _gather([clip.planted for clip in chosen], spans, nearest)
        lift = _gather([clip.lift for clip in chosen], spans, nearest)
        other_speed = np.flatnonzero(speeds != 1)
        if len(other_speed):
            share = (times - before)[other_speed, :, None].astype(np.float32)
            after = np.minimum(before + 1, last)[other_speed]
            chosen, spans = [chosen[w] for w in other_speed], [spans[w] for w in other_speed]
            later = _gather([clip.rotations for clip in chosen], spans, after)
            rotations[other_speed] = quat_slerp(rotations[other_speed], later, share)
            later = _gather([clip.hips for clip in chosen], spans, after)
            hips[other_speed] += share * (later - hips[other_speed])
        return rotations, hips, planted, lift

    def _body(self, k: int, mirrored: bool) -> BodyFeatures:
        if (k, mirrored) not in self._seen:
            body = self._bodies[k][0].body
            self._seen[k, mirrored] = mirrored_body(same_body(body).body) if mirrored else body
        return self._seen[k, mirrored]

    def _staged_body(self, k: int, mirrored: bool, number: int) -> StagedBody:
        key = (k, mirrored, number)
        if key not in self._staged_bodies:
            body = self._body(k, mirrored)
            if number < 2:
                variant = (same_body, split_body)[number](body)
            else:
                variant = random_variant(body, np.random.default_rng((self.seed, *key)))
            self._staged_bodies[key] = StagedBody(variant)
        return self._staged_bodies[key]

    def _link(self, source: StagedBody, target: StagedBody) -> Correspondence:
        key = (source, target)
        if key not in self._links:
            if len(self._links) > 4096:
                self._links.clear()
            self._links[key] = correspond(source.variant.body.rig, target.variant.body.rig)
        return self._links[key]


class _Draw(NamedTuple):
    """What a draw consists of before it is put on its two bodies."""

    source: StagedBody
    target: StagedBody
    link: Correspondence
    rotations: Float[np.ndarray, "K W T 4"]
    hips: Float[np.ndarray, "W T 3"]
    planted: Bool[np.ndarray, "W T 2"]
    lift: Float[np.ndarray, "W T 2 2"]
    frame_time: float


def _gather(
    parts: Sequence[np.ndarray], spans: Sequence[slice], frames: Int[np.ndarray, "W T"]
) -> np.ndarray:
    """From a span of each part, these of its frames; in single precision what is not a flag."""
    # A view of a memory-mapped array costs more than what is read through it.
    cut = np.stack(
        [np.asarray(p)[span][at] for p, span, at in zip(parts, spans, frames, strict=True)]
    )
    return cut if cut.dtype == bool else cut.astype(np.float32, copy=False)


def _total_rotation(clip: TrainingClip) -> float:
    """How much the joints turn in all [rad], with a little for a clip that stands still."""
    rotations = np.asarray(clip.rotations)
    step = quat_angle(rotations[:-1], rotations[1:]).mean() if len(rotations) > 1 else 0.0
    return float(len(rotations) * (step + 1e-3))
