"""A motion in few bytes: where its limbs point and how its root travels, four times a second."""

import base64
import zlib
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int8
from scipy.ndimage import gaussian_filter1d

from spark.blocks import in_blocks
from spark.kinematics import forward
from spark.motion import Motion
from spark.resample import values_at
from spark.rig.rig import Rig
from spark.rig.roles import Role

RATE = 4.0  # [1/s] of the samples
LIMBS = tuple(
    (f"{side}_{upper}", f"{side}_{lower}")
    for side in ("left", "right")
    for upper, lower in (
        ("upper_arm", "forearm"),
        ("forearm", "hand"),
        ("upper_leg", "lower_leg"),
        ("lower_leg", "foot"),
    )
)
_SMOOTH = 0.2  # [s] what is faster is left out, so that samples between two samples are known
_VELOCITY = 0.25  # of a unit vector, for a hip height a second
_LEVELS = 120  # a number is kept as a byte
_FORM = "2"  # of the text


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """Smoothed samples of a motion of `duration` [s], as the bytes that a shelf of them can keep in
    memory. `has` tells which limbs the body has."""

    duration: float
    numbers: Int8[np.ndarray, "S 9 3"]

    @property
    def samples(self) -> Float[np.ndarray, "S 9 3"]:
        """Unit vectors along limbs, then the velocity of the hips, in the world."""
        return self.numbers / _LEVELS

    @property
    def has(self) -> Bool[np.ndarray, "9"]:
        """Which of the vectors the body has; the last is the velocity."""
        return (self.numbers != 0).any(axis=(0, 2)) | (np.arange(len(LIMBS) + 1) == len(LIMBS))


def fingerprint(motion: Motion, rig: Rig) -> str:
    """The fingerprint of a motion as text."""
    vectors = in_blocks(lambda block: _vectors(motion, rig, block), len(motion))
    smooth = gaussian_filter1d(vectors, _SMOOTH / motion.frame_time, axis=0, mode="nearest")
    if len(motion) > 1:
        smooth[:, -1] = np.gradient(smooth[:, -1], motion.frame_time, axis=0)
    smooth[:, -1] *= _VELOCITY / rig.hip_height * (len(motion) > 1)
    times = np.arange(int(motion.duration * RATE + 1e-6) + 1) / RATE
    samples = values_at(smooth, times / motion.frame_time)
    numbers = np.clip(np.round(samples * _LEVELS), -127, 127).astype(np.int8)
    steps = np.diff(numbers.reshape(len(numbers), -1), axis=0, prepend=np.int8(0))
    packed = zlib.compress(steps.tobytes(), 9)
    return f"{_FORM}:{motion.duration:.3f}:{base64.b64encode(packed).decode()}"


def read(text: str) -> Fingerprint | None:
    """A fingerprint that was written; None of a text of another form."""
    form, _, rest = text.partition(":")
    if form != _FORM:
        return None
    duration, _, packed = rest.partition(":")
    steps = np.frombuffer(zlib.decompress(base64.b64decode(packed)), np.int8)
    numbers = np.cumsum(steps.reshape(-1, 3 * (len(LIMBS) + 1)), axis=0, dtype=np.int8)
    return Fingerprint(float(duration), numbers.reshape(len(numbers), -1, 3))


def _vectors(motion: Motion, rig: Rig, block: slice) -> Float[np.ndarray, "T 9 3"]:
    """Unit vectors along the limbs, zero for one that the body lacks, and the place of the hips."""
    positions = forward(motion.frames(block.start, block.stop))[0]
    found = np.zeros((len(positions), len(LIMBS) + 1, 3))
    for k, limb in enumerate(LIMBS):
        upper, lower = (rig.roles.joint(Role(name)) for name in limb)
        if upper is not None and lower is not None:
            bone = positions[:, lower] - positions[:, upper]
            found[:, k] = bone / np.maximum(np.linalg.norm(bone, axis=-1, keepdims=True), 1e-9)
    found[:, -1] = positions[:, rig.hips].mean(axis=1)
    return found
