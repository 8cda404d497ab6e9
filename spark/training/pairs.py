"""Training pairs with exact answers: one motion on two skeletons, made while training runs.

A clip is kept on its own skeleton in canonical form. For a batch, windows of it are put onto two
variants of that skeleton, random ones or itself; on both, the feet are planted again while the
recording's stand, and as high. The network gets the first, its analytic transfer to the second, and
must find the second.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, exp
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.errors import SkeletonError
from spark.network.features import BodyFeatures
from spark.rotation import quat_angle
from spark.training.cuts import Cut, TrainingClip, cut_rotations, frames_of, ground_of
from spark.training.mirror import mirrored_body, mirrored_motion
from spark.training.plan import Plan, plan_of_pair
from spark.training.posing import Drawn, seen_from_start, turn_between, turn_legs
from spark.training.sizes import Sizes, sizes_of_variants
from spark.training.staging import StagedBody, empty_rows, in_concatenation, leg_turns
from spark.training.variants import random_variant, same_body, split_body
from spark.transfer.analytic import Correspondence, correspond

_MAX_LOG_SPEED = 0.3  # a clip is played slower or faster by up to exp(0.3) = 1.35
# A body is drawn in proportion to this power of how much it turns in all: ten times the motion
# counts 1.6 times as often.
_DRAW_EXPONENT = 0.2
_MOST_PAIRS = 16_384  # of bodies that are kept, some 10 kB each
_MAX_TRIES = 10  # draws of a source before one with nothing unmatched is taken after all


class Pairs(NamedTuple):
    """W windows on two bodies; `start` is the analytic transfer of `source` to the target, and
    `unmatched` its `Correspondence.unmatched`."""

    source: Drawn
    target: Drawn
    start: Drawn
    unmatched: Int[np.ndarray, "J"]
    planted: Bool[np.ndarray, "W T 2"]
    frame_time: float


class PairMaker:
    """Draws pairs from clips. Draw `n` of a seed is always the same, whatever was drawn before.

    Making a skeleton costs as much as using it many times, so each body has a fixed set of
    `variants`, made when they are first met: itself, itself with joints split as in SAN, and random
    ones. These are sources; the target is the body itself under its own names, as real targets are.
    Half of the draws are seen in a mirror, half are slowed down or sped up by up to a third, and
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
    ) -> None:
        self.window, self.variants, self.seed = window, variants, seed
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
        self._chances = _chances(weights)
        self._chances_of_clips = [
            _chances(np.array([len(clip.hips) for clip in group], float)) for group in self._bodies
        ]
        self._seen: dict[tuple[int, bool], BodyFeatures] = {}
        self._staged_bodies: dict[tuple[int, bool, int], StagedBody] = {}
        self._pairs: dict[tuple[StagedBody, StagedBody], _BodyPair] = {}

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
        plans = [one.bodies.plan for one in drawn]
        *starts, total = np.cumsum([0, *(plan.rows for plan in plans)]).tolist()
        rows = empty_rows(total, windows, self.window)
        spans = [
            slice(start, start + plan.recorded) for plan, start in zip(plans, starts, strict=True)
        ]
        cuts = [cut for one in drawn for cut in one.cuts]
        frames = frames_of(cuts, self.window)
        cut_rotations(cuts, frames, [rows[span, w] for span in spans for w in range(windows)])
        ground = ground_of(cuts, frames).of_draws(windows)
        for d, (one, span) in enumerate(zip(drawn, spans, strict=True)):
            if one.mirrored:
                hips, planted, lift = (each[d] for each in ground)
                rows[span], hips[:], planted[:] = mirrored_motion(rows[span], hips, planted)
                lift[:] = lift[:, :, ::-1].copy()
        turn_between(rows, [plan.between for plan in plans], starts)
        turns = leg_turns(
            [body for one in drawn for body in (one.bodies.source, one.bodies.target)],
            rows,
            in_concatenation([plan.legs.bones for plan in plans], starts),
            in_concatenation([plan.legs.uppers for plan in plans], starts),
            *(np.repeat(each, 2, 0) for each in ground),
        )
        turn_legs(rows, turns, [plan.legs for plan in plans], starts)
        turn_between(rows, [plan.copied for plan in plans], starts)
        roots = seen_from_start(rows, ground.hips, plans, starts)
        pairs = []
        for k, (one, plan, first) in enumerate(zip(drawn, plans, starts, strict=True)):
            to, of_target = one.bodies, one.bodies.target.variant.body
            ends, own = (to.source.variant.body, of_target, of_target), rows[first:][: plan.rows]
            source, target, start = (
                Drawn(body, own, plan.bones, at, roots[k])
                for body, at in zip(ends, plan.poses, strict=True)
            )
            frame_time = one.cuts[0].clip.frame_time
            pairs.append(
                Pairs(source, target, start, to.link.unmatched, ground.planted[k], frame_time)
            )
        return pairs

    def _sample(self, n: int, windows: int) -> "_Draw":
        rng = np.random.default_rng((self.seed, n))
        k = int(self._chances.searchsorted(rng.random(), "right"))
        mirrored = bool(rng.random() < 0.5)
        target = self._staged_body(k, mirrored, 0)
        for _ in range(_MAX_TRIES):
            # Two numbers for one: so a seed draws what it always drew.
            performer, _ = rng.integers(self.variants, size=2).tolist()
            pair = self._pair(self._staged_body(k, mirrored, performer), target)
            if pair.some_unmatched:
                break
        return _Draw(pair, mirrored, self._cuts(k, windows, rng))

    def _cuts(self, k: int, windows: int, rng: np.random.Generator) -> list[Cut]:
        clips, cuts = self._bodies[k], []
        for i in self._chances_of_clips[k].searchsorted(rng.random(windows), "right").tolist():
            clip, speed = clips[i], exp(rng.uniform(-_MAX_LOG_SPEED, _MAX_LOG_SPEED))
            frames = ceil((self.window - 1) * speed) + 1
            if rng.random() < 0.5 or frames > len(clip.hips):
                frames, speed = self.window, 1.0
            cuts.append(Cut(clip, int(rng.integers(0, len(clip.hips) - frames + 1)), speed))
        return cuts

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

    def _pair(self, source: StagedBody, target: StagedBody) -> "_BodyPair":
        key = (source, target)
        if key not in self._pairs:
            if len(self._pairs) >= _MOST_PAIRS:
                del self._pairs[next(iter(self._pairs))]
            self._pairs[key] = _BodyPair(*key)
        return self._pairs[key]


@dataclass(eq=False)
class _BodyPair:
    """Two bodies and what carries motion from one to the other, each part made when asked for."""

    source: StagedBody
    target: StagedBody

    @cached_property
    def link(self) -> Correspondence:
        return correspond(self.source.variant.body.rig, self.target.variant.body.rig)

    @cached_property
    def some_unmatched(self) -> bool:
        return bool((self.link.unmatched >= 0).any())

    @cached_property
    def plan(self) -> Plan:
        return plan_of_pair(self.source, self.target, self.link)


class _Draw(NamedTuple):
    """What a draw consists of before it is put on its two bodies."""

    bodies: _BodyPair
    mirrored: bool
    cuts: list[Cut]


def _chances(weights: Float[np.ndarray, "N"]) -> Float[np.ndarray, "N"]:
    """What a number in [0, 1) is looked up in, as numpy's `choice` does for each draw anew."""
    summed = (weights / weights.sum()).cumsum()
    return summed / summed[-1]


def _total_rotation(clip: TrainingClip) -> float:
    """How much the joints turn in all [rad], with a little for a clip that stands still."""
    rotations = np.asarray(clip.rotations)
    step = quat_angle(rotations[:-1], rotations[1:]).mean() if len(rotations) > 1 else 0.0
    return float(len(rotations) * (step + 1e-3))
