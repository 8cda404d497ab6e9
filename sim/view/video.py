"""Scenes as video files, animated pictures and strips of pictures."""

import subprocess
from collections.abc import Callable, Iterable
from io import BytesIO
from pathlib import Path
from shutil import which

import numpy as np

from sim.view.camera import fitting_aspect
from sim.view.pictures import pillow
from sim.view.render import frames, stills
from sim.view.scene import Scene
from sim.view.staging import thinned
from spark.errors import DependencyError, OutputError
from spark.files import replacing, write_atomically

_VIDEO_FPS, _ANIMATED_FPS = 30.0, 15.0
Progress = Callable[[Iterable[int]], Iterable[int]]


def write_video(
    scene: Scene,
    path: str | Path,
    *,
    width: int = 854,
    height: int = 480,
    speed: float = 1.0,
    progress: Progress = iter,
) -> None:
    """An H.264 video of the whole scene, of at most `_VIDEO_FPS` frames a second, in which `speed`
    seconds of it go by in one. `progress` wraps the frames."""
    path = Path(path)
    if not path.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.parent}; make it first")
    with replacing(path) as unfinished:
        _encode(scene, unfinished, path, width, height, speed, progress)


def _encode(
    scene: Scene,
    unfinished: Path,
    path: Path,
    width: int,
    height: int,
    speed: float,
    progress: Progress,
) -> None:
    """Write the video to `unfinished`; errors call it `path`."""
    step = thinned(speed / scene.frame_time, _VIDEO_FPS)
    fps = speed / (step * scene.frame_time)
    encoder = [
        *(_ffmpeg(), "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{width}x{height}", "-r", f"{fps:.6f}", "-i", "-"),
        *("-an", "-c:v", "libx264", "-preset", "superfast", "-crf", "20", "-pix_fmt", "yuv420p"),
        *("-x264-params", "mbtree=1:rc-lookahead=10", "-threads", "1"),
        *("-movflags", "+faststart", "-f", "mp4", str(unfinished)),
    ]
    with subprocess.Popen(encoder, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            indices = progress(range(0, len(scene.qpos), step))
            for picture in frames(scene, indices, width=width, height=height):
                process.stdin.write(picture.tobytes())
            process.stdin.close()
            message = process.stderr.read().decode(errors="replace").strip()
        except BrokenPipeError:  # the encoder has given up; its own words say why
            message = process.stderr.read().decode(errors="replace").strip()
        except BaseException:
            process.kill()
            process.wait()
            raise
    if process.returncode:
        message = message or f"it ended with {process.returncode}"
        raise OutputError(f"{path}: the video encoder failed: {message}")


def write_strip(
    scene: Scene,
    path: str | Path,
    *,
    count: int | None = None,
    width: int | None = None,
    height: int = 330,
) -> None:
    """One PNG of `count` moments, evenly spread from the first frame to the last: five, or three of
    many figures.

    Each is `width` x `height` pixels; without a width, just wide enough for the figures.
    """
    image = pillow()
    path = Path(path)
    count = count or (5 if len(scene.placements) < 4 else 3)
    indices = np.linspace(0, len(scene.qpos) - 1, count).round().astype(int).tolist()
    pictures = stills(scene, indices, width=width, height=height)
    buffer = BytesIO()
    image.fromarray(np.concatenate(pictures, axis=1)).save(buffer, format="PNG", optimize=True)
    write_atomically(path, buffer.getvalue())


def write_animation(
    scene: Scene,
    path: str | Path,
    *,
    height: int = 240,
    speed: float = 1.0,
    progress: Progress = iter,
) -> None:
    """A GIF or a WebP, by the ending, that loops for ever: for a README. At most `_ANIMATED_FPS`
    frames a second; just wide enough for the figures. `speed` is that of `write_video`."""
    image = pillow()
    path = Path(path)
    step = max(1, round(speed / (_ANIMATED_FPS * scene.frame_time)))
    indices = progress(range(0, len(scene.qpos), step))
    width = round(height * fitting_aspect(scene))
    pictures = [
        image.fromarray(picture.copy())
        for picture in frames(scene, indices, width=width, height=height)
    ]
    # Hundredths of a second in a GIF: the rounding is spread, so that the whole lasts as long.
    ends = np.round(100 * step * scene.frame_time / speed * np.arange(len(pictures) + 1)) * 10
    more: dict[str, object] = {"save_all": True, "append_images": pictures[1:], "loop": 0}
    if path.suffix.lower() == ".gif":
        palette = pictures[len(pictures) // 2].quantize(128)
        pictures = [picture.quantize(palette=palette, dither=0) for picture in pictures]
        more |= {"append_images": pictures[1:], "optimize": True, "disposal": 1}
    else:
        more |= {"quality": 80, "method": 4}
    durations = np.diff(ends).astype(int).tolist()
    buffer = BytesIO()
    kind = "GIF" if path.suffix.lower() == ".gif" else "WebP"
    pictures[0].save(buffer, format=kind, duration=durations, **more)
    write_atomically(path, buffer.getvalue())


def _ffmpeg() -> str:
    """imageio-ffmpeg's own binary, or the system's."""
    try:
        import imageio_ffmpeg
    except ImportError:
        found = which("ffmpeg")
        if found is None:
            raise DependencyError(
                "videos need ffmpeg: pip install 'spark-sim[video]', or install ffmpeg"
            ) from None
        return found
    return imageio_ffmpeg.get_ffmpeg_exe()
