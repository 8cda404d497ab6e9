"""Near-duplicates: a motion that is there twice, under another name, in other units, at another
frame rate, turned about, or with a little noise."""

import base64
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from spark.kinematics import forward
from spark.motion import Motion
from spark.resample import values_at
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_from_yaw, quat_mul, quat_rotate, yaw_from_quat

MOMENTS = 16  # of a motion, evenly spaced, at which two are compared
SAME = 0.06  # root mean square distance of unit vectors along limbs: 3.4 degrees
SAME_DURATION = 0.03  # relative difference: a few frames more at an end
_PATH_WEIGHT = 0.5  # a hip height of the root's path against a unit vector
_LEVELS = 60  # a number is kept as a byte
_LIMBS = tuple(
    (f"{side}_{upper}", f"{side}_{lower}")
    for side in ("left", "right")
    for upper, lower in (
        ("upper_arm", "forearm"),
        ("forearm", "hand"),
        ("upper_leg", "lower_leg"),
        ("lower_leg", "foot"),
    )
)


def fingerprint(motion: Motion, rig: Rig) -> str:
    """A motion in few bytes, as text: its duration, where its limbs point and how its root travels,
    seen from its first heading. A limb that the body lacks points nowhere."""
    positions, rotations = forward(motion)
    pelvis = quat_mul(rotations[:1, rig.pelvis], quat_conj(rig.tpose[rig.pelvis]))
    level = quat_conj(quat_from_yaw(yaw_from_quat(pelvis)))
    at = np.linspace(0, len(motion) - 1, MOMENTS)
    parts = [np.zeros((MOMENTS, 3)) for _ in _LIMBS]
    for part, limb in zip(parts, _LIMBS, strict=True):
        upper, lower = (rig.roles.joint(Role(name)) for name in limb)
        if upper is not None and lower is not None:
            bone = values_at(positions[:, lower] - positions[:, upper], at)
            part += bone / np.maximum(np.linalg.norm(bone, axis=-1, keepdims=True), 1e-9)
    hips = values_at(positions[:, rig.hips].mean(axis=1), at)
    parts.append(_PATH_WEIGHT * (hips - hips[0]) / rig.hip_height)
    seen = quat_rotate(level, np.stack(parts, axis=1).reshape(-1, 3))
    numbers = np.clip(np.round(seen.ravel() * _LEVELS), -127, 127).astype(np.int8)
    return f"{motion.duration:.3f}:{base64.b64encode(numbers.tobytes()).decode()}"


def near_duplicates(fingerprints: Mapping[str, str]) -> list[list[str]]:
    """The names of motions that are nearly the same, in groups, of their fingerprints."""
    names = sorted(fingerprints)
    if len(names) < 2:
        return []
    durations, vectors = zip(*(_read(fingerprints[name]) for name in names), strict=True)
    lengths = np.array(durations)
    radius = SAME * np.sqrt(MOMENTS * len(_LIMBS))
    pairs = cKDTree(np.stack(vectors)).query_pairs(radius, output_type="ndarray")
    one, other = lengths[pairs[:, 0]], lengths[pairs[:, 1]]
    pairs = pairs[np.abs(one - other) <= SAME_DURATION * np.maximum(one, other)]
    group = list(range(len(names)))

    def first(k: int) -> int:
        while group[k] != k:
            group[k] = k = group[group[k]]
        return k

    for a, b in pairs.tolist():
        low, high = sorted((first(a), first(b)))
        group[high] = low
    groups: dict[int, list[str]] = {}
    for k, name in enumerate(names):
        groups.setdefault(first(k), []).append(name)
    return [members for members in groups.values() if len(members) > 1]


def _read(text: str) -> tuple[float, Float[np.ndarray, "D"]]:
    duration, _, numbers = text.partition(":")
    return float(duration), np.frombuffer(base64.b64decode(numbers), np.int8) / _LEVELS
