"""What is no frame, clip, rate or address is told with what was expected.

In a process of its own: in this one, types are checked before the code that is tried.
"""

import subprocess
import sys

import pytest

import spark_sim
from spark.errors import ConventionError

_TRIED = """
import numpy as np
import spark_sim
from spark.demo.sample import sample_motion, sample_rig
from spark.io.convention import Convention, given_unit, given_up
from spark.io.encoding import encode_new
from spark.io.recording import Recording

motion = sample_motion("walk", sample_rig("walker"), 60.0).frames(0, 4)
convention = Convention(given_unit("cm"), given_up("y"))
walk = spark_sim.Clip(Recording(encode_new(motion), motion, convention), "walk")
live = spark_sim.Retargeter(walk, "robot")
place, turns = motion.root_pos[0], motion.rotations[0]
frames = [
    None, np.zeros(7), (place,), {"root_pos": place}, ("a", "b"), (None, turns),
    (place, [[1, 0], [1]]), (place, turns * 1j), (place, turns, 5), (place[:2], turns),
]
person = spark_sim.Listener("vmc://127.0.0.1:0")
calls = [lambda frame=frame: live.step(frame) for frame in frames]
for fps in ("60", [60], True, 0, -1.0, float("nan")):
    calls += [
        lambda fps=fps: spark_sim.Retargeter(walk, "robot", fps=fps),
        lambda fps=fps: person.wait(fps=fps),
        lambda fps=fps: next(person.frames(fps)),
    ]
calls += [
    lambda: spark_sim.Retargeter(None, "robot"),
    lambda: spark_sim.Retargeter(walk, 5),
    lambda: spark_sim.Retargeter(motion, "robot"),
    lambda: spark_sim.Listener(5),
    lambda: spark_sim.Listener(None),
    lambda: person.listen("1"),
]
for call in calls:
    try:
        call()
    except spark_sim.SparkSimError as error:
        assert "expected" in str(error), error
    else:
        raise AssertionError("nothing was told")
first = live.step((place.tolist(), turns.tolist()))
live.reset()
assert (first == live.step((place, turns))).all()
print(len(calls))
"""


def test_what_is_no_frame_clip_rate_or_address_is_told() -> None:
    done = subprocess.run([sys.executable, "-c", _TRIED], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == 34


def test_nobody_is_known_before_a_pose_came() -> None:
    with spark_sim.Listener("vmc://127.0.0.1:0") as person:
        for call in (person.frame, lambda: person.person(60.0), lambda: next(person.frames(60.0))):
            with pytest.raises(ConventionError, match=r"no person is known yet; call wait\(\)"):
                call()
