"""What is understood of a clip, for `spark-sim inspect`: as data, and as text."""

from typing import Any

import numpy as np

from spark.errors import SkeletonError
from spark.io.convention import Convention
from spark.rotation import quat_angle, quat_identity
from spark.summary import counted
from spark.transfer.in_place import pace_of, way_lacked
from spark.transfer.loops import loop_of
from spark_sim.clips import AnyClip, Clip
from spark_sim.console import columns


def describe(clip: "AnyClip") -> dict[str, Any]:
    """Facts of the file, the motion and the body, ready for JSON. Angles are degrees;
    `treadmill_m_s` is how fast a walk in place would go over the ground.

    A body that is no humanoid has `"body": None` and the reason under `"refused"`.
    """
    motion = clip.motion
    convention = clip.recording.convention if isinstance(clip, Clip) else Convention(1.0, "z")
    facts: dict[str, Any] = {
        "file": clip.name,
        "frames": len(motion),
        "fps": motion.fps,
        "frame_time": motion.frame_time,
        "duration": motion.duration,
        "unit": convention.unit,
        "unit_m": convention.unit_m,
        "up": convention.up,
        "joints": len(motion.skeleton),
        "loop": False,
        "treadmill_m_s": None,
        "body": None,
        "refused": None,
    }
    try:
        rig = clip.rig
    except SkeletonError as error:
        return facts | {
            "refused": str(error.__cause__ or error),
            "notes": list(clip.recording.notes) if isinstance(clip, Clip) else [],
        }
    turned = np.degrees(quat_angle(quat_identity(rig.tpose), rig.tpose))
    roles = rig.roles
    fingers = {j: f"{bone.side} {bone.finger}" for bone, j in rig.fingers.items()}
    joints = [
        {
            "joint": name,
            "role": None if (role := roles.roles[j]) is None else str(role),
            "confidence": round(roles.confidence[j], 3),
            "reason": roles.reasons[j],
            "groups": sorted(map(str, rig.groups[j])),
            "tpose_angle": round(float(turned[j]), 1),
            "finger": fingers.get(j),
            "doubles": rig.skeleton.names[rig.doubles[j]] if j in rig.doubles else None,
            "twists": (
                rig.skeleton.names[rig.twist_bones[j].segment] if j in rig.twist_bones else None
            ),
        }
        for j, name in enumerate(rig.skeleton.names)
    ]
    body = {
        "hip_height": rig.hip_height,
        "root_joint": rig.skeleton.names[rig.root_joint],
        "joints": joints,
    }
    way = way_lacked(clip.canonical)
    of_motion = {
        "loop": loop_of(clip.canonical) is not None,
        "treadmill_m_s": None if way is None else pace_of(way, motion.frame_time),
    }
    return facts | of_motion | {"body": body, "notes": list(clip.notes)}


def text(facts: dict[str, Any]) -> str:
    """`describe`'s facts as lines for a terminal."""
    head = [
        facts["file"],
        f"  {counted(facts['frames'], 'frame')}, {facts['fps']:.6g} fps, "
        f"{facts['duration']:.4g} s, {counted(facts['joints'], 'joint')}",
        f"  unit {facts['unit']} ({100 * facts['unit_m']:.4g} cm), {facts['up'].upper()} up",
    ]
    body = facts["body"]
    if body is None:
        return "\n".join([*head, f"  {facts['refused']}"])
    held = [joint for joint in body["joints"] if joint["role"] is not None]
    fingers: dict[str, list[str]] = {}
    for joint in body["joints"]:
        if joint["finger"] is not None:
            fingers.setdefault(joint["finger"], []).append(joint["joint"])
    others = [
        joint["joint"]
        for joint in body["joints"]
        if all(joint[kind] is None for kind in ("role", "doubles", "twists", "finger"))
    ]
    rows = [("role", "joint", "sure", "rest to T", "parts", "because")]
    rows += [
        (
            joint["role"],
            joint["joint"],
            f"{joint['confidence']:.0%}",
            f"{joint['tpose_angle']:.0f}°",
            ", ".join(joint["groups"]),
            joint["reason"],
        )
        for joint in held
    ]
    goes_on = ["a loop: it goes on at its first frame"] if facts["loop"] else []
    if facts["treadmill_m_s"] is not None:
        goes_on.append(f"walks in place, as on a treadmill at {facts['treadmill_m_s']:.2f} m/s")
    lines = [
        *head,
        *(f"  {what}" for what in goes_on),
        f"  hips {body['hip_height']:.3g} m above the soles; root joint {body['root_joint']}",
        "",
        *columns(rows),
    ]
    for kind, what in (
        ("doubles", "turn with the joint that they double"),
        ("twists", "take their share of a limb's twist or bend"),
    ):
        each = [f"{joint['joint']} ({joint[kind]})" for joint in body["joints"] if joint[kind]]
        if each:
            lines += ["", f"  {what}: {', '.join(each)}"]
    if fingers:
        chains = "; ".join(f"{finger} {', '.join(chain)}" for finger, chain in fingers.items())
        lines += ["", f"  fingers: {chains}"]
    if others:
        lines += ["", f"  follow their parents: {', '.join(others)}"]
    return "\n".join(lines)
