"""The ground that is there: steps, boxes and slopes, told from where feet stand, and seats.

No recording says what was underfoot. But a foot that is still while the ground pushes the body up
under it (the centre of pressure; Kajita et al. 2003, eq. 3) stands on something, however high it
is. A foot that is held up beside one that stands has no push under it, nor have those of who sits,
lies or stands on the hands.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from spark.constants import GRAVITY
from spark.kinematics import joint_paths
from spark.motion import Motion
from spark.rig.contacts import ADULT_HEIGHT, planted_points
from spark.rig.rig import Rig
from spark.runs import true_runs
from spark.terrain import Terrain
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark.transfer.footfalls import between_contacts, with_ends
from spark.transfer.ground import Ground, Stand, distinct, level_ground
from spark.transfer.hip_sway import center_of_mass
from spark.transfer.pressure import NOISE, acceleration
from spark.transfer.seats import FLESH, Seat, seats_of
from spark.transfer.soles import SAME_HEIGHT, sole_paths, still_feet
from spark.transfer.stated import stated_under

# All lengths [m] are of an adult.
MIN_STEP = 0.12  # from one place to the next, once at least: floors that drift do so more slowly
SAME_PLACE = 0.6
MIN_TIME = 0.1  # [s] that a foot carries the body to stand on something
MIN_PUSH = 0.5  # [body weights] while it does
UNDER_FOOT = 0.15  # from the centre of pressure to the foot, or to the line between both,
BELOW_MASS = 0.35  # and at least from there up to the centre of mass


@dataclass(frozen=True, eq=False)
class Treads:
    """When each of a rig's S feet `stands`, and the `heights` [m] of the ground under it over the
    floor; in swing, between the two places by as much of its way as it has gone. 0 all over where
    the floor is level. `ways` [m, world] are those of the feet, `hips` that of the hips; `seats`
    are what the body sits on. Where a `terrain` [m, world] is stated, `relief` [m] is how much
    higher than that the ground under heel and toe is."""

    rig: Rig
    frame_time: float
    ways: Float[np.ndarray, "T S 2"]
    stands: Bool[np.ndarray, "T S"]
    heights: Float[np.ndarray, "T S"]
    hips: Float[np.ndarray, "T 2"]
    seats: tuple[Seat, ...]
    terrain: Terrain | None = None
    relief: Float[np.ndarray, "T S 2"] | None = None

    @property
    def level(self) -> bool:
        """Whether the feet stand on the floor alone."""
        return not self.heights.any()

    @property
    def top(self) -> float:
        """The highest place [m]."""
        return float(self.heights.max(initial=0.0))

    @property
    def seat_heights(self) -> list[int]:
        """How high the hips are over the floor [cm] on each seat of another height, for notes."""
        return [*dict.fromkeys(round(100 * seat.high) for seat in self.seats)]

    def ground(self, floor_z: float) -> Ground:
        """That under the body, over a floor at `floor_z` [m, world]."""
        if self.terrain is not None:
            return replace(level_ground(floor_z), terrain=self.terrain)
        sides = [sole.side for sole in self.rig.soles]
        ways = dict(zip(sides, self.ways.swapaxes(0, 1), strict=True))
        ground = self.under(self.rig, ways, self.frame_time, floor_z, 1.0)
        below = floor_z - FLESH * self.rig.standing_height
        seats = [
            [*self.hips[seat.start : seat.stop].mean(axis=0), below + seat.high]
            for seat in self.seats
        ]
        return ground.with_tops(seats, self.rig.hip_height)

    def under(
        self,
        rig: Rig,
        ways: Mapping[str, Float[np.ndarray, "t 2"]],
        frame_time: float,
        floor_z: float,
        scale: float,
    ) -> Ground:
        """The ground under the feet of another motion, on `rig`, which on their `ways` [m, world]
        by side should stand when these do, `scale` times as high over its own floor."""
        if self.level:
            return level_ground(floor_z)
        rate, tops, stands = self.frame_time / frame_time, [], []
        for k, sole in enumerate(self.rig.soles):
            way = ways.get(sole.side, np.zeros((0, 2)))
            for start, stop in true_runs(self.stands[:, k]):
                own = slice(round(start * rate), round(stop * rate))
                if not len(way[own]):
                    continue
                z = floor_z + scale * float(np.median(self.heights[start:stop, k]))
                stands.append(Stand(f"{sole.side} foot", own.start, own.stop, z))
                if z > floor_z:
                    tops.append([*way[own].mean(axis=0), z])
        known = distinct(np.array(tops).reshape(-1, 3), rig.hip_height)
        return Ground(floor_z, known, tuple(stands), rig.hip_height)


def treads_of(source: CanonicalMotion) -> Treads:
    """What a motion stands and sits on; the feet are those of `rig.soles`."""
    hips, seats = source.hips[:, :2], seats_of(source)
    if source.terrain is not None:
        ways, held = stated_under(source, source.terrain)
        own = Treads(source.rig, source.frame_time, ways, held.stands, held.heights, hips, seats)
        return replace(own, terrain=source.terrain, relief=held.relief)
    ways, stands, ground = _ground_under(source)
    return Treads(source.rig, source.frame_time, ways, stands, ground, hips, seats)


def _ground_under(
    source: CanonicalMotion,
) -> tuple[Float[np.ndarray, "T S 2"], Bool[np.ndarray, "T S"], Float[np.ndarray, "T S"]]:
    """`ways`, `stands` and `heights` of `Treads`."""
    rig, frame_time = source.rig, source.frame_time
    scale = rig.standing_height / ADULT_HEIGHT
    count, feet = len(source), len(rig.soles)
    stands, ground = np.zeros((count, feet), dtype=bool), np.zeros((count, feet))
    if not feet or count < 2:
        return np.zeros((count, feet, 2)), stands, ground
    lowest, paths = sole_paths(source)
    ways = paths[..., :2].mean(axis=2)
    still = still_feet(paths, rig.standing_height, frame_time)
    runs = [(k, start, stop) for k in range(feet) for start, stop in true_runs(still[:, k])]
    runs.sort(key=lambda run: run[1])
    heights = np.array([np.median(lowest[start:stop, k]) for k, start, stop in runs])
    if not len(runs) or np.ptp(heights) <= MIN_STEP * scale:
        return ways, stands, ground
    places = np.array([ways[start:stop, k].mean(axis=0) for k, start, stop in runs])
    carries = _carry(paths, lowest, still, center_of_mass(source), frame_time, scale)
    sure = [carries[start:stop, k].sum() * frame_time > MIN_TIME for k, start, stop in runs]
    known = np.array(sure, dtype=bool)
    if not (np.abs(np.diff(heights[known])) > MIN_STEP * scale).any():
        return ways, stands, ground
    for i, (k, start, stop) in enumerate(runs):
        beside = known & (np.abs(heights - heights[i]) < SAME_HEIGHT * scale)
        beside &= np.linalg.norm(places - places[i], axis=1) < SAME_PLACE * scale
        on_floor = heights[i] < SAME_HEIGHT * scale
        stands[start:stop, k] = on_floor or beside.any()
        ground[start:stop, k] = 0.0 if on_floor else heights[i]
    levels = np.array([0.0, *heights[known]])
    for k in range(feet):
        told = with_ends(stands[:, k], ground[:, k], lowest[:, k], levels, SAME_HEIGHT * scale)
        ground[:, k] = between_contacts(ground[:, k, None], told, ways[:, k])[:, 0]
    return ways, stands, ground


def feet_by_side(
    rig: Rig, motion: Motion, terrain: Terrain | None = None
) -> dict[str, Bool[np.ndarray, "T"]]:
    """In which frames each foot stands, on the floor or on what is climbed, by side: "left",
    "right"; empty for a body without feet. With a stated `terrain` the floor is at z = 0."""
    source = to_canonical(motion, rig)
    if terrain is not None:
        source = replace(source, floor_z=0.0, terrain=terrain)
    treads = treads_of(source)
    ground = dict(zip((sole.side for sole in rig.soles), treads.heights.T, strict=True))
    roles = [rig.roles.roles[j] for j in rig.contact_joints]
    feet = joint_paths(motion, rig.contact_joints)
    for k, role in enumerate(roles):
        if role is not None and role.side in ground:
            feet[:, k, 2] -= ground[role.side]
    standing = planted_points(feet, motion.frame_time, rig.standing_height)
    return {role.side: standing[:, k] for k, role in enumerate(roles) if role is not None}


def _carry(
    paths: Float[np.ndarray, "T S 2 3"],
    lowest: Float[np.ndarray, "T S"],
    still: Bool[np.ndarray, "T S"],
    com: Float[np.ndarray, "T 3"],
    frame_time: float,
    scale: float,
) -> Bool[np.ndarray, "T S"]:
    """Over which still feet the centre of pressure lies: one foot, the nearest and lowest, or the
    line between two that are as high."""
    smooth = gaussian_filter1d(com, NOISE / frame_time, axis=0, mode="nearest")
    force = acceleration(smooth, frame_time)
    force[:, 2] += GRAVITY
    push = np.maximum(force[:, 2], MIN_PUSH * GRAVITY)
    over = com[:, None, 2] - paths[..., 2].min(axis=2)
    pressure = com[:, None, :2] - (over / push[:, None])[..., None] * force[:, None, :2]
    away = _from_line(pressure, paths[:, :, 0, :2], paths[:, :, 1, :2])
    able = still & (over > BELOW_MASS * scale) & (force[:, None, 2] > MIN_PUSH * GRAVITY)
    cost = np.where(able, away + lowest.clip(0.0), np.inf)
    carries = able & (away < UNDER_FOOT * scale) & (cost == cost.min(axis=1, keepdims=True))
    middles = paths[..., :2].mean(axis=2)
    for one in range(paths.shape[1]):
        for other in range(one):
            both = able[:, one] & able[:, other]
            both &= np.abs(lowest[:, one] - lowest[:, other]) < SAME_HEIGHT * scale
            away = _from_line(pressure[:, one], middles[:, one], middles[:, other])
            carries[:, [one, other]] |= (both & (away < UNDER_FOOT * scale))[:, None]
    return carries


def _from_line(
    point: Float[np.ndarray, "*n 2"],
    start: Float[np.ndarray, "*n 2"],
    end: Float[np.ndarray, "*n 2"],
) -> Float[np.ndarray, "*n"]:
    """How far points are from a line between two others [m]."""
    along = end - start
    length = np.maximum((along**2).sum(axis=-1), 1e-12)
    share = np.clip(((point - start) * along).sum(axis=-1) / length, 0.0, 1.0)
    return np.linalg.norm(point - start - share[..., None] * along, axis=-1)
