"""The Python API: what can be done with clips. The command line is a layer over it."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args, overload

from spark.errors import ConventionError
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark_sim import files
from spark_sim.choices import Method, RobotName
from spark_sim.clips import AnyClip, Clip, File, RobotClip
from spark_sim.loading import clip_of
from spark_sim.retargeting import onto_character, onto_robot

if TYPE_CHECKING:
    from sim.report import Report
    from spark_sim.simulation import Simulated

_PAGE = (".html", ".htm")


@overload
def retarget(
    source: AnyClip | File,
    target: Clip,
    *,
    method: Method = "spark",
    checkpoint: File | None = None,
    refine: bool = True,
    keep_touches: bool = False,
) -> Clip: ...
@overload
def retarget(
    source: AnyClip | File,
    target: RobotClip | RobotName,
    *,
    method: Method = "spark",
    refine: bool = True,
    terrain: File | None = None,
) -> RobotClip: ...
@overload
def retarget(
    source: AnyClip | File,
    target: AnyClip | File,
    *,
    method: Method = "spark",
    checkpoint: File | None = None,
    refine: bool = True,
    keep_touches: bool = False,
    terrain: File | None = None,
) -> AnyClip: ...
def retarget(
    source: AnyClip | File,
    target: AnyClip | File,
    *,
    method: str = "spark",
    checkpoint: File | None = None,
    refine: bool = True,
    keep_touches: bool = False,
    terrain: File | None = None,
) -> AnyClip:
    """The motion of `source` on the body of `target`, in the hierarchy and units of its file.

    Both are clips, or what `load` takes: `target` may be a robot's name or MJCF.

    On a character each joint turns as its counterpart does, in world axes. With method "copy" that
    is all, as a baseline: joints that the source has no counterpart of are interpolated between
    their neighbours. With "spark" the legs are fitted, so that the feet take the source's steps
    (`spark.transfer.leg_fit`), and joints of spine, neck or shoulders without a counterpart are
    filled in: by a trained network (`checkpoint`, or the one that ships) on rigs like those that it
    was trained on, and by the target's own motion, where its file has one. With `refine`, each foot
    is then held where the source's foot stands, what else would be in the floor comes up
    (`spark.transfer.over_floor`), and with "spark" the hips sway so that the weight moves as the
    source's does (`spark.transfer.hip_sway`). A loop is seen as it goes on, and closes
    (`spark.transfer.loops`). The feet of a walk in place are held as on a treadmill's belt
    (`spark.transfer.in_place`). A source that trembles, as motion estimated from video, is smoothed
    before (`spark.transfer.noise`), and a note says so. With `keep_touches`, hands are led to what
    the source's touch, each other and their own body (`spark.transfer.hand_touch`); without, a note
    says how far they are off that. Twist bones that the source lacks take
    their share at the end (`spark.transfer.twists`).

    On a robot the whole trajectory is solved for, within the joints' limits, feet held. With method
    "copy" or without `refine`, each pose is only copied to the robot's hinges, as a baseline.
    Otherwise its hands keep their touches. `terrain` is the ground under the source: a mesh in the
    unit and axes of the source's file, or the fixed shapes of an MJCF or a URDF. It is scaled as
    the motion is, feet stand on it, nothing of the robot is in it, and the result has it.

    Raises `SkeletonError` where one of the two is no humanoid, `ConventionError` for a method that
    is not known or does not go with the rest and for a terrain that the source is not on, and
    `FileFormatError` where that is broken.
    """
    if method not in get_args(Method):
        raise ConventionError(f"method {method!r} is not known; expected 'copy' or 'spark'")
    if method != "spark" and checkpoint is not None:
        raise ConventionError("a checkpoint goes with method 'spark', and with no other")
    if keep_touches and (method != "spark" or not refine):
        raise ConventionError(
            "keep_touches goes with method 'spark', refined: a baseline keeps none"
        )
    source, target = clip_of(source), clip_of(target)
    if not isinstance(target, Clip):
        if checkpoint is not None:
            raise ConventionError("a checkpoint is for characters; robots are solved for")
        solved = refine and method != "copy"
        if terrain is not None and not solved:
            raise ConventionError(
                "a terrain goes with method 'spark', refined: copies know no ground"
            )
        if terrain is not None and target.on_robot.robot.mount is not None:
            raise ConventionError(
                f"a terrain is for robots with legs; {target.name} stays in place"
            )
        ground = None if terrain is None else Path(terrain)
        return onto_robot(source, target, solved=solved, terrain=ground)
    if terrain is not None:
        raise ConventionError("a terrain is for robots; characters are put on a level floor")
    learned = None if checkpoint is None else Path(checkpoint)
    return onto_character(
        source,
        target,
        fitted=method == "spark",
        checkpoint=learned,
        refine=refine,
        keep_touches=keep_touches,
    )


def report(
    clip: AnyClip | File,
    *,
    source: AnyClip | File | None = None,
    truth: AnyClip | File | None = None,
    html: File | None = None,
    force: bool = False,
) -> "Report":
    """Measure how plausible a motion is.

    `source` is the motion that it was made from, to compare with. `truth` is the right answer, on
    the same skeleton, to measure the distance from. With `html`, the report is also written as a
    web page. Raises `OutputError` where that exists, unless forced.
    """
    from sim.report import assess

    if html is not None:
        files.claim(Path(html), force=force, endings=_PAGE, what="a page")
    clip = clip_of(clip)
    origin, names = None, (clip.name, "source")
    if source is not None:
        source = clip_of(source)
        origin, names = source.subject, (clip.name, source.name)
    known = None if truth is None else clip_of(truth).motion
    assessed = assess(clip.subject, source=origin, truth=known)
    if html is not None:
        from sim.report.page import write_report_page

        write_report_page(assessed, html, clip.subject, origin, title=clip.name, names=names)
    return assessed


def play(
    *clips: "AnyClip | Simulated | File",
    video: File | None = None,
    html: File | None = None,
    strip: File | None = None,
    gif: File | None = None,
    webp: File | None = None,
    same_height: bool = False,
    speed: float = 1.0,
    force: bool = False,
    progress: Callable[[Iterable[int]], Iterable[int]] = iter,
) -> None:
    """Show motions side by side: in a window, or as the files that are named, a video (MP4), a web
    page (HTML), a strip of moments (PNG) and an animated picture (GIF, WebP). What `simulate`
    returns is shown with its target as a ghost. A character whose file has a skin is shown with it;
    `Clip.wearing` gives it that of another. With `same_height`, all stand as tall as
    the tallest. At a `speed` of 0.25 a video takes four times as long as the motion, with frames
    made between its own; a window and a page begin with it.

    `progress` wraps the frames of the video and of animated pictures. Raises `DependencyError`
    where there is no display, or nothing to draw or encode with, and `OutputError` where a file
    exists, unless forced.
    """
    from sim.view.staging import build_scene
    from sim.view.timeline import SPEEDS

    if speed not in SPEEDS:
        known = ", ".join(f"{each:g}" for each in SPEEDS)
        raise ConventionError(f"speed {speed:g}: expected one of {known}")
    for path, endings, what in (
        (video, (".mp4",), "a video"),
        (html, _PAGE, "a page"),
        (strip, (".png",), "a strip"),
        (gif, (".gif",), "a GIF"),
        (webp, (".webp",), "a WebP"),
    ):
        if path is not None:
            files.claim(Path(path), force=force, endings=endings, what=what)
    shown = [clip_of(c) if isinstance(c, str | Path) else c for c in clips]
    figures = [figure for clip in shown for figure in clip.figures()]
    if same_height:
        tallest = max(figure.own_height for figure in figures)
        figures = [replace(figure, height=tallest) for figure in figures]
    if video is html is strip is gif is webp is None:
        from sim.report.watch import watch

        watch(figures, title=" - ".join(c.name for c in shown), speed=speed)
        return
    scene = build_scene(figures, max_fps=max(60.0, 30.0 / speed), blend=speed < 1)
    if video is not None:
        from sim.view.video import write_video

        write_video(scene, video, speed=speed, progress=progress)
    for path in (gif, webp):
        if path is not None:
            from sim.view.video import write_animation

            write_animation(scene, path, speed=speed, progress=progress)
    if html is not None:
        from sim.report.watch import write_replay

        write_replay(figures, html, title=" · ".join(c.name for c in shown), speed=speed)
    if strip is not None:
        from sim.view.video import write_strip

        write_strip(scene, strip)


def sample(folder: File = "samples", *, force: bool = False) -> tuple[Path, ...]:
    """Write the demo motions as BVH files into `folder`: each of them on two different rigs.

    Raises `OutputError` where one of the files exists, unless forced.
    """
    from spark.demo.sample import BUILDS, MOTIONS, sample_motion, sample_rig

    written = {
        (rig, motion): Path(folder) / f"{rig}_{motion}.bvh" for rig in BUILDS for motion in MOTIONS
    }
    for path in written.values():
        files.claim(path, force=force)
    for name, build in BUILDS.items():
        rig = sample_rig(name)
        for motion in MOTIONS:
            made = sample_motion(motion, rig, build.fps)
            write_bvh(encode_new(made, unit=build.unit, up=build.up), written[name, motion])
    return tuple(written.values())
