"""Which axis of a file points up, where the file does not say it.

It is read off the body in the frames of the motion, since rest poses often stand along another
axis: a human is above its feet.
"""

import numpy as np
from jaxtyping import Float

from spark.io.convention import CLOSE, UPS, Up, points_down
from spark.io.upright import above_feet, is_built_upright, is_foot, walked_across
from spark.kinematics import end_positions, forward
from spark.motion import Motion

# The mean direction from feet to body this near to an axis tells that axis.
CLEARLY = 0.75
_STEADIER = 1.5  # a floor along an axis moves no more than this many times that of another
_SAMPLES = 32  # frames that are looked at for the axis along which a body stands at all
_STEADY = 0.01  # of the body's height: a floor that moves less is steady

_STEADY_FLOOR = 0.05  # [heights] between the quartiles; a floor moves less, a body's side more
# Who goes this far [heights] across an axis, above the feet along it by this much, walks upright.
_WALK, _WALKS_ABOVE_FEET = 0.3, 0.6
_BUILT = 0.9  # the direction from feet to body at rest, of a body that was built along an axis

# Of the weight of that direction where no name says foot. Hind legs carry a trunk ahead of them.
_BY_BUILD = 0.5


def infer_up(motion: Motion) -> tuple[Up, tuple[str, ...]]:
    """The up axis of `motion`, which is in file axes, and the notes on it.

    Weighs where the body is above its feet, in the frames and, unless it walks, at rest, where a
    floor lies at zero, and how common each axis is.
    """
    skeleton = motion.skeleton
    positions, world = forward(motion)
    rest = skeleton.rest_positions[None]
    points = np.concatenate([positions, end_positions(skeleton, positions, world)], axis=1)
    size = max(float(np.max(np.median(np.ptp(points, axis=1), axis=0))), 1e-300)
    floors = np.concatenate([points.min(axis=1), points.max(axis=1)], axis=1) / size
    low, floor, high = np.percentile(floors, [25, 50, 75], axis=0)

    standing, resting = (_both_ways(above_feet(motion, each)) for each in (positions, rest))
    steady = high - low < _STEADY_FLOOR if standing.any() else np.full(6, True)  # all there is
    far = np.tile(walked_across(motion, positions, world) > _WALK * size, 2)
    # Who walks stands, however the rest pose is built. Who lies still may be told by it alone.
    walks = bool(np.any(far & steady & (standing > _WALKS_ABOVE_FEET)))
    built = is_built_upright(skeleton, resting[:3]) and not walks
    named = any(map(is_foot, skeleton.names))
    # Log-probabilities, of axes that point up and of those that point down. X-up files hardly
    # exist; bodies that lie down and odd rest poses do, but seldom straight along an axis all the
    # time: hence the cubes. Some stand on their heads.
    chances = np.array([-4.0, 0.0, -1.0, -7.0, -3.0, -4.0])
    seen = np.where(standing > 0, 5.0, -2.0) * standing**3 + 2.5 * built * resting**3
    seen[3:] *= standing[3:] > 0  # rest poses alone turn nothing over
    if built:  # along an axis, and not as a camera sees it: then a body along another one lies
        seen[3:] -= 3.0 * (resting.max() > _BUILT) * (resting[3:] < _BUILT)
    chances += seen if named else _BY_BUILD * seen
    chances += 2.0 * ((np.abs(floor) < 0.03) & steady)
    best, second = np.argsort(-chances)[:2].tolist()
    up = UPS[best]
    notes = [f"up axis {up}, along which the body stands"]
    if not named:
        how = "a guess by the body's build" if standing.any() else "a guess"
        notes = [f"up axis {up}, {how}: no joint is named as a foot; check, and give --up"]
    elif chances[best] - chances[second] < CLOSE:
        notes = [f"up axis {up}, a guess: {UPS[second]} is nearly as likely; check, and give --up"]
    elif standing[best] < -0.5:
        notes.append(f"the body is upside down along {up}; check, and give --up")
    if points_down(up):
        notes.append(f"the file's {up[1:]} axis points down, as a camera's does: turned over")
    return up, tuple(notes)


def _both_ways(up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "6"]:
    return np.concatenate([up, -up])


def standing_axis(motion: Motion, usual: Up) -> tuple[Up, bool, str]:
    """The axis along which the body stands, whether it points down, and why.

    For a kind of file that has `usual` up as a rule: that axis, unless the body clearly stands
    along another one, on a floor as steady. A body that crawls along x makes no file with x up.
    """
    positions, _ = forward(motion)
    standing = above_feet(motion, positions)
    best = int(np.argmax(np.abs(standing)))
    own = UPS.index(usual)
    if best == own or abs(standing[best]) < CLEARLY:
        down = bool(standing[own] < -CLEARLY and own)  # a body is turned over about x
        return usual, down, "as is usual in such files"
    low = positions.min(axis=1) if standing[best] > 0 else -positions.max(axis=1)
    size = float(np.median(np.ptp(positions, axis=1).max(axis=-1)))
    if np.std(low[:, best]) > _STEADIER * np.std(low[:, own]) + _STEADY * size:
        return usual, False, "as is usual in such files"
    return UPS[best], bool(standing[best] < 0 and best), "along which the body stands"


def stands_along(motion: Motion) -> Up | None:
    """The axis of the file along which the body clearly stands, in its motion and at rest."""
    some = motion.thinned(_SAMPLES)
    rest = some.skeleton.rest_positions[None]
    standing = [above_feet(some, places) for places in (forward(some)[0], rest)]
    both = np.concatenate([np.minimum(*standing), np.minimum(*-np.array(standing))])
    return UPS[int(np.argmax(both))] if both.max() > CLEARLY else None
