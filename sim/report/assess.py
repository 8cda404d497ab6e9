"""Assess a motion: how plausible it is, and how it differs from the motion it was made from."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from sim.report.clip_metrics import ClipMetrics
from sim.report.contact_timing import Discord, Standing, discord_of, standing_beside
from sim.report.course import Course, course_of
from sim.report.fall import fall_notes
from sim.report.findings import findings_of
from sim.report.findings_beside import Beside
from sim.report.floor import over_level
from sim.report.grounds import ground_of, grounds_beside
from sim.report.hovers import hovers_of
from sim.report.in_place import as_it_travels, in_place_notes
from sim.report.limbs import limbs_of
from sim.report.loop_end import loop_notes
from sim.report.measures import Drift, floor_height, root_drift
from sim.report.pace import other_rate, pace_notes
from sim.report.pose_error import PoseError, pose_error
from sim.report.report import Report
from sim.report.slides import slides_of
from sim.report.source_floor import floor_from_source, without_tremble
from sim.report.stretches import measure_clip
from sim.report.stutter import stutter_notes
from sim.report.swing import swing_of
from sim.report.thresholds import PLAUSIBILITY
from sim.report.tremble import tremble_beside
from sim.report.truth import Accuracy, accuracy
from sim.self_contact import may_touch_itself
from sim.trajectory import Subject
from spark.errors import SkeletonError
from spark.motion import Motion
from spark.resample import values_at
from spark.transfer.canonical import to_canonical
from spark.transfer.leg_fit import travel_scale


def assess(
    subject: Subject, *, source: Subject | None = None, truth: Motion | None = None
) -> Report:
    """The plausibility report of a motion, and its difference to `source` where that is given.

    Masses, shapes, soles and joint limits are those of the subject's model, or a human's on the
    rig's bones where it has none. `truth` is what the motion should have been.

    Ground that a motion states is its ground, over a floor at z = 0, and that of its source, scaled
    back (`sim.report.stated`). The floor of a model is at z = 0, as in its simulator. Else it is
    the source's (the 5th percentile of its lowest sole point), scaled by the hip heights' ratio, or
    under soles that are as thick as shoes are (`sim.report.source_floor`); without a source it is
    the motion's own, and a motion that floats or sinks as a whole can't be told. The source is
    compared at the same times; its frame rate may be another. One that walks in place is compared
    as it travels where the motion does (`sim.report.in_place`).
    Raises SkeletonError for a body without feet, for a clip without frames, and for a truth that is
    on another skeleton or has other frames.
    """
    course = _course("the motion", subject)
    known = None if truth is None else accuracy(subject.motion, truth, subject.rig)
    if source is None:
        return _alone(course, known)
    return _beside(course, _course("the source", source), known)


def _alone(course: Course, known: Accuracy | None) -> Report:
    subject, (ground, notes) = course.subject, ground_of(course)
    clip, notes = measure_clip(subject, ground), _about_model(course) + notes
    notes += in_place_notes(course)
    notes += stutter_notes(course.motion, "the motion") + fall_notes(subject, clip, "the motion")
    tremble = tremble_beside(subject)
    return Report(clip, None, None, None, findings_of(clip, tremble), notes, tremble, truth=known)


def _beside(course: Course, source_course: Course, known: Accuracy | None) -> Report:
    subject, motion, rig = course.subject, course.motion, course.rig
    source_course, travels = as_it_travels(source_course, course)
    source = source_course.subject
    quiet, source_floor, trembles = without_tremble(source_course)
    floor, notes = 0.0, _about_model(course)
    if subject.body is None:
        quiet_course = source_course if quiet is source else course_of(quiet)
        floor, notes = floor_from_source(course, quiet_course, source_floor)
    notes += travels + trembles
    canonical = to_canonical(quiet.motion, quiet.rig)
    grounds = grounds_beside(
        course, source_course, canonical, floor, source_floor, trembles=quiet is not source
    )
    source_clip = measure_clip(source, grounds.source)
    followed = source_clip if quiet is source else measure_clip(quiet, grounds.source)
    times = np.arange(len(course)) * motion.frame_time
    scale = rig.hip_height / source.rig.hip_height
    swung = followed
    if grounds.lost_slope is not None:
        swung = over_level(followed, source_course, grounds.lost_slope, source_floor)
    clip = _beyond_source(measure_clip(subject, grounds.own), source_clip, times, scale)
    travel = scale if subject.body is not None else travel_scale(source.rig, rig)
    standing = standing_beside(clip, followed, times)
    notes += grounds.notes
    notes += pace_notes(motion, source.motion) + loop_notes(subject, canonical)
    notes += stutter_notes(motion, "the motion") + stutter_notes(source.motion, "the source")
    notes += fall_notes(source, source_clip, "the source")
    pose = pose_error(subject, source, times)
    tremble = tremble_beside(subject, source, times)
    beside = Beside(
        drift=_drift(course, source_course, times, travel),
        swing=swing_of(clip, swung, times, scale),
        limbs=limbs_of(clip, followed, times, scale),
        pose=pose,
        discord=_discord(subject, source, times, standing, pose),
        slides=slides_of(course, source_course, clip, standing, times, scale),
        hovers=hovers_of(clip, followed, standing, times, scale),
        thrown=scale * source_clip.base_acceleration_p99,
        hover=scale * source_clip.hover,
    )
    return Report(
        clip,
        source_clip,
        beside.drift,
        standing.match,
        findings_of(clip, tremble, beside),
        notes,
        tremble,
        truth=known,
        swing=beside.swing,
        limbs=beside.limbs,
        pose=pose,
        scale=scale,
    )


def _course(name: str, subject: Subject) -> Course:
    if not len(subject.motion):
        raise SkeletonError(f"{name} has no frames: nothing to assess")
    return course_of(subject)


def _about_model(course: Course) -> tuple[str, ...]:
    """Notes where a model has nothing that collides, and where its floor seems to be elsewhere."""
    body, notes = course.subject.body, []
    if body is None:
        return ()
    if not may_touch_itself(body.model, body.root):
        notes.append("no two of the model's shapes may collide: self-penetration is not measured")
    height = floor_height(course.lowest[:, 2])
    stated = course.subject.terrain is not None
    if not stated and abs(height) > PLAUSIBILITY.scaled(course.rig.hip_height).penetration:
        notes.append(
            f"the model's floor is at z = 0; the clip's own (the 5th percentile of its lowest sole "
            f"point) is {100 * abs(height):.1f} cm {'above' if height > 0 else 'below'} that"
        )
    return tuple(notes)


def _beyond_source(
    clip: ClipMetrics, source: ClipMetrics, times: Float[np.ndarray, "T"], scale: float
) -> ClipMetrics:
    """Self-penetration only counts as far as it goes beyond the source's own."""
    theirs = values_at(source.self_depth, times / source.frame_time) * scale
    column = {pair: k for k, pair in enumerate(source.self_pairs)}
    known = [k for k, pair in enumerate(clip.self_pairs) if pair in column]
    depth = clip.self_depth.copy()
    depth[:, known] -= theirs[:, [column[clip.self_pairs[k]] for k in known]]
    return replace(clip, self_depth=np.maximum(depth, 0.0))


def _discord(
    subject: Subject,
    source: Subject,
    times: Float[np.ndarray, "T"],
    standing: Standing,
    pose: PoseError | None,
) -> Discord | None:
    """Whether the feet stand at other times than the source's, and what may be why."""

    def pose_at_lag(lag: float) -> float | None:
        earlier = pose_error(subject, source, np.clip(times - lag, 0.0, source.motion.duration))
        return None if earlier is None else earlier.mean

    same_rate = other_rate(subject.motion, source.motion) is None
    question = "is it another motion?" if same_rate else "is its rate right?"
    return discord_of(standing, None if pose is None else pose.mean, pose_at_lag, question)


def _drift(course: Course, source: Course, times: Float[np.ndarray, "T"], scale: float) -> Drift:
    at = times / source.motion.frame_time
    return root_drift(
        course.hips,
        course.heading,
        values_at(source.hips, at),
        values_at(source.heading, at),
        scale,
        course.subject.motion.frame_time,
    )
