"""Methods against ground truths: the rows of the paper's tables 1 and 2, with copy on top.

A method is whatever puts a case's source on its target: the analytic transfer, a checkpoint's
network, or another tool, whose results are read from a folder.
"""

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError, SkeletonError, name_list
from spark.evaluation.cases import STRUCTURES, Case, Structure
from spark.evaluation.metrics import Score, mean_score, score_positions, source_sensitivity
from spark.io.reading import SUFFIXES, read_motion
from spark.rig.rig import understand
from spark.summary import counted
from spark.training.same_motion import SPARE_FRAMES
from spark.transfer.canonical import (
    FRAME_TIME,
    CanonicalMotion,
    at_frame_time,
    canonical_positions,
    to_canonical,
)
from spark.transfer.own_soles import fit_body
from spark.transfer.refine import grounded, refined
from spark.transfer.target_prior import RetargetMethod, with_target_prior

Positions = Float[np.ndarray, "_ _ 3"]  # frames, joints
Method = Callable[[Case], Positions]
_Pair = tuple[Structure, str, str, tuple[str, ...]]  # target, performer, the target's joints
LegFitter = Callable[[CanonicalMotion, CanonicalMotion], CanonicalMotion]

# Cells in the paper's order; a dataset without a split has one without a name.
CELLS = ("sc+sm", "sc+um", "uc+sm", "uc+um")


@dataclass(frozen=True)
class CellScore:
    """The mean score of one method over a structure's cases of one cell."""

    score: Score
    cases: int


@dataclass(frozen=True)
class MethodScores:
    """One method: its scores by structure and cell, and over all cases of a structure together.

    `settings` are those of the training of a checkpoint. `sensitivity`: `source_sensitivity`, the
    mean over targets that receive several motions; NaN where there is none. `each` has every case's
    score, in their order.
    """

    name: str
    cells: Mapping[tuple[Structure, str], CellScore]
    sensitivity: Mapping[Structure, float]
    settings: Mapping[str, object] = field(default_factory=dict)
    each: tuple[Score, ...] = ()

    def mean(self, structure: Structure) -> Score:
        """The mean over the cells of a structure; NaN where there is none."""
        of_one = [cell.score for (kind, _), cell in self.cells.items() if kind == structure]
        return mean_score({str(i): [score] for i, score in enumerate(of_one)})


def evaluate(
    name: str,
    method: Method,
    cases: Sequence[Case],
    *,
    settings: Mapping[str, object] | None = None,
    progress: Callable[[Iterable[Case]], Iterable[Case]] = iter,
) -> MethodScores:
    """The row of one method. Means go over a character's clips first, then over characters."""
    scores: dict[tuple[Structure, str], dict[str, list[Score]]] = defaultdict(
        lambda: defaultdict(list)
    )
    # Of a character with several bodies, clips with the same joints go together.
    positions_by_pair: dict[_Pair, list[tuple[Positions, Positions]]] = defaultdict(list)
    each: list[Score] = []
    for case in progress(cases):
        truth = canonical_positions(case.truth)
        own = method(case)
        rig = case.truth.rig
        scored = score_positions(own, truth, rig, case.truth.frame_time, case.height)
        scores[case.structure, case.cell][case.target].append(scored)
        each.append(scored)
        pair = case.structure, case.target, case.performer, rig.skeleton.names
        positions_by_pair[pair].append((_relative(own), _relative(truth)))
    return MethodScores(
        name,
        {
            key: CellScore(mean_score(of_one), sum(map(len, of_one.values())))
            for key, of_one in sorted(scores.items(), key=lambda item: _table_order(*item[0]))
        },
        {structure: _sensitivity(structure, positions_by_pair) for structure in STRUCTURES},
        settings or {},
        tuple(each),
    )


def as_method(
    method: RetargetMethod,
    *,
    target_prior: bool = False,
    legs_fitted: bool = False,
    feet_held: bool = False,
    legs: LegFitter = fit_body,
) -> Method:
    """A retarget method as `evaluate` takes one.

    With `target_prior` it is corrected by another recording of the target
    (`spark.transfer.target_prior`), with `legs_fitted` its feet are led where the source's go
    (`spark.transfer.leg_fit`, or by `legs`), with `feet_held` locked where the source's stand
    (`spark.transfer.foot_lock`). All three are what `retarget` does; but a loop ends here
    where it ends. With fitted legs and held feet the hips sway, as they do there
    (`spark.transfer.hip_sway`)."""

    def run(case: Case) -> Positions:
        if target_prior and case.target_recording is not None:
            moved = with_target_prior(method, case.source, case.target_recording)
        else:
            moved = method(case.source, case.truth.rig)
        if legs_fitted:
            moved = legs(case.source, moved)
        if feet_held:
            moved = (refined if legs_fitted else grounded)(case.source, moved)
        return canonical_positions(moved)

    return run


def results_in(folder: Path) -> Method:
    """Another tool's results: FOLDER/TARGET/SOURCE/MOTION.bvh (or .fbx), named after characters and
    motion, on the target's skeleton.

    Heights count from the ground of the truth. Raises `FileFormatError` where a result is
    missing or unlike its truth.
    """

    def read(case: Case) -> Positions:
        answer = case.answer
        if answer is None:
            raise SkeletonError(
                f"{case.motion} on {case.target}: its answer is made here, so that no other tool "
                "can have a result for it"
            )
        path = _result(folder / case.target / case.performer, case.motion)
        motion = read_motion(path).motion
        try:
            rig = understand(motion)
        except SkeletonError as error:
            raise SkeletonError(f"{path}: {error}") from error
        positions = canonical_positions(at_frame_time(to_canonical(motion, rig), FRAME_TIME))
        frames = len(case.truth)
        if abs(len(positions) - frames) > SPARE_FRAMES:
            raise FileFormatError(
                path,
                None,
                f"{counted(len(positions), 'frame')} at 30 fps; expected {frames}, as the ground "
                "truth has",
            )
        own = answer.clip.body
        joints = _same_joints(path, rig.skeleton.names, own.skeleton.names)
        positions = positions[np.minimum(np.arange(frames), len(positions) - 1)]
        hips = positions[:, rig.hips].mean(1)
        positions = positions[:, joints]
        positions[:, 0] = hips
        # Where the truth counts from its file's own ground, so does the result.
        ground = answer.floor_z - case.truth.floor_z * own.rig.hip_height
        return (positions - [0, 0, ground]) / own.rig.hip_height

    return read


def _result(folder: Path, motion: str) -> Path:
    paths = [folder / (motion + suffix) for suffix in SUFFIXES]
    found = next((path for path in paths if path.is_file()), None)
    if found is None:
        raise FileFormatError(paths[0], None, "no such result; expected one for each pair")
    return found


def _same_joints(path: Path, names: Sequence[str], expected: Sequence[str]) -> list[int]:
    """Where the truth's joints are in a result; a prefix (`mixamorig:`) may have been lost."""
    plain = {_plain(name): j for j, name in reversed(list(enumerate(names)))}
    missing = [name for name in expected if _plain(name) not in plain]
    if missing:
        raise FileFormatError(
            path,
            None,
            f"lacks the joints {name_list(missing)} of the ground truth's skeleton; expected a "
            "motion on that skeleton",
        )
    return [plain[_plain(name)] for name in expected]


def _plain(name: str) -> str:
    return re.split(r"[:|]", name)[-1].replace(" ", "_").lower()


def _relative(positions: Positions) -> Positions:
    return positions - positions[:, :1]


def _sensitivity(
    structure: Structure,
    positions_by_pair: Mapping[_Pair, Sequence[tuple[Positions, Positions]]],
) -> float:
    found = [
        source_sensitivity(*zip(*pairs, strict=True))
        for (kind, *_), pairs in positions_by_pair.items()
        if kind == structure and len(pairs) > 1
    ]
    return sum(found) / len(found) if found else float("nan")


def _table_order(structure: Structure, cell: str) -> tuple[int, int]:
    return STRUCTURES.index(structure), CELLS.index(cell) if cell in CELLS else 0
