"""When the source touches the ground, and when it flies: scheduled once for a clip.

A heel or toe stands while it is slow and low (`spark.rig.contacts`). Recorded feet creep, so that
this alone leaves gaps in which a walk would hang in the air; there the slowest and lowest of them
stands (`robots.solver.creeping`), unless the body falls freely or lies on something else.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d

from robots.solver.carrying import Points, carrying, once_down
from robots.solver.creeping import creeping
from sim.report.derivatives import derivative
from sim.report.mass import Mass, human_mass
from spark.constants import GRAVITY
from spark.rig.contacts import ADULT_HEIGHT, above, lower_ends, planted_points
from spark.rig.flesh import RADII
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_mul
from spark.runs import true_runs
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.ground import Ground
from spark.transfer.noise import Noise, smoothed

MIN_DURATION = 0.08  # contacts and breaks shorter than this [s] are noise
STAY_REACH = 0.03  # [m, of an adult] along the floor that a point may tremble without a step,
STAY_LIFT = 0.015  # and up from it,
STAY_TIME = 0.4  # [s] for that long
CREEP_TIME = 0.1  # [s] over which the slowest and lowest is told: weight goes over no sooner
FLIGHT_PUSH = 0.35  # [body weights] of push below which nothing holds the body up
TOUCH_HEIGHT = 0.03  # [m, of an adult] between the floor and the flesh of a part that touches,
REST_HEIGHT = 0.05  # and of one that rests: recorded floors are off, and flesh is thick;
WRIST_HEIGHT = 0.04  # more above a palm or a fist
REST_SPEED = 0.2  # [m/s, of an adult] below which a part comes to rest,
UPRIGHT_SHANK = 0.25  # [m, of an adult] from foot to knee, over which no knee is on a step
ROLL_SPEED = 0.4  # and up to which it then stays in place, though its joint rolls over it;
STIR_TIME = 0.12  # [s] for which it may be faster, as long as it touches
_WINDOW = 0.05  # [s] before and after a frame over which accelerations are measured
_TOUCHING = ("hand", "forearm", "upper_arm", "head", "spine", "pelvis", "lower_leg")
MAY_TOUCH = tuple(role for role in Role if role.part in _TOUCHING)  # and the feet


@dataclass(frozen=True, eq=False)
class Schedule:
    """`feet`: whether heel and toe of each of S feet stand. `parts`: whether those of `part_roles`
    touch the ground, `rests`: whether they also stay in place. `flight`: whether the body falls
    freely. `com_acceleration` [m/s²]."""

    feet: Bool[np.ndarray, "T S 2"]
    parts: Bool[np.ndarray, "T B"]
    rests: Bool[np.ndarray, "T B"]
    part_roles: tuple[Role, ...]
    flight: Bool[np.ndarray, "T"]
    com_acceleration: Float[np.ndarray, "T 3"]

    @property
    def hovers(self) -> bool:
        """Whether nothing carries the body in most frames, in which it does not fall either: feet
        slide as on a treadmill, or it swims or climbs."""
        return bool((_nothing_holds(self.feet, self.parts) & ~self.flight).mean() > 0.5)


def schedule(
    source: CanonicalMotion,
    positions: Float[np.ndarray, "T J 3"],
    paths: Float[np.ndarray, "T S 2 3"],
    sides: Sequence[str],
    ground: Ground,
    noise: Noise | None = None,
) -> Schedule:
    """Of a source whose joints are at `positions` and heels and toes at `paths` [m, world], of the
    feet of some `sides`, as over a level floor; feet that it does not have are 0 all over. Other
    parts are over the `ground`. What `noise` its recording had is averaged out of the feet."""
    if noise is not None:
        paths = smoothed(paths, noise.contact_cutoff, source.frame_time)
    rig, frame_time = source.rig, source.frame_time
    mass = human_mass(rig, positions, quat_mul(source.rotations, rig.tpose))
    acceleration = derivative(mass.com, frame_time, 2, _WINDOW)
    flight = np.less(acceleration[:, 2], (FLIGHT_PUSH - 1) * GRAVITY)
    exist = has_feet(paths)
    roles, parts, rests = _touching_parts(source, positions, paths[:, exist], mass, ground)
    stands = np.zeros(paths.shape[:-1], dtype=bool)
    if exist.any():
        own, size = paths[:, exist], rig.standing_height
        slowed = own if noise is None else noise.slowed(own)
        stands[:, exist] = planted_points(slowed, frame_time, size) & lower_ends(own, size)
    feet = _steady(stands, frame_time)
    feet = _with_wobbles(feet, paths, rig.standing_height, frame_time)
    floating = _nothing_holds(feet, parts)
    floating[flight] = False
    if exist.any():
        window = _odd(CREEP_TIME, frame_time)
        creep = creeping(paths[:, exist], rig.standing_height, frame_time, window)
        feet[np.ix_(floating, exist)] |= creep[floating]
    feet = _steady(feet, frame_time) & ~_kneeling(parts, roles, sides)[:, :, None]
    return Schedule(feet, parts, rests, roles, flight, acceleration)


def has_feet(paths: Float[np.ndarray, "T S 2 3"]) -> Bool[np.ndarray, "S"]:
    """Which feet the source has: the others are 0 all over."""
    return np.abs(paths).sum(axis=(0, 2, 3)) > 0


def _with_wobbles(
    feet: Bool[np.ndarray, "T S 2"],
    paths: Float[np.ndarray, "T S 2 3"],
    height: float,
    frame_time: float,
) -> Bool[np.ndarray, "T S 2"]:
    """Points stand on where they are quick but don't leave their place: a foot that trembles, of a
    body that shakes, takes no steps."""
    scale, out = height / ADULT_HEIGHT, feet.copy()
    for s, k in np.ndindex(feet.shape[1:]):
        path = paths[:, s, k]
        for start, stop in true_runs(~feet[:, s, k]):
            if start == 0 or stop == len(feet) or (stop - start) * frame_time > STAY_TIME:
                continue
            away = path[start : stop + 1] - path[start - 1]
            near = np.linalg.norm(away[:, :2], axis=1).max() < STAY_REACH * scale
            out[start:stop, s, k] = near and np.abs(away[:, 2]).max() < STAY_LIFT * scale
    return out


def _nothing_holds(
    feet: Bool[np.ndarray, "T S 2"], parts: Bool[np.ndarray, "T B"]
) -> Bool[np.ndarray, "T"]:
    touching = np.concatenate([feet.reshape(len(feet), -1), parts], axis=1)
    return touching.sum(axis=1) == 0


def _kneeling(
    parts: Bool[np.ndarray, "T B"], roles: Sequence[Role], sides: Sequence[str]
) -> Bool[np.ndarray, "T S"]:
    """On which sides the knee is on the ground: the foot behind it lies, and carries nothing."""
    out = np.zeros((len(parts), len(sides)), dtype=bool)
    for s, side in enumerate(sides):
        knees = [k for k, role in enumerate(roles) if role is Role(f"{side}_lower_leg")]
        out[:, s] = parts[:, knees].any(axis=1)
    return out


def _touching_parts(
    source: CanonicalMotion,
    positions: Float[np.ndarray, "T J 3"],
    feet: Float[np.ndarray, "T F 2 3"],
    mass: Mass,
    ground: Ground,
) -> tuple[tuple[Role, ...], Bool[np.ndarray, "T B"], Bool[np.ndarray, "T B"]]:
    """Whether parts touch the ground: their flesh is near it, or not far and they are slow, or
    carry the body; and whether they rest there."""
    rig, frame_time = source.rig, source.frame_time
    joints = {role: j for role in MAY_TOUCH if (j := touching_joint(rig, role)) is not None}
    scale = rig.standing_height / ADULT_HEIGHT
    flesh = np.array([RADII[role.part] for role in joints]) * rig.standing_height
    paths = positions[:, list(joints.values())]
    over_floor = (paths[..., 2] - source.floor_z - flesh) / scale
    over_floor -= WRIST_HEIGHT * np.array([role.part == "hand" for role in joints])
    under = ground.under(paths)
    for b, role in enumerate(joints):
        foot = rig.roles.joint(Role(f"{role.side}_foot")) if role.part == "lower_leg" else None
        if foot is not None:
            under[:, b] *= paths[:, b, 2] - positions[:, foot, 2] < UPRIGHT_SHANK * scale
    height = over_floor - under / scale
    speed = np.linalg.norm(derivative(paths, frame_time, 1, _WINDOW), axis=-1) / scale
    slow = speed < REST_SPEED
    near = (over_floor < TOUCH_HEIGHT) | ((over_floor < REST_HEIGHT) & slow)
    above_floor = (under > 0) & (height < REST_HEIGHT) & (speed < ROLL_SPEED)
    near |= _runs_with(above_floor, slow)
    carries = carrying(
        mass,
        Points(paths, over_floor * scale),
        _sole_points(feet, rig.standing_height),
        source.floor_z,
        frame_time,
        scale,
    )
    touching = near | carries
    for b in (b for b, role in enumerate(joints) if role.part == "lower_leg"):
        touching[:, b] = near[:, b] | once_down(touching[:, b], height[:, b])
    touches = _steady(touching, frame_time)
    stays = _steady(touches & (speed < ROLL_SPEED), frame_time) & touches
    rests = _with_stirs(_runs_with(stays, slow), round(STIR_TIME / frame_time))
    return tuple(joints), touches, rests & touches


def _sole_points(feet: Float[np.ndarray, "T F 2 3"], height: float) -> Points:
    """Heels and toes, over where they stand."""
    places = feet.reshape(len(feet), -1, 3)
    if not feet.size:
        return Points(places, places[..., 2])
    return Points(places, above(feet, height).reshape(len(feet), -1))


def _runs_with(
    mask: Bool[np.ndarray, "T B"], seed: Bool[np.ndarray, "T B"]
) -> Bool[np.ndarray, "T B"]:
    """Those runs of each column of a mask in which a seed lies."""
    out = np.zeros_like(mask)
    for b in range(mask.shape[1]):
        for start, stop in true_runs(mask[:, b]):
            out[start:stop, b] = seed[start:stop, b].any()
    return out


def _with_stirs(rests: Bool[np.ndarray, "T B"], frames: int) -> Bool[np.ndarray, "T B"]:
    """Parts rest on through breaks of so many frames: each rest has a place of its own, and what
    only stirs would be thrown from one to the next."""
    out = rests.copy()
    for b in range(rests.shape[1]):
        for start, stop in true_runs(rests[:, b], frames):
            out[start:stop, b] = True
    return out


def touching_joint(rig: Rig, role: Role) -> int | None:
    """The joint whose part touches the ground as that role's: of the spine, the topmost."""
    return rig.chest if role is Role.SPINE else rig.roles.joint(role)


def _steady(mask: Bool[np.ndarray, "T *n"], frame_time: float) -> Bool[np.ndarray, "T *n"]:
    """Without flicker: what most of the frames say over `MIN_DURATION`."""
    frames = _odd(MIN_DURATION, frame_time)
    return uniform_filter1d(mask.astype(np.float64), frames, axis=0, mode="nearest") > 0.5


def _odd(seconds: float, frame_time: float) -> int:
    """About so long [frames]: as many before a frame as after. Of an even number one half is no
    majority, and contacts would lose their ends."""
    return 2 * round(seconds / frame_time / 2) + 1
