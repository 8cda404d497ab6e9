"""A motion onto a character or a robot, from clip to clip: what `spark_sim.retarget` does."""

from dataclasses import replace
from pathlib import Path

from spark.io.convention import Convention
from spark.io.encoding import encode
from spark.motion import Motion
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical, to_canonical
from spark.transfer.hand_touch import lost_touches, with_touches
from spark.transfer.in_place import belt_note, way_taken_out
from spark.transfer.leg_fit import travel_scale
from spark.transfer.loops import continued
from spark.transfer.noise import without_noise
from spark.transfer.refine import grounded, refined
from spark.transfer.root_motion import with_root_motion
from spark.transfer.stated import on_terrain
from spark.transfer.twists import spread_twists
from spark_sim.clips import AnyClip, Clip, RobotClip
from spark_sim.grounds import read_ground

COPIED = "each pose is copied to the robot's hinges: feet are not held, parts may collide"
"""What is to know of a motion that was copied to a robot, and not solved for."""


def onto_character(
    source: AnyClip,
    target: Clip,
    *,
    fitted: bool,
    checkpoint: Path | None,
    refine: bool,
    keep_touches: bool,
) -> Clip:
    """The motion of `source` on a character. Where it is not `fitted`, rotations alone are copied,
    as a baseline; `checkpoint` is the network to ask instead of the one that ships."""
    canonical, noise = source.canonical, None
    notes: tuple[str, ...] = ()
    own, way = slice(None), None
    if refine:
        canonical, own = continued(canonical)
        canonical, noise, notes = without_noise(canonical)
        way = way_taken_out(canonical)
    if way is not None:
        canonical = replace(canonical, hips=canonical.hips + way)
    if fitted:
        from spark.network.fill_in import filled_in

        moved = filled_in(canonical, target.canonical, checkpoint)
    else:
        moved = transfer(canonical, target.rig)
    if refine:
        finish = refined if fitted else grounded
        moved = finish(canonical, moved, noise)
        touching = with_touches(canonical, moved) if fitted else moved
        if keep_touches:
            moved = touching
        elif touching is not moved:
            notes += lost_touches(moved.picked(own), touching.picked(own))
        moved = moved.picked(own)
    travel = _travel(source, target, fitted=fitted)
    if way is not None:
        moved = replace(moved, hips=moved.hips - travel * way[own])
        notes += (belt_note(way[own], source.frame_time, travel),)
    moved = spread_twists(canonical.rig, moved)
    motion, carried = _carried(from_canonical(moved), source, target, travel)
    bvh, written = encode(motion, target.recording)
    notes += (*moved.notes, *carried, *written)
    recording = replace(target.recording, bvh=bvh, motion=motion, notes=notes)
    # The rig is given: what is known of a body does not depend on the motion that it makes.
    return Clip(recording, f"{source.name} on {target.name}", target.roles, target.rig, target.path)


def onto_robot(
    source: AnyClip, target: RobotClip, *, solved: bool, terrain: Path | None = None
) -> RobotClip:
    """The motion of `source` on a robot: solved for as a whole, within limits, feet planted where
    the source's are; or, where it is not `solved`, each pose copied to the robot's hinges. With a
    file of stated ground it is solved for on that."""
    from robots.solver.solve import copy
    from robots.solver.solve import retarget as solve

    robot, canonical = target.on_robot.robot, source.canonical
    if terrain is not None:
        own = source.recording.convention if isinstance(source, Clip) else Convention(1.0, "z")
        stated, notes = read_ground(terrain, own)
        canonical = on_terrain(to_canonical(source.motion, source.rig), stated)
        canonical = replace(canonical, notes=(*canonical.notes, *notes))
    if solved:
        moved = solve(canonical, robot)
    else:
        moved = copy(canonical, robot)
        moved = replace(moved, notes=(*moved.notes, COPIED))
    return RobotClip(moved, f"{source.name} on {target.name}", source.path, source.span)


def _travel(source: AnyClip, target: Clip, *, fitted: bool) -> float:
    """How many times as far as the source the target goes over the ground: its path is scaled with
    the legs, which may be `fitted`."""
    if fitted:
        return travel_scale(source.rig, target.rig)
    return target.rig.hip_height / source.rig.hip_height


def _carried(
    motion: Motion, source: AnyClip, target: Clip, travel: float
) -> tuple[Motion, tuple[str, ...]]:
    """`motion` on the target, which goes `travel` times as far, with root motion where its file can
    say where its root is."""
    if not (target.recording.bvh.position_channels[:, 0] == 0).any():
        return motion, ()
    return with_root_motion(motion, target.rig, source.motion, source.rig, travel)
