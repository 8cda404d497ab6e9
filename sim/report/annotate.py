"""What a report knows of a motion, frame by frame, for a view to draw over the figure."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, UInt8

from sim.report.clip_metrics import ClipMetrics
from sim.report.clip_poses import pose_clip
from sim.report.limits import limited_joint
from sim.report.names import FLAGS, LABELS
from sim.report.palette import CORNER_COLORS
from sim.report.result import Finding
from sim.trajectory import Subject
from sim.view.annotations import Annotations
from sim.view.timeline import Event
from spark.blocks import in_blocks

_STANDS, _SLIDES, _SINKS = range(1, 4)  # states of a corner, in the order of `CORNER_COLORS`


def annotate(clip: ClipMetrics, subject: Subject, findings: Sequence[Finding] = ()) -> Annotations:
    """What `assess` measured of `subject`, frame by frame, and its findings."""
    step = clip.frame_time
    limits = [
        (limit, joint, at_limit)
        for limit in clip.limits
        if (at_limit := limit.at_limit).any()
        and (joint := _joint(subject, limit.joint)) is not None
    ]
    joints = [joint for _, joint, _ in limits]

    def places(block: slice) -> Float[np.ndarray, "T N 3"]:
        poses = pose_clip(subject.picked(block))
        parts = [poses.mass.com[:, None], poses.positions[:, joints], poses.corners]
        return np.concatenate(parts, axis=1, dtype=np.float32)  # an hour of them is kept

    found = in_blocks(places, len(clip))
    corners = found[:, 1 + len(joints) :]
    flags = {LABELS[name]: clip.flags[name] for name in FLAGS}
    flags[LABELS["joint_limit"]] = _any([limit.excess > 0 for limit in clip.limits], len(clip))
    flags[LABELS["self_penetration"]] = clip.self_penetration
    return Annotations(
        frame_time=step,
        corners=corners,
        states=corner_states(clip, corners),
        corner_states=tuple(CORNER_COLORS.items()),
        com=found[:, 0],
        support_height=clip.floor_z + clip.thresholds.contact_height,
        joints=found[:, 1 : 1 + len(joints)],
        joint_names=tuple(limit.joint for limit, _, _ in limits),
        at_limit=np.array([at for _, _, at in limits], dtype=bool).reshape(-1, len(clip)).T,
        flags=flags,
        events=tuple(
            sorted(
                (
                    Event(f.start * step, (f.stop - 1) * step, LABELS[f.measure], f.sentence)
                    for f in findings
                ),
                key=lambda event: event.start,
            )
        ),
    )


def corner_states(
    clip: ClipMetrics, corners: Float[np.ndarray, "T M 3"]
) -> UInt8[np.ndarray, "T M"]:
    """Of each of the soles' corners: 0 in the air, else the place in `CORNER_COLORS`, from 1."""
    heights = clip.ground.heights(corners, clip.corner_feet)
    states = np.zeros(heights.shape, dtype=np.uint8)
    states[heights < clip.thresholds.skate_height] = _STANDS
    states[clip.corner_skates] = _SLIDES
    states[heights < -clip.thresholds.penetration] = _SINKS
    return states


def _any(masks: list[Bool[np.ndarray, "T E"]], frames: int) -> Bool[np.ndarray, "T"]:
    return np.any([mask.any(axis=1) for mask in masks] or [np.zeros(frames, bool)], axis=0)


def _joint(subject: Subject, name: str) -> int | None:
    """The rig's joint where a joint with limits is; of a model, the one whose part carries it."""
    if subject.body is None:
        return limited_joint(subject.rig, name)
    model, names = subject.body.model, subject.rig.skeleton.names
    known = {model.joint(j).name: int(model.jnt_bodyid[j]) for j in range(model.njnt)}
    body = known.get(name, 0)
    while body > 0 and model.body(body).name not in names:
        body = int(model.body_parentid[body])
    return names.index(model.body(body).name) if body > 0 else None
