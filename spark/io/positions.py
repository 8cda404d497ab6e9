"""Recordings of positions alone: npy and npz of frames x joints x 3, with names or a known layout.

Rotations are fitted to the positions (`spark.io.position_fit`).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError, FileFormatError, name_list
from spark.io.convention import Convention, axis_of, given_unit, given_up
from spark.io.encoding import encode_new
from spark.io.joint_names import unique_names
from spark.io.position_files import Points, read_points
from spark.io.position_fit import Hints, fit_rotations, fitted
from spark.io.position_layouts import KNOWN, Layout, layouts
from spark.io.position_tree import parents_first, rigid_tree, still
from spark.io.recording import Recording
from spark.io.stance import walked
from spark.io.unit_inference import infer_unit
from spark.io.up_inference import infer_up, standing_axis
from spark.io.upright import above_feet
from spark.kinematics import forward
from spark.motion import Motion
from spark.skeleton import Skeleton

_WITHIN = 0.01  # of the body's height: as far as the fit may miss a joint
_STILL = 0.005  # of the body's height: hips that move less are held in place by the file
_UPSIDE_DOWN = -0.5  # mean direction from the feet to the body, along the up axis

# The axes of hinges in the T-pose: knees and elbows, by the part that bends.
_HINGES = {"knee": (0.0, 1.0, 0.0), "left elbow": (0.0, 0.0, -1.0), "right elbow": (0.0, 0.0, 1.0)}
_FEET = ("foot", "toe", "ankle", "heel")


def read_positions(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> Recording:
    """The recording in a file of joint positions.

    An npy holds frames x joints x 3 (or more: confidences are left out); an npz such an array, and
    maybe `names`, `parents` and `fps`. Unit and up axis are inferred where not given. Raises
    `FileFormatError` where the layout is not known, or the file broken.
    """
    path = Path(path)
    points = read_points(path)
    seen, layout, notes = _joints(points, path)
    return recording_of(seen, layout, notes, path, unit=unit, up=up, rate=fps or points.fps)


def recording_of(
    seen: Motion,
    layout: Layout | None,
    notes: list[str],
    path: Path,
    *,
    unit: str | float | None,
    up: str | None,
    rate: float | None,
) -> Recording:
    """The recording of positions that are `seen` as the joints of a `layout`, in file units and
    axes. Raises `ConventionError` where unit or up axis can't be inferred."""
    if rate is None:
        rate = layout.usual_fps if layout is not None else 30.0
        notes.append(
            f"{rate:g} fps, as is usual: the file says none (--fps, or retarget's --source-fps)"
        )
    try:
        seen, convention = _in_si(seen, layout, 1 / rate, unit, up, notes)
    except ConventionError as error:
        raise ConventionError(f"{path}: {error}") from error
    motion = _fit(seen, layout, 1 / rate, notes)
    bvh = replace(encode_new(motion, unit=convention.unit_m, up=convention.up), path=path)
    return Recording(bvh, motion, convention, tuple(notes))


def _joints(points: Points, path: Path) -> tuple[Motion, Layout | None, list[str]]:
    """The positions as joints of a skeleton that does not turn, in file units and axes."""
    notes = list(points.notes)
    known = layouts(points.values.shape[1])
    if points.names is not None:
        named = {name.lower(): i for i, name in enumerate(points.names)}
        fits = [lay for lay in known if {n.lower() for n in lay.points} == named.keys()]
        if not fits:
            return _of_names(points, notes), None, notes
        order = [named[name.lower()] for name in fits[0].points]
        points = replace(points, values=points.values[:, order])
        known = (fits[0],)
    if not known:
        raise FileFormatError(
            path,
            None,
            f"has {points.values.shape[1]} joints without names; known are {KNOWN}: else add the "
            "array 'names' to an npz",
        )
    layout = min(known, key=lambda lay: _oddness(points.values, lay))
    notes.insert(0, f"positions of {layout.name}'s {len(layout.points)} joints")
    return on_layout(points.values, layout), layout, notes


def on_layout(values: Float[np.ndarray, "T P 3"], layout: Layout) -> Motion:
    """The points of a layout as joints of its skeleton, which do not turn."""
    index = {name: i for i, name in enumerate(layout.points)}
    names = tuple(layout.tree)
    means = [[index[n] for n in layout.means.get(name, (name,))] for name in names]
    joints = np.stack([values[:, mean].mean(axis=1) for mean in means], axis=1)
    order = parents_first([names.index(p) if p else -1 for p in layout.tree.values()])
    parents = [layout.tree[names[j]] for j in order]
    ordered = [names[j] for j in order]
    at = np.array([ordered.index(p) if p else -1 for p in parents])
    return still(joints[:, order], tuple(ordered), at)


def _of_names(points: Points, notes: list[str]) -> Motion:
    """A skeleton for named joints: the parents that are given, or bones that keep their length."""
    assert points.names is not None
    names, renamed = unique_names(list(points.names))
    notes += renamed
    parents = points.parents
    if parents is None:
        parents = rigid_tree(points.values, names)
        notes.append("no parents in the file: bones are where distances keep their length")
    order = parents_first(parents.tolist())
    at = np.argsort(order)
    above = np.array([-1 if parents[j] < 0 else at[parents[j]] for j in order])
    return still(points.values[:, order], tuple(names[j] for j in order), above)


def _oddness(values: Float[np.ndarray, "T J 3"], layout: Layout) -> float:
    """How unlike a body the bones of a layout are: lengths that change, sides that differ."""
    index = {name: i for i, name in enumerate(layout.points)}
    lengths = {}
    for name, parent in layout.tree.items():
        if name in index and parent in index:
            bone = np.linalg.norm(values[:, index[name]] - values[:, index[parent]], axis=-1)
            lengths[name] = (float(bone.mean()), float(bone.std()))
    size = sum(mean for mean, _ in lengths.values()) or 1.0
    odd = sum(std for _, std in lengths.values())
    for name, (mean, _) in lengths.items():
        if "left" in name and (other := name.replace("left", "right")) in lengths:
            odd += abs(mean - lengths[other][0])
    return odd / size


def _in_si(
    seen: Motion,
    layout: Layout | None,
    frame_time: float,
    unit: str | float | None,
    up: str | None,
    notes: list[str],
) -> tuple[Motion, Convention]:
    """The positions in metres, X forward and Z up, the body on its feet; and what was meant."""
    if unit is None:
        unit_m, more = infer_unit(seen)
        notes += more
    else:
        unit_m = given_unit(unit)
    positions, _ = forward(seen)
    down = False
    if up is not None:
        axis = given_up(up)
    elif layout is not None:
        axis, down, why = standing_axis(seen, layout.usual_up)
        notes.append(f"up axis {axis}, {why}")
    else:
        axis, more = infer_up(seen)
        notes += more
        upward = above_feet(seen, positions)[axis_of(axis)]
        down = bool(upward < _UPSIDE_DOWN and axis in ("y", "z"))
    if down:
        notes.append(f"the file's {axis} axis points down, as a camera's does: turned over")
        positions = positions * [1.0, -1.0, -1.0]
    convention = Convention(unit_m, axis)
    skeleton = seen.skeleton
    moved = still(convention.from_file(positions), skeleton.names, skeleton.parents)
    return replace(moved, frame_time=frame_time), convention


def _fit(seen: Motion, layout: Layout | None, frame_time: float, notes: list[str]) -> Motion:
    """The motion with rotations fitted to the positions."""
    positions, _ = forward(seen)
    names, parents = seen.skeleton.names, seen.skeleton.parents
    size = float(np.median(np.ptp(positions, axis=1).max(axis=-1)))
    feet = [j for j, name in enumerate(names) if any(word in name.lower() for word in _FEET)]
    world, offsets = fit_rotations(positions, parents, frame_time, _hints(layout, names))
    offsets[0] = 0.0
    moves = np.arange(len(names)) == 0
    skeleton = Skeleton(names, parents, offsets, moves)
    rotations, translations, stretched = fitted(skeleton, world, positions, _WITHIN * size)
    if stretched.any():
        shown = name_list([names[j] for j in np.flatnonzero(stretched)])
        notes.append(f"bones change their length, so positions are kept of {shown}")
    skeleton = replace(skeleton, translating=moves | stretched)
    motion = Motion(skeleton, frame_time, positions[:, 0], rotations, translations)
    if len(motion) > 1 and feet and np.ptp(positions[:, 0], axis=0).max() < _STILL * size:
        notes.append("the hips never move: they are moved so that the lower foot stands")
        motion = walked(motion, feet, 2)
    notes.append("rotations are fitted to the bones' directions; turns about bones are guesses")
    return motion


def _hints(layout: Layout | None, names: tuple[str, ...]) -> Hints:
    if layout is None:
        return Hints(None, {}, {}, {})
    tpose = np.array([layout.tpose[name] for name in names])
    bends, flexes = {}, {}
    for j, name in enumerate(names):
        place = name.lower()
        side = "left" if "left" in place else "right"
        if place.endswith(("_hip", "upleg")):
            bends[j] = flexes[j] = np.array(_HINGES["knee"])
        elif place.endswith(("_shoulder", "arm")) and "forearm" not in place:
            bends[j] = np.array(_HINGES[f"{side} elbow"])
    lines = {names.index(a): names.index(b) for a, b in layout.hints.items()}
    return Hints(tpose, bends, flexes, lines)
