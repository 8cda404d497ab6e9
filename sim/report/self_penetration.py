"""Self-penetration: capsules along the bones, and how deep non-adjacent ones are in each other."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sim.report.clip_poses import ClipPoses
from spark.rig.flesh import RADII
from spark.rig.roles import Role
from spark.rotation import quat_rotate

# Fractions of the standing height: from the head's joint to the head's centre, from the wrist to
# the middle of the palm.
_HEAD_CENTER, _PALM_CENTER = 0.055, 0.05
# Where the capsules of trunk, thigh and hips begin, as fractions of their bones from the hip
# joints, at which flesh overlaps.
_TRUNK_START, _THIGH_START, _HIPS_START = 0.35, 0.3, 0.2

# Pairs of parts that touch in everyday poses: they do not count.
_NEIGHBOURS = {
    frozenset(pair)
    for side in ("left", "right")
    for pair in (
        ("chest", f"{side} upper arm"),
        (f"{side} upper arm", f"{side} forearm"),
        (f"{side} forearm", f"{side} hand"),
        (f"{side} upper arm", f"{side} hand"),
        (f"{side} upper arm", "head"),
        ("hips", f"{side} upper leg"),
        ("chest", f"{side} upper leg"),
        (f"{side} upper leg", f"{side} lower leg"),
        (f"{side} lower leg", f"{side} foot"),
    )
} | {frozenset(pair) for pair in (("chest", "head"), ("chest", "hips"))}


@dataclass(frozen=True, eq=False)
class Capsules:
    """Body parts over time: the ends [m, world] of each one's axis, and its radius [m]."""

    names: tuple[str, ...]
    ends: Float[np.ndarray, "T C 2 3"]
    radii: Float[np.ndarray, "C"]


def capsules(poses: ClipPoses) -> Capsules:
    """The parts the rig has: chest, hips, head, and three for each limb."""
    roles, height = poses.rig.roles, poses.rig.standing_height
    place = {
        role: poses.positions[:, joints[-1]] for role in Role if (joints := roles.joints(role))
    }
    parts: dict[str, tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 3"], str]] = {}
    top = place.get(Role.NECK, place.get(Role.SPINE))
    if top is not None:
        parts["chest"] = (poses.hips + _TRUNK_START * (top - poses.hips), top, "spine")
    if (head := roles.joint(Role.HEAD)) is not None:
        up = np.array([0.0, 0.0, _HEAD_CENTER * height])
        middle = place[Role.HEAD] + quat_rotate(poses.since_tpose[:, head], up)
        parts["head"] = (middle, middle, "head")
    for side in ("left", "right"):
        chains = (("upper_arm", "forearm", "hand"), ("upper_leg", "lower_leg", "foot", "toe"))
        for chain in chains:
            for part, below in pairwise(chain):
                start, stop = (place.get(Role(f"{side}_{name}")) for name in (part, below))
                if start is None or stop is None:
                    continue
                if part == "upper_leg":
                    start = start + _THIGH_START * (stop - start)
                parts[f"{side} {part.replace('_', ' ')}"] = (start, stop, part)
        hand, forearm = place.get(Role(f"{side}_hand")), place.get(Role(f"{side}_forearm"))
        if hand is not None and forearm is not None:
            # In the T-pose the hands carry on the arms.
            along = np.array([0.0, _PALM_CENTER * height * (1 if side == "left" else -1), 0.0])
            turn = poses.since_tpose[:, roles.require(Role(f"{side}_hand"))]
            parts[f"{side} hand"] = (hand, hand + quat_rotate(turn, along), "hand")
    if len(poses.rig.hips) == 2:
        left, right = (poses.positions[:, j] for j in poses.rig.hips)
        inwards = _HIPS_START * (right - left)
        parts["hips"] = (left + inwards, right - inwards, "pelvis")
    return Capsules(
        tuple(parts),
        np.stack([np.stack(part[:2], axis=1) for part in parts.values()], axis=1),
        height * np.array([RADII[kind] for _, _, kind in parts.values()]),
    )


def self_penetration(
    body: Capsules,
) -> tuple[tuple[tuple[str, str], ...], Float[np.ndarray, "T K"]]:
    """The pairs of parts that are no neighbours and in each other in some frame, and how deep [m];
    0 apart."""
    names = body.names
    pairs = [
        (a, b)
        for a in range(len(names))
        for b in range(a + 1, len(names))
        if frozenset((names[a], names[b])) not in _NEIGHBOURS
    ]
    first, second = [a for a, _ in pairs], [b for _, b in pairs]
    gap = segment_distance(body.ends[:, first], body.ends[:, second])
    depth = np.maximum(body.radii[first] + body.radii[second] - gap, 0.0)
    meet = np.flatnonzero(depth.any(axis=0))
    return tuple((names[a], names[b]) for a, b in (pairs[k] for k in meet)), depth[:, meet]


def segment_distance(
    one: Float[np.ndarray, "*n 2 3"], other: Float[np.ndarray, "*n 2 3"]
) -> Float[np.ndarray, "*n"]:
    """The least distance [m] of two segments (Ericson, "Real-Time Collision Detection", 5.1.9).

    A segment may be a point.
    """
    d1, d2 = one[..., 1, :] - one[..., 0, :], other[..., 1, :] - other[..., 0, :]
    r = one[..., 0, :] - other[..., 0, :]
    a, e, b = _dot(d1, d1), _dot(d2, d2), _dot(d1, d2)
    c, f = _dot(d1, r), _dot(d2, r)
    tiny = 1e-12
    parallel = a * e - b * b
    s = np.clip(np.where(parallel > tiny, (b * f - c * e) / np.maximum(parallel, tiny), 0.0), 0, 1)
    t = np.clip((b * s + f) / np.maximum(e, tiny), 0, 1)
    s = np.clip((b * t - c) / np.maximum(a, tiny), 0, 1)
    closest = r + s[..., None] * d1 - t[..., None] * d2
    return np.linalg.norm(closest, axis=-1)


def _dot(u: Float[np.ndarray, "*n 3"], v: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
    return np.einsum("...x,...x->...", u, v)
