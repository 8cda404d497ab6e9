"""Sources that are put elsewhere while they move."""

import numpy as np
import pytest

from robots.model.known import known
from robots.stream.frame_targets import Frame, ground_of
from robots.stream.stream import Stream
from spark.demo.sample import sample_motion, sample_rig
from spark.errors import FrameError
from spark.transfer.canonical import to_canonical

RIG, EMBER = sample_rig("walker"), known("robot")
WALK = sample_motion("walk", RIG, 60.0).frames(0, 70)


def said(jump: tuple[float, float], *, broken: bool = False) -> np.ndarray:
    """Of a walker who is put elsewhere [m] in the 40th frame, which may come broken first."""
    live = Stream(RIG, EMBER, WALK.frame_time, ground_of(to_canonical(WALK, RIG), EMBER))
    out = []
    for t in range(len(WALK)):
        root = WALK.root_pos[t] + (t >= 40) * np.array([*jump, 0.0])
        if broken and t == 40:
            with pytest.raises(FrameError):
                live.step(Frame(root, np.zeros_like(WALK.rotations[t])))
        out.append(live.step(Frame(root, WALK.rotations[t])))
    return np.array(out)


@pytest.mark.parametrize("broken", [False, True])
@pytest.mark.parametrize("jump", [(3.0, 2.0), (-0.7, 0.0)])
def test_who_is_put_elsewhere_walks_on(jump: tuple[float, float], broken: bool) -> None:
    """As if nothing had been, but for the step of that frame."""
    stays, goes_on = said((0.0, 0.0)), said(jump, broken=broken)
    np.testing.assert_allclose(goes_on, stays, atol=0.05)
    pace = np.linalg.norm(np.diff(goes_on[:, :2], axis=0), axis=1) * 60
    assert pace.max() < 3.0  # [m/s]


def test_what_a_runner_may_have_run_is_followed() -> None:
    assert said((0.5, 0.0))[-1, 0] - said((0.0, 0.0))[-1, 0] > 0.3
