"""A library of animations whose answers keep to a law, which recorded pairs of it teach."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.network.features import body_features
from spark.network.recorded import HABITS, BodyTokens, as_recorded
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.training.cuts import TrainingClip
from spark.training.dataset import Performance
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.foot_lock import lock_feet
from tests.helpers.stick import joint, scaled, stick_rig

HIPS_UP, TRAVEL = HABITS.index("hips_up"), HABITS.index("travel")


def body(seed: int) -> Rig:
    """A stick man with other legs, shoulders and feet, in another size."""
    rng = np.random.default_rng(seed)
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    leg, shoulder, foot = rng.uniform(0.9, 1.1), rng.uniform(-0.1, 0.1), rng.uniform(0.8, 1.2)
    for side in ("left", "right"):
        offsets[joint(Role(f"{side}_lower_leg")), 2] *= leg
        offsets[joint(Role(f"{side}_upper_arm")), 2] += shoulder
        offsets[joint(Role(f"{side}_toe"))] *= foot
    return scaled(
        replace(rig, skeleton=replace(rig.skeleton, offsets=offsets)), rng.uniform(0.5, 2)
    )


def habits(tokens: BodyTokens) -> Float[np.ndarray, "6"]:
    """A law that is linear in what there is to see: hips rise and strides grow with the shoulders,
    and hips sink with the feet's length."""
    shoulder, foot = tokens.measures[0], tokens.measures[4]
    scales = np.zeros(len(HABITS))
    scales[TRAVEL], scales[HIPS_UP] = 0.03 * shoulder, 0.01 * shoulder - 0.005 * foot
    return scales


def answered(source: CanonicalMotion, rig: Rig) -> CanonicalMotion:
    """What an animation library with these habits, whose feet stand, makes of a motion."""
    return lock_feet(source, as_recorded(habits, source, transfer(source, rig)))


def performance(name: str, motion: CanonicalMotion) -> Performance:
    own, size = body_features(motion.rig), motion.rig.hip_height
    clip = TrainingClip(
        "stride",
        own,
        motion.rotations[:, own.joints],
        (motion.hips - [0, 0, motion.floor_z]) / size,
        np.zeros((len(motion), 2), bool),
        motion.frame_time,
    )
    return Performance(clip, name, "sc+sm", motion.floor_z)
