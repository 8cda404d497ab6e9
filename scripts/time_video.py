"""How fast a video of some files is written: in all, and what of it is drawing and encoding.

python scripts/time_video.py dance.bvh dance_on_g1.npz
"""

import resource
import tempfile
import time
from argparse import ArgumentParser
from pathlib import Path

import spark_sim
from sim.view.render import frames
from sim.view.staging import build_scene
from sim.view.video import write_video


def main() -> None:
    """Print the times: by the clock, and of the processor."""
    parser = ArgumentParser(description=__doc__, usage="%(prog)s FILE...")
    parser.add_argument("files", type=Path, nargs="+")
    figures = [f for path in parser.parse_args().files for f in spark_sim.load(path).figures()]
    scene = build_scene(figures)
    duration = len(scene.qpos) * scene.frame_time
    for _ in frames(scene, range(3)):  # the first picture takes longer
        pass
    with tempfile.TemporaryDirectory() as folder:
        start, drawing = time.perf_counter(), time.process_time()
        write_video(scene, Path(folder) / "out.mp4")
        took, drawing = time.perf_counter() - start, time.process_time() - drawing
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    encoding = children.ru_utime + children.ru_stime
    print(f"{duration:.1f} s of video in {took:.1f} s: {duration / took:.2f} x real time")
    print(f"CPU: {drawing:.1f} s to draw and read back, {encoding:.1f} s to encode")


if __name__ == "__main__":
    main()
