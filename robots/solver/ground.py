"""The ground under a robot's soles where its source climbs: as high as the source's, scaled."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from robots.model.morphology import Morphology
from spark.runs import true_runs
from spark.terrain import Terrain
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.distance_field import DistanceField, distance_field
from spark.transfer.footfalls import between_contacts
from spark.transfer.ground import Ground, level_ground
from spark.transfer.treads import Treads

_AROUND = 2.0  # hip heights around the hips' path within which ground is looked at
_SPACING = 0.03  # hip heights from one place to the next at which it is known how far that is


class Climb(NamedTuple):
    """What a source stands on: the `heights` [m] of the ground under each of its feet over time
    (`Treads`), the `ground` all around, and how high [m] its hips are over the floor where it sits
    on something (`seats`), 0 where it does not. Where ground is stated, `relief` [m] is that under
    heel and toe over that under the foot, and `around` the distance from it in the robot's world:
    scaled as the motion is, about the world's origin, and along Z about the floor, which is at 0.
    """

    heights: Float[np.ndarray, "T F"]
    ground: Ground
    seats: Float[np.ndarray, "T"]
    relief: Float[np.ndarray, "T F 2"] | None = None
    around: DistanceField | None = None

    def frames(self, start: int, stop: int) -> "Climb":
        """That of frames `start` to `stop`, exclusive."""
        own = slice(start, stop)
        relief = None if self.relief is None else self.relief[own]
        return self._replace(heights=self.heights[own], seats=self.seats[own], relief=relief)


def climb_of(source: CanonicalMotion, treads: Treads, robot: Morphology) -> Climb:
    """Where a source's feet stand, and so all of it may; and where it sits."""
    seats, ground = np.zeros(len(source)), replace(treads, seats=()).ground(source.floor_z)
    for seat in treads.seats:
        seats[seat.start : seat.stop] = seat.high
    ground = replace(ground, stands=())
    if source.terrain is None:
        return Climb(treads.heights, ground, seats)
    around = _around(source, source.terrain)
    on_robot = around.placed(
        robot.rig.hip_height / source.rig.hip_height, np.array([0.0, 0.0, -source.floor_z])
    )
    ground = replace(ground, around=around)
    return Climb(treads.heights, ground, seats, treads.relief, on_robot)


def _around(source: CanonicalMotion, terrain: Terrain) -> DistanceField:
    """The distance from stated ground, around where a source goes."""
    size = source.rig.hip_height
    low, high = source.hips.min(axis=0) - _AROUND * size, source.hips.max(axis=0) + _AROUND * size
    return distance_field(terrain, low, high, _SPACING * size)


def level_climb(source: CanonicalMotion) -> Climb:
    """A floor and nothing else."""
    heights = np.zeros((len(source), len(source.rig.soles)))
    return Climb(heights, level_ground(source.floor_z), np.zeros(len(source)))


class GroundUnderSoles(NamedTuple):
    """Of each sole over time [m]: the `ground` under it, in swing from that of one place to that of
    the next by as much of its way as it has gone; and the `floor` that it is always over, in swing
    the lower of both."""

    ground: Float[np.ndarray, "T S"]
    floor: Float[np.ndarray, "T S"]


def under_soles(
    ground: Float[np.ndarray, "T S"],
    contacts: Bool[np.ndarray, "T S 2"],
    toes: Float[np.ndarray, "T S 2"],
) -> GroundUnderSoles:
    """As high all through a contact as in its median; `toes` [m] are where the feet go."""
    ground, floor = ground.copy(), np.zeros_like(ground)
    if not ground.any():
        return GroundUnderSoles(ground, floor)
    for s in range(ground.shape[1]):
        stands: Bool[np.ndarray, T] = np.any(contacts[:, s], axis=1)
        for start, stop in true_runs(stands):
            ground[start:stop, s] = np.median(ground[start:stop, s])
        ground[:, s] = between_contacts(ground[:, s, None], stands, toes[:, s])[:, 0]
        floor[:, s] = ground[:, s]
        for start, stop in true_runs(~stands):
            floor[start:stop, s] = ground[max(start - 1, 0) : stop + 1, s].min()
    return GroundUnderSoles(ground, floor)


def climbs(treads: Treads, robot: Morphology, floor_z: float) -> tuple[str, ...]:
    """Notes where the source's feet stand, or it sits, on more than the floor."""
    scale, notes = robot.rig.hip_height / treads.rig.hip_height, []
    if treads.terrain is not None:
        top = float(treads.terrain.vertices[:, 2].max()) - floor_z
        notes.append(
            f"stated ground up to {100 * top:.0f} cm high is scaled by {scale:.3g}, as the motion "
            f"is: up to {100 * scale * top:.0f} cm"
        )
    elif not treads.level and robot.soles:
        notes.append(
            f"feet of the source stand on something up to {100 * treads.top:.0f} cm above its "
            f"floor: the robot's do up to {100 * scale * treads.top:.0f} cm above its own, where "
            "nothing is in its model"
        )
    seats = (
        f"the source sits, with its hips {high} cm above its floor, and its feet can't hold it "
        f"there: the robot's are {scale * high:.0f} cm above its own, and nothing is below them in "
        "its model"
        for high in treads.seat_heights
    )
    return (*notes, *seats)
