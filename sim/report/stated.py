"""The ground that is stated under a motion, and under the source that it was made from."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sim.report.course import Course
from sim.report.measures import floor_height
from spark.rig.contacts import ADULT_HEIGHT
from spark.terrain import Terrain
from spark.transfer.canonical import to_canonical
from spark.transfer.ground import Ground, level_ground
from spark.transfer.soles import sole_paths, still_feet
from spark.transfer.stated import footholds

_SUNK = 0.15  # [m, of an adult] in it: a foot that is deeper is not where it was
_FITS = 0.5  # of the time that its feet are still they are on ground that is a source's own


class Stated(NamedTuple):
    """That of a motion; that of its source, where it is there, too; and notes."""

    own: Ground
    source: Ground | None
    notes: tuple[str, ...]


def stated_ground(
    course: Course, source: Course | None = None, scale: float = 1.0
) -> Stated | None:
    """The ground that a motion states, or else the one of its source, times `scale`; None where
    neither does. A source that states none was on the motion's, scaled back, if its feet stand
    there: as high as they do in the median, as a recording's floor is where its feet are."""
    own = course.subject.terrain
    theirs = None if source is None else source.subject.terrain
    if own is None:
        if theirs is None:
            return None
        own = theirs.placed(scale, np.zeros(3))
    ground = replace(level_ground(0.0), terrain=own)
    notes = (
        f"the ground is stated, up to {100 * own.vertices[:, 2].max():.0f} cm high: all heights "
        "are over it, and what is in it counts as penetration",
    )
    if source is None:
        return Stated(ground, None, notes)
    if theirs is not None:
        return Stated(ground, replace(level_ground(0.0), terrain=theirs), notes)
    under = _under_source(source, own.placed(1.0 / scale, np.zeros(3)))
    if under is None:
        where = (
            "the source is not on it, scaled to its size: it is judged on what its own feet tell"
        )
    else:
        where = (
            f"the source is on it scaled by {1 / scale:.3g}, over a floor at "
            f"z = {under.floor_z:.2f} m, where its feet stand in the median"
        )
    return Stated(ground, under, (*notes, where))


def _under_source(source: Course, terrain: Terrain) -> Ground | None:
    """A terrain over the floor of a source; None where its feet don't stand on it. The floor is
    near z = 0 or near its lowest points, and there as high as its feet stand."""
    canonical, rig = to_canonical(source.motion, source.rig), source.rig
    size = rig.standing_height / ADULT_HEIGHT
    lowest, paths = sole_paths(canonical)
    lowest = lowest + canonical.floor_z
    still = still_feet(paths, rig.standing_height, canonical.frame_time)
    found = []
    for floor_z in (0.0, floor_height(source.lowest[:, 2])):
        placed = terrain.placed(1.0, np.array([0.0, 0.0, floor_z]))
        held = footholds(placed, floor_z, paths, lowest, still, size)
        sunk = placed.way_up(paths.mean(axis=2).reshape(-1, 3)).reshape(still.shape)
        stands = held.stands & (sunk < _SUNK * size)
        over = float(np.median((lowest - held.lowest)[stands])) if stands.any() else 0.0
        found.append((int(stands.sum()), floor_z + over))
    most, floor_z = max(found, key=lambda each: each[0])
    if most < _FITS * still.sum() or not still.any():
        return None
    shifted = terrain.placed(1.0, np.array([0.0, 0.0, floor_z]))
    return replace(level_ground(floor_z), terrain=shifted)
