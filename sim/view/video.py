"""Scenes as video files and as strips of pictures."""

import subprocess
from collections.abc import Callable, Iterable
from io import BytesIO
from pathlib import Path
from shutil import which

import numpy as np

from sim.view.camera import fitting_aspect
from sim.view.render import frames
from sim.view.scene import Scene
from spark.errors import DependencyError, OutputError
from spark.files import replacing, write_atomically

Progress = Callable[[Iterable[int]], Iterable[int]]


def write_video(
    scene: Scene,
    path: str | Path,
    *,
    width: int = 960,
    height: int = 540,
    progress: Progress = iter,
) -> None:
    """An H.264 video of the whole scene at its own frame rate. `progress` wraps the frames."""
    path = Path(path)
    if not path.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.parent}; make it first")
    with replacing(path) as unfinished:
        _encode(scene, unfinished, path, width, height, progress)


def _encode(
    scene: Scene, unfinished: Path, path: Path, width: int, height: int, progress: Progress
) -> None:
    """Write the video to `unfinished`; errors call it `path`."""
    encoder = [
        *(_ffmpeg(), "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{width}x{height}", "-r", f"{1 / scene.frame_time:.6f}", "-i", "-"),
        *("-an", "-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-pix_fmt", "yuv420p"),
        *("-movflags", "+faststart", "-f", "mp4", str(unfinished)),
    ]
    with subprocess.Popen(encoder, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            indices = progress(range(len(scene.qpos)))
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
    try:
        from PIL import Image
    except ImportError as error:
        raise DependencyError("pictures need Pillow: pip install 'spark-sim[video]'") from error
    path = Path(path)
    if width is None:
        width = round(height * fitting_aspect(scene))
    count = count or (5 if width < 2 * height else 3)
    indices = np.linspace(0, len(scene.qpos) - 1, count).round().astype(int).tolist()
    pictures = list(frames(scene, indices, width=width, height=height))
    buffer = BytesIO()
    Image.fromarray(np.concatenate(pictures, axis=1)).save(buffer, format="PNG", optimize=True)
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
