"""Training pairs with exact answers: one motion on two random skeletons, made while training runs.

A clip is kept on its own skeleton in canonical form. For a batch, windows of it are put onto two
random variants of that skeleton; on both, the feet are planted again where the recording's feet
were. The network gets the first, its analytic transfer to the second, and must find the second.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.errors import SkeletonError
from spark.features import BodyFeatures
from spark.kinematics import local_rotations
from spark.mirror import mirrored_body, mirrored_motion
from spark.plant import Leg, bend_leg, stance_correction
from spark.resample import positions_at, rotations_at
from spark.roles import LIMBS, Group, Role
from spark.rotation import (
    quat_angle,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
    sixd_from_quat,
    yaw_from_quat,
)
from spark.transfer import Correspondence, correspond
from spark.variants import Variant, random_variant, same_body, split_body

_PACE = 0.3  # of the logarithm of a motion's speed
_TRIES = 10


@dataclass(frozen=True, eq=False)
class Clip:
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


class Windows(NamedTuple):
    """W windows of T frames on one body: local 6D rotations, root, and what loss terms need."""

    body: BodyFeatures
    rotations: Float[np.ndarray, "W T K 6"]
    root: Float[np.ndarray, "W T 3"]


class Pairs(NamedTuple):
    """W windows on two bodies; `start` is the analytic transfer of `source` to the target, and
    `guess` its `Correspondence.guess`."""

    source: Windows
    target: Windows
    start: Windows
    guess: Int[np.ndarray, "J"]
    planted: Bool[np.ndarray, "W T 2"]
    frame_time: float


class PairMaker:
    """Draws pairs from clips. Draw `n` of a seed is always the same, whatever was drawn before.

    Making a skeleton costs as much as using it many times, so each body has a fixed set of
    `variants`, made when they are first met: itself, itself with joints split as in SAN, and random
    ones. With `distinct`, no two of them have a motion in common as a source (the paper's training
    set); without, any of them may perform any of the body's clips. With `varied`, half of the draws
    are seen in a mirror, half are slowed down or sped up by up to a third, and bodies are drawn
    again where the analytic transfer has nothing to guess: there is nothing to learn there.

    Bodies are drawn by the square root of how much they turn: much of one counts for less, and
    hours of standing about for little.
    """

    def __init__(
        self,
        clips: Sequence[Clip],
        *,
        window: int = 64,
        variants: int = 256,
        seed: int = 0,
        distinct: bool = False,
        varied: bool = False,
    ) -> None:
        self.window, self.variants, self.seed = window, variants, seed
        self.distinct, self.varied = distinct, varied
        by_body: dict[int, list[Clip]] = {}
        for clip in clips:
            if len(clip.hips) >= window:
                by_body.setdefault(id(clip.body), []).append(clip)
        self._bodies = list(by_body.values())
        if not self._bodies:
            raise SkeletonError(f"no clip has {window} frames: expected at least one to train on")
        weights = np.sqrt([sum(map(_turning, group)) for group in self._bodies])
        self._weights = weights / weights.sum()
        self._seen: dict[tuple[int, bool], BodyFeatures] = {}
        self._stages: dict[tuple[int, bool, int], Stage] = {}
        self._links: dict[tuple[Stage, Stage], Correspondence] = {}

    def draw(self, n: int, windows: int) -> Pairs:
        """Draw number `n`: `windows` windows of one body's clips on one pair of its variants."""
        rng = np.random.default_rng((self.seed, n))
        k = int(rng.choice(len(self._bodies), p=self._weights))
        clips = self._bodies[k]
        mirrored = self.varied and bool(rng.random() < 0.5)
        for _ in range(_TRIES if self.varied else 1):
            performer, receiver = rng.integers(self.variants, size=2).tolist()
            if self.distinct:
                performer %= min(self.variants, len(clips))
            source, target = (self._stage(k, mirrored, number) for number in (performer, receiver))
            link = self._link(source, target)
            if (link.guess >= 0).any():
                break
        if self.distinct:
            clips = clips[performer :: self.variants]
        rotations, hips, planted = self._cut(clips, windows, rng)
        if mirrored:
            rotations, hips, planted = mirrored_motion(rotations, hips, planted)
        on_source = source.place(rotations, hips, planted)
        on_target = target.place(rotations, hips, planted)
        copied = link.rotations(on_source, target.variant.body.rig)
        return Pairs(
            _windows(source.variant.body, on_source, hips),
            _windows(target.variant.body, on_target, hips),
            _windows(target.variant.body, copied, hips),
            link.guess,
            planted,
            self._bodies[k][0].frame_time,
        )

    def _cut(
        self, clips: list[Clip], windows: int, rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, "W T K 4"], Float[np.ndarray, "W T 3"], Bool[np.ndarray, "W T 2"]]:
        lengths = np.array([len(c.hips) for c in clips], float)
        chosen = rng.choice(len(clips), windows, p=lengths / lengths.sum())
        cuts = []
        for i in chosen.tolist():
            clip = clips[i]
            speed = float(np.exp(rng.uniform(-_PACE, _PACE)))
            frames = int(np.ceil((self.window - 1) * speed)) + 1
            if not self.varied or rng.random() < 0.5 or frames > len(clip.hips):
                frames, speed = self.window, 1.0
            at = int(rng.integers(0, len(clip.hips) - frames + 1))
            span = slice(at, at + frames)
            cut = clip.rotations[span], clip.hips[span], clip.planted[span]
            if speed != 1:
                times = np.arange(self.window) * speed
                nearest = np.minimum(times.round().astype(int), frames - 1)
                cut = rotations_at(cut[0], times), positions_at(cut[1], times), cut[2][nearest]
            cuts.append(cut)
        rotations, hips, planted = (np.stack(part) for part in zip(*cuts, strict=True))
        return rotations, hips, planted

    def _body(self, k: int, mirrored: bool) -> BodyFeatures:
        if (k, mirrored) not in self._seen:
            body = self._bodies[k][0].body
            self._seen[k, mirrored] = mirrored_body(same_body(body).body) if mirrored else body
        return self._seen[k, mirrored]

    def _stage(self, k: int, mirrored: bool, number: int) -> "Stage":
        key = (k, mirrored, number)
        if key not in self._stages:
            body = self._body(k, mirrored)
            if number < 2:
                variant = (same_body, split_body)[number](body)
            else:
                variant = random_variant(body, np.random.default_rng((self.seed, *key)))
            self._stages[key] = Stage(variant)
        return self._stages[key]

    def _link(self, source: "Stage", target: "Stage") -> Correspondence:
        key = (source, target)
        if key not in self._links:
            if len(self._links) > 4096:
                self._links.clear()
            self._links[key] = correspond(source.variant.body.rig, target.variant.body.rig)
        return self._links[key]


@dataclass(frozen=True, eq=False)
class Stage:
    """A variant and what putting motion onto it needs."""

    variant: Variant

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        return tuple(leg_of(self.variant.body, g) for g in (Group.LEFT_LEG, Group.RIGHT_LEG))

    def place(
        self,
        base: Float[np.ndarray, "W T K 4"],
        hips: Float[np.ndarray, "W T 3"],
        planted: Bool[np.ndarray, "W T 2"],
    ) -> Float[np.ndarray, "W T J 4"]:
        """The base's rotations on this body, with the planted feet planted."""
        rotations = self.variant.rotations(base)
        skeleton = self.variant.body.skeleton
        positions = np.empty((*rotations.shape[:-1], 3))
        for side, leg in enumerate(self.legs):
            chain = list(skeleton.ancestors(leg.contact)[::-1])
            bones = quat_rotate(rotations[..., chain[:-1], :], skeleton.offsets[chain[1:]])
            positions[..., chain[1:], :] = hips[..., None, :] + bones.cumsum(-2)
            move = stance_correction(positions[..., leg.contact, :], planted[..., side])
            rotations = bend_leg(rotations, positions, leg, move)
        return rotations


def leg_of(body: BodyFeatures, group: Group) -> Leg:
    """The joints of one leg in the network's numbering."""
    roles = [body.rig.roles.roles[j] for j in body.joints.tolist()]
    upper, lower, foot, toe = LIMBS[group]
    place: dict[Role, int] = {role: roles.index(role) for role in LIMBS[group] if role in roles}
    thigh, shank, ankle = place[upper], place[lower], place[foot]
    below_knee = set(body.skeleton.subtree(shank))
    below_ankle = set(body.skeleton.subtree(ankle))
    leg = set(body.skeleton.subtree(thigh))
    return Leg(
        thigh,
        shank,
        ankle,
        place.get(toe, ankle),
        tuple(sorted(leg - below_knee)),
        tuple(sorted(below_knee - below_ankle)),
    )


def _windows(
    body: BodyFeatures, world: Float[np.ndarray, "W T K 4"], hips: Float[np.ndarray, "W T 3"]
) -> Windows:
    """Seen from each window's first frame, as `spark.features.pose_features` sees one."""
    local = local_rotations(body.skeleton, world)
    back = quat_from_yaw(-yaw_from_quat(world[:, :1, 0]))
    local[..., 0, :] = quat_mul(back, world[..., 0, :])
    origin = hips[:, :1] * np.array([1.0, 1, 0])
    return Windows(body, sixd_from_quat(local), quat_rotate(back, hips - origin))


def _turning(clip: Clip) -> float:
    """How much the joints turn in all [rad], with a little for a clip that stands still."""
    rotations = np.asarray(clip.rotations)
    step = quat_angle(rotations[:-1], rotations[1:]).mean() if len(rotations) > 1 else 0.0
    return float(len(rotations) * (step + 1e-3))
