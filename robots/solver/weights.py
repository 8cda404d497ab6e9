"""The weights and limits of the solver's residuals, each with its unit and its reason.

The cost is half the sum of squared residuals. These have no unit: angles [rad] are weighed in
1/rad, lengths [m] in 1/m, all against the direction of a limb. Streams weigh the same. Where the
unit is 1/m, it is that of a robot of `TUNED_HIP_HEIGHT`: see `per_metre`.
"""

import numpy as np

from robots.model.morphology import Morphology

TUNED_HIP_HEIGHT = 0.69  # [m] of Ember, and 2 % more than the G1's: on these the weights were found


def per_metre(robot: Morphology) -> float:
    """By what weights per metre are multiplied, and lengths beside them divided, of a robot: a
    centimetre of a small one is as much of a limb's direction as several of a large one, so that
    the same pose costs the same in any size."""
    return TUNED_HIP_HEIGHT / robot.rig.hip_height


W_LIMB_DIRECTION = 2.0  # [1/rad] of upper and lower arms and legs: what a pose looks like
W_ROTATION = {  # [1/rad] of a part by its role; low where the directions of limbs say enough,
    "pelvis": 5.5,  # higher where they say nothing: the trunk, above all where it heads,
    "chest": 0.8,
    "head": 0.5,  # what looks somewhere,
    "neck": 0.1,
    "hand": 0.25,  # light, so that arms that are in each other find a way out,
    "foot": 1.0,  # and what stands on the floor, as a limb's direction by its length
    "spine": 0.1,
    "clavicle": 0.2,
}
W_PALM = 0.8  # [1/rad] more of a hand that lies on the ground, where one that turns slides; and of
# all hands in the last steps: where a wrist's axes lie apart, its turns would aim the forearm
W_OTHER_ROTATION = 0.08  # [1/rad] of the rest: the twist of limbs
W_HIPS_POSITION = np.array([6.0, 6.0, 6.0])  # [1/m] of their path: 1 cm is 2 degrees of a limb
W_COM_ACCELERATION = 0.42  # [s²/m] of the planned centre of mass: 1 m/s² is 12 degrees of a limb
W_HOLD = np.array(
    [22.0, 22.0, 18.0]
)  # [1/m] of a point held, as a standing sole's: 1 cm is 6 degrees
W_FLOOR = 80.0  # [1/m] of a sole's point, or another part, in the floor: four times a foothold's
FLOOR_ROUNDING = 0.004  # [m] over which that sets in
W_LIMIT = 8.0  # [1/rad] of a hinge in the margin of its limit
LIMIT_MARGIN = np.radians(2.0)
W_FOLLOW = 100.0  # [1/rad] of a joint from where its leader takes it: the file allows nothing else
W_HANDS = 20.0  # [1/m] of the offset between hands that touch; falls with their distance over
HANDS_RANGE = 0.12  # [m] as exp(-(distance / range)²)
W_COLLISION = 75.0  # [1/m] of the depth of parts in each other: as firm as the floor
W_LEG_COLLISION = 90.0  # [1/m] between legs, where footholds pull the other way
W_TPOSE = 0.02  # [1/rad] of hinges that nothing else asks for: they stay as in the T-pose
W_REGULAR = 1e-3  # [1/rad, 1/m] of a step in any dof: keeps the normal equations regular
SMOOTH_CUTOFF = 3.3  # [Hz] above which a limb's motion fades: accelerations weigh 1 / (2 pi f)²
LEG_SHARE = 0.8  # of that weight for hinges of the legs: feet start and stop within 0.1 s
AVOIDANCE_CUTOFF = 2.2  # [Hz] above which the change fades by which a limb gives way to another
JERK_SHARE = 0.5  # of the source's limb: up to that a strike may be jerkier, as the other bar is
MAX_JERK = 430.0  # [rad/s³], RMS, above which a hinge is smoothed more: the bar is 400 in the mean
MAX_HINGE_SPEED = 12.0  # [rad/s] above which a hinge is held back; the bar is 15
W_OVERSPEED = 0.8  # [s/rad] of the speed beyond
