"""Recordings as training clips: any tree of motion files, at one frame rate, in canonical form."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from spark.errors import SkeletonError, SparkSimError
from spark.io.reading import motion_files, read_motion
from spark.network.features import BodyFeatures, body_features
from spark.rig.contacts import planted_feet
from spark.rig.rig import understand
from spark.skeleton import Skeleton
from spark.training.cuts import TrainingClip
from spark.training.splits import characters_and_motions
from spark.transfer.canonical import (
    FRAME_TIME,
    CanonicalMotion,
    at_frame_time,
    canonical_positions,
    to_canonical,
)


def read_clips(
    paths: Sequence[Path], progress: Callable[[Iterable[Path]], Iterable[Path]] = iter
) -> tuple[list[TrainingClip], tuple[str, ...]]:
    """The humanoid recordings among `paths` and below them as clips, and notes on the others.

    Files of one skeleton share one body, so that training draws from them together. Raises
    `FileFormatError` where a path holds no motion file, `SkeletonError` where none is usable.
    """
    bodies: dict[tuple[object, ...], BodyFeatures] = {}
    clips: list[TrainingClip] = []
    notes: list[str] = []
    files = [file for given in paths for file in motion_files(given)]
    names = {
        file: name for file, (_, name) in zip(files, characters_and_motions(files), strict=True)
    }
    for path in progress(files):
        try:
            motion = read_motion(path).motion
            key = _key(motion.skeleton)
            if key not in bodies:
                bodies[key] = body_features(understand(motion))
            clips.append(clip_of(names[path], to_canonical(motion, bodies[key].rig), bodies[key]))
        except SparkSimError as error:
            notes.append(f"{path}: left out: {why_left_out(path, error)}")
    if not clips:
        raise SkeletonError(
            f"{', '.join(map(str, paths))}: no recording of a humanoid to train on; {notes[0]}"
        )
    return clips, tuple(notes)


def why_left_out(path: Path, error: SparkSimError) -> str:
    """What is wrong with a file, without its path, which stands before it."""
    why = str(error).removeprefix(f"{path}: ").replace(f"{path}:", "line ")
    return why.replace(str(path), path.name)


def clip_of(name: str, canonical: CanonicalMotion, body: BodyFeatures) -> TrainingClip:
    """A motion on `body`'s rig as a clip, in single precision as datasets have it. Raises
    `SkeletonError` without two feet or two frames."""
    rig = canonical.rig
    if len(canonical) < 2:
        raise SkeletonError("holds a single frame; expected a motion")
    canonical = at_frame_time(canonical, FRAME_TIME)
    hips = canonical.hips - np.array([0, 0, canonical.floor_z])
    planted = planted_feet(rig, canonical_positions(canonical), FRAME_TIME)
    if planted.shape[1] != 2:
        raise SkeletonError("has no two feet; pairs for training need them")
    rotations = np.ascontiguousarray(canonical.rotations[:, body.joints], np.float32)
    path = (hips / rig.hip_height).astype(np.float32)
    return TrainingClip(name, body, rotations, path, planted, FRAME_TIME)


def _key(skeleton: Skeleton) -> tuple[object, ...]:
    return (skeleton.names, skeleton.parents.tobytes(), skeleton.offsets.round(5).tobytes())
