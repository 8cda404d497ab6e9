"""The paper's training set: characters that perform motions of their own, and no answers.

A character is a recorded body, or that body with joints split as in SAN (section 5). Windows and
targets are drawn as they were recorded: nothing is scaled, mirrored, slowed down or planted anew.
"""

import hashlib
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from spark.errors import SkeletonError
from spark.network.features import BodyFeatures
from spark.training.cuts import Cut, TrainingClip, cut_rotations, frames_of
from spark.training.plan import plan_of_body
from spark.training.posing import Drawn, seen_from_start, turn_between
from spark.training.sizes import Sizes, sizes_of
from spark.training.splits import motions_of
from spark.training.staging import empty_rows
from spark.training.variants import Variant, same_body, split_body, split_joints

SHARED = 10  # "every two characters have at most 10 paired motion sequences" (section 5.3)


@dataclass(eq=False)
class Character:
    """One of the training set, with the clips that it performs."""

    variant: Variant
    clips: list[TrainingClip] = field(default_factory=list)

    @property
    def frames(self) -> int:
        """Of all its clips."""
        return sum(len(clip.hips) for clip in self.clips)


class UnpairedMaker:
    """Draws windows, and the characters that they go to. Draw `n` of a seed is always the same.

    No motion is performed by two characters, but for `shared` ones by any two. Each window of the
    training set is as likely as any other, and so is each other character as its target.
    """

    def __init__(
        self, clips: Sequence[TrainingClip], *, window: int = 64, seed: int = 0, shared: int = 0
    ) -> None:
        self.window, self.seed = window, seed
        clips = [clip for clip in clips if len(clip.hips) >= window]
        if not clips:
            raise SkeletonError(f"no clip has {window} frames: expected at least one to train on")
        self.characters = assign(clips, seed, shared)
        if len(self.characters) < 2:
            raise SkeletonError(
                "one character alone, without joints to split: expected two or more to train on"
            )
        self._acting = [k for k, one in enumerate(self.characters) if one.clips]
        self._windows = [
            np.array([len(clip.hips) - window + 1 for clip in one.clips], float)
            for one in self.characters
        ]
        self._plans = [plan_of_body(one.variant) for one in self.characters]
        weights = np.array([self._windows[k].sum() for k in self._acting])
        self._weights = weights / weights.sum()

    @property
    def sizes(self) -> Sizes:
        """What holds every draw."""
        return sizes_of(one.variant.body for one in self.characters)

    def draws(self, numbers: Sequence[int], windows: int) -> list[tuple[Drawn, BodyFeatures]]:
        """The draws of these numbers: `windows` windows of one character each, and a target."""
        drawn = [self._sample(n, windows) for n in numbers]
        plans = [self._plans[one.who] for one in drawn]
        *starts, total = np.cumsum([0, *(plan.rows for plan in plans)]).tolist()
        rows = empty_rows(total, windows, self.window)
        cuts = [cut for one in drawn for cut in one.cuts]
        cut_rotations(
            cuts,
            frames_of(cuts, self.window),
            [
                rows[start : start + plan.recorded, w]
                for plan, start in zip(plans, starts, strict=True)
                for w in range(windows)
            ],
        )
        turn_between(rows, [plan.between for plan in plans], starts)
        roots = seen_from_start(rows, np.stack([one.hips for one in drawn]), plans, starts)
        made = []
        for one, plan, start, root in zip(drawn, plans, starts, roots, strict=True):
            body, own = self.characters[one.who].variant.body, rows[start:][: plan.rows]
            made.append((Drawn(body, own, plan.bones, plan.poses[0], root), one.target))
        return made

    def _sample(self, n: int, windows: int) -> "_Draw":
        rng = np.random.default_rng((self.seed, n))
        k = int(rng.choice(self._acting, p=self._weights))
        who, of_clips = self.characters[k], self._windows[k]
        other = int(rng.integers(len(self.characters) - 1))
        target = self.characters[other + (other >= k)].variant.body
        chosen = rng.choice(len(who.clips), windows, p=of_clips / of_clips.sum())
        cuts = [Cut(who.clips[i], int(rng.integers(int(of_clips[i])))) for i in chosen.tolist()]
        # A view of a memory-mapped array costs more than what is read through it.
        hips = [np.asarray(cut.clip.hips)[cut.at : cut.at + self.window] for cut in cuts]
        return _Draw(k, target, cuts, np.array(hips, np.float32))


class _Draw(NamedTuple):
    """Windows of one character's, their paths, and the target that they go to."""

    who: int
    target: BodyFeatures
    cuts: list[Cut]
    hips: Float[np.ndarray, "W T 3"]


def assign(clips: Sequence[TrainingClip], seed: int, shared: int) -> list[Character]:
    """The characters of a training set, every motion with one of those that recorded it: the one
    that has least so far. Others get it too, as long as no two then share more than `shared`."""
    bodies = list({id(clip.body): clip.body for clip in clips}.values())
    characters: list[Character] = []
    of_body: dict[int, list[int]] = {}
    for body in bodies:
        forms = [same_body(body), *([split_body(body)] if split_joints(body) else [])]
        of_body[id(body)] = list(range(len(characters), len(characters) + len(forms)))
        characters += [Character(form) for form in forms]
    motions = motions_of(clip.name for clip in clips)
    by_motion: dict[str, list[TrainingClip]] = defaultdict(list)
    for clip in clips:
        by_motion[motions[clip.name]].append(clip)
    together: Counter[tuple[int, int]] = Counter()
    for motion in sorted(by_motion, key=lambda name: _rank(seed, name)):
        performances: dict[int, list[TrainingClip]] = defaultdict(list)
        for clip in by_motion[motion]:
            for k in of_body[id(clip.body)]:
                performances[k].append(clip)
        first = min(performances, key=lambda k: (characters[k].frames, _rank(seed, motion, k)))
        chosen = [first]
        for k in sorted(performances, key=lambda k: _rank(seed, motion, k)):
            if k != first and all(together[_pair(k, other)] < shared for other in chosen):
                chosen.append(k)
        together.update(_pair(a, b) for a, b in combinations(chosen, 2))
        for k in chosen:
            characters[k].clips += performances[k]
    return characters


def _pair(a: int, b: int) -> tuple[int, int]:
    return min(a, b), max(a, b)


def _rank(*what: object) -> str:
    """A number for a draw that stays, whatever else there is to draw."""
    return hashlib.sha256("/".join(map(str, what)).encode()).hexdigest()
