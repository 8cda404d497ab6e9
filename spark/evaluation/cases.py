"""Test cases: pairs of one motion on two bodies.

Everything is as the network sees bodies (`spark.network.features`), in hip heights of the body in
question. A case is *intra-structural* where both bodies have the same roles, each in as many
joints, and *cross-structural* else. *Missing* are made cases whose source lacks joints of the
target's spine, neck or shoulders, so that these are unmatched.
"""

import zlib
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, TypeVar

import numpy as np

from spark.errors import SkeletonError
from spark.evaluation.metrics import san_height
from spark.network.features import BodyFeatures
from spark.rig.roles import Role
from spark.summary import counted
from spark.training.cuts import TrainingClip
from spark.training.dataset import Performance, is_dataset, read_performances
from spark.training.grounded import on_ground
from spark.training.prepare import prepare
from spark.training.same_motion import SPARE_FRAMES, same_motion
from spark.training.splits import motions_of
from spark.training.staging import StagedBody
from spark.training.variants import Variant, random_variant, same_body, scaled_body, split_body
from spark.transfer.analytic import correspond
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.target_prior import MIN_DURATION

Structure = Literal["intra", "cross", "missing"]
STRUCTURES: tuple[Structure, ...] = ("intra", "cross", "missing")

# Made targets of each body and structure: its clips share them, so that results can be compared.
_TARGETS_PER_BODY = 3
_MAX_TRIES = 50  # random variants of a body

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Case:
    """`source` is to be put on `truth.rig`; `truth` is the answer.

    `height` is the target's in SAN's metric [hip heights], `answer` the clip that the truth is
    where it was recorded and not made, `performer` the source's character, `target_recording`
    another recording of the target, if there is one.
    """

    motion: str
    performer: str
    target: str
    cell: str
    structure: Structure
    source: CanonicalMotion
    truth: CanonicalMotion
    height: float
    answer: Performance | None = None
    target_recording: CanonicalMotion | None = None


def performances(path: Path) -> list[Performance]:
    """The clips of a dataset, or of a folder with one folder a character, which has no cells.

    Raises what `spark.training.prepare.prepare` and `read_performances` raise.
    """
    if is_dataset(path):
        return read_performances(path)
    with TemporaryDirectory() as folder:
        prepare([path], Path(folder))
        found = read_performances(Path(folder))
        return [replace(p, clip=_in_memory(p.clip), cell="") for p in found]


def recorded_cases(
    found: Sequence[Performance], seed: int = 0, limit: int | None = None
) -> tuple[list[Case], list[str]]:
    """A case for each motion that is on two characters, both ways round, and notes on those that
    can't be one. Where both have the same structure, the target with its joints split as in SAN
    makes a second, cross-structural one. Of each cell at most `limit` such pairs, drawn by `seed`.

    Raises `SkeletonError` where there is none.
    """
    motions = motions_of(one.clip.name for one in found)
    by_motion: dict[str, list[Performance]] = defaultdict(list)
    for one in found:
        by_motion[motions[one.clip.name]].append(one)
    pairs: list[tuple[str, list[Case]]] = []
    notes: list[str] = []
    for motion, ones in sorted(by_motion.items()):
        longer: list[str] = []
        namesakes: list[str] = []
        for source in ones:
            for target in ones:
                lengths = len(source.clip.hips), len(target.clip.hips)
                if source.character == target.character:
                    continue
                if abs(lengths[0] - lengths[1]) > SPARE_FRAMES:
                    longer.append(
                        f"{source.character} and {target.character}, which differ by "
                        f"{counted(abs(lengths[0] - lengths[1]), 'frame')}"
                    )
                    continue
                if not same_motion(on_ground(source), on_ground(target)):
                    namesakes.append(f"{source.character} and {target.character}")
                    continue
                others = [p.clip for p in found if p.clip.body is target.clip.body]
                own = _longest([clip for clip in others if motions[clip.name] != motion])
                of_pair = _recorded(source, target, min(lengths), own)
                pairs.append((target.cell, of_pair))
        if longer:
            notes.append(
                f"{motion}: {counted(len(longer), 'pair')} with this name, but not as long "
                f"({longer[0]}{', for one' * (len(longer) > 1)}): left out"
            )
        if namesakes:
            notes.append(
                f"{motion}: {counted(len(namesakes), 'pair')} ({namesakes[0]}, for one) with this "
                "name, but not the same motion: left out"
            )
    if not pairs:
        raise SkeletonError(
            f"no motion is on two characters among {len(found)} clips ("
            f"{len(by_motion)} motions); expected files of one name in the folders of two "
            "characters, or --made for answers made by changing each clip's skeleton"
        )
    return [case for of_pair in _drawn(pairs, seed, limit) for case in of_pair], notes


def made_cases(found: Sequence[Performance], seed: int = 0, limit: int | None = None) -> list[Case]:
    """Each clip with two targets that are changed copies of its own body, on which the answer is
    known (`spark.training.pairs`): one with other bone lengths, and one with other joints and names
    too. And a changed copy that lacks joints, with the clip's own body as its target. In all
    answers the feet are planted while the recording's stand, and as high.

    The target's own recording is the longest other clip of the body; of a body with one clip, its
    first half, and the second is the case, if that much is left.

    Of each cell at most `limit` clips, drawn by `seed`. Training does not meet these targets,
    whatever its seed: it draws other ones.
    """
    staged: dict[tuple[int, Structure, int], StagedBody] = {}
    cases = []
    numbered = [(one.cell, (i, one)) for i, one in enumerate(found)]
    for i, one in _drawn(numbered, seed, limit):
        body, (clip, other) = one.clip.body, _case_and_recording(one.clip, found)
        unchanged = StagedBody(same_body(body))
        recorded = _canonical(clip, unchanged.variant, len(clip.hips))
        for structure in STRUCTURES:
            number = i % _TARGETS_PER_BODY
            key = (id(body), structure, number)
            if key not in staged:
                name = zlib.crc32(one.character.encode(errors="surrogateescape"))
                rng = np.random.default_rng((seed, name, number, STRUCTURES.index(structure)))
                make = {"intra": scaled_body, "cross": random_variant, "missing": lacking_body}
                staged[key] = StagedBody(make[structure](body, rng))
            ends = unchanged, staged[key]
            source, target = ends[::-1] if structure == "missing" else ends
            cases.append(
                Case(
                    *(one.clip.name, one.character, f"{one.character} {structure} {number}"),
                    *(one.cell, structure),
                    recorded if source is unchanged else _made_motion(clip, source),
                    truth := _made_motion(clip, target),
                    san_height(truth.rig),
                    target_recording=None if other is None else _made_motion(other, target),
                )
            )
    return cases


def _case_and_recording(
    clip: TrainingClip, found: Sequence[Performance]
) -> tuple[TrainingClip, TrainingClip | None]:
    """The part of a clip that is the case, and another recording of its body."""
    others = [p.clip for p in found if p.clip.body is clip.body and p.clip is not clip]
    if others:
        return clip, _longest(others)
    half = len(clip.hips) // 2
    if half * clip.frame_time < MIN_DURATION:
        return clip, None
    return _part(clip, slice(half, None)), _part(clip, slice(half))


def _longest(clips: Sequence[TrainingClip]) -> TrainingClip | None:
    return max(clips, key=lambda clip: len(clip.hips), default=None)


def _part(clip: TrainingClip, frames: slice) -> TrainingClip:
    rotations, hips, planted = (x[frames] for x in (clip.rotations, clip.hips, clip.planted))
    return replace(clip, rotations=rotations, hips=hips, planted=planted)


def _made_motion(clip: TrainingClip, body: StagedBody) -> CanonicalMotion:
    """A recording on a changed copy of its body, the feet planted where they stand."""
    rotations, hips = (np.asarray(x, np.float64)[None] for x in (clip.rotations, clip.hips))
    planted = np.asarray(clip.planted)[None]
    placed = body.pose(rotations, hips, planted, clip.lift[None])[0]
    return CanonicalMotion(body.variant.body.rig, clip.frame_time, placed, hips[0])


def lacking_body(body: BodyFeatures, rng: np.random.Generator) -> Variant:
    """A random variant from which some joint of `body` is unmatched, if one is found."""
    own = same_body(body).body.rig
    for _ in range(_MAX_TRIES):
        variant = random_variant(body, rng)
        if (correspond(variant.body.rig, own).unmatched >= 0).any():
            break
    return variant


def _recorded(
    source: Performance, target: Performance, frames: int, own: TrainingClip | None
) -> list[Case]:
    source_body, target_body = source.clip.body, target.clip.body
    height = san_height(target_body.rig) / target_body.rig.hip_height
    source_motion = on_ground(source, frames=frames)
    targets: dict[Structure, Variant] = {"cross": same_body(target_body)}
    if _structure(source_body) == _structure(target_body):
        targets = {"intra": same_body(target_body), "cross": split_body(target_body)}
    return [
        Case(
            *(
                source.clip.name,
                source.character,
                target.character,
                target.cell,
                structure,
                source_motion,
            ),
            truth := on_ground(target, variant, frames),
            height,
            target if variant.body.skeleton.names == target_body.skeleton.names else None,
            None
            if own is None
            else replace(_canonical(own, variant, len(own.hips)), rig=truth.rig),
        )
        for structure, variant in targets.items()
    ]


def _structure(body: BodyFeatures) -> Counter[Role | None]:
    """What makes two bodies alike: clothes and ends of limbs, which follow, do not."""
    found = Counter(body.rig.roles.roles[j] for j in body.joints.tolist())
    found.pop(None, None)
    return found


def _in_memory(clip: TrainingClip) -> TrainingClip:
    rotations, hips, planted = map(np.array, (clip.rotations, clip.hips, clip.planted))
    return replace(clip, rotations=rotations, hips=hips, planted=planted)


def _canonical(clip: TrainingClip, variant: Variant, frames: int) -> CanonicalMotion:
    rotations = variant.rotations(np.asarray(clip.rotations[:frames], np.float64))
    hips = np.asarray(clip.hips[:frames], np.float64)
    return CanonicalMotion(variant.body.rig, clip.frame_time, rotations, hips)


def _drawn(items: Sequence[tuple[str, T]], seed: int, limit: int | None) -> list[T]:
    """Of the items of each cell all, or at most `limit`, drawn by `seed`."""
    by_cell: dict[str, list[T]] = defaultdict(list)
    for cell, item in items:
        by_cell[cell].append(item)
    if limit is None:
        return [item for of_cell in by_cell.values() for item in of_cell]
    rng = np.random.default_rng(seed)
    return [
        of_cell[k]
        for _, of_cell in sorted(by_cell.items())
        for k in sorted(rng.permutation(len(of_cell))[:limit].tolist())
    ]
