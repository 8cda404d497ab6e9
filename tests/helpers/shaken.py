"""Demo motions that tremble as motion estimated from video does."""

from dataclasses import replace

import numpy as np

from scripts.corruptions import jittering
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import CanonicalMotion, to_canonical

RIG = sample_rig("walker")


def demo_clip(name: str, fps: float, degrees: float = 0.0) -> CanonicalMotion:
    """A demo motion; with noise on every joint, and on the root, too."""
    motion = sample_motion(name, RIG, fps)
    if degrees:
        rng = np.random.default_rng(0)
        shaken = jittering(motion, RIG, rng, degrees=degrees)
        root = motion.root_pos + 0.005 * degrees * rng.normal(size=motion.root_pos.shape)
        motion = replace(shaken, root_pos=root)
    return to_canonical(motion, RIG)
