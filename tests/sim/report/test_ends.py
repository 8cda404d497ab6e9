"""What a clip's ends are accused of: nothing that they are free of within a longer clip."""

import numpy as np
import pytest

from sim.report.assess import assess
from sim.trajectory import Subject
from spark.demo.sample import BUILDS, sample_motion, sample_rig
from tests.helpers.stick import standing, stick_rig


@pytest.mark.parametrize("build", BUILDS)
@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_a_clean_walk_is_clean_wherever_it_is_cut(build: str, fps: float) -> None:
    rig = sample_rig(build)
    walk = sample_motion("walk", rig, fps)
    whole = Subject(walk, rig)
    assert assess(whole).implausible == 0
    for stop in np.arange(0.67, 1.3, 0.034) * fps:
        cut = Subject(walk.frames(0, int(stop)), rig)
        assert assess(cut, source=whole).clip.flags["skating"].sum() == 0, stop


def test_who_slides_from_end_to_end_slides_at_the_ends() -> None:
    rig = stick_rig()
    still = standing(rig, 60)
    sliding = standing(rig, 60)
    sliding.root_pos[:, 0] += 0.4 * np.arange(60) * still.frame_time
    report = assess(Subject(sliding, rig), source=Subject(still, rig))
    assert report.clip.flags["skating"].all()
