"""The same motion under two names is found; another one is not."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import BUILDS, MOTIONS, sample_motion, sample_rig
from spark.motion import Motion
from spark.rotation import quat_from_rotvec, quat_from_yaw, quat_mul
from spark_sim.shelf.duplicates import fingerprint, near_duplicates

RIG = sample_rig("walker")


def sample(name: str = "walk", fps: float = 30.0) -> Motion:
    return sample_motion(name, RIG, fps)


def turned(motion: Motion) -> Motion:
    """A quarter of a turn, elsewhere in the room."""
    quarter = quat_from_yaw(np.array(np.pi / 2))
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_mul(quarter, rotations[:, 0])
    x, y, z = motion.root_pos.T
    return replace(motion, root_pos=np.stack([3 - y, x - 1, z], axis=1), rotations=rotations)


def noisy(motion: Motion) -> Motion:
    """With a degree of noise in every joint."""
    rng = np.random.default_rng(0)
    noise = quat_from_rotvec(np.radians(1) * rng.normal(size=(*motion.rotations.shape[:2], 3)))
    return replace(motion, rotations=quat_mul(motion.rotations, noise))


SAME = {
    "copied": sample(),
    "turned": turned(sample()),
    "at 120 fps": sample(fps=120.0),
    "noisy": noisy(sample()),
    "a frame shorter": sample().frames(0, len(sample()) - 1),
}


@pytest.mark.parametrize("how", SAME)
def test_the_same_motion_is_found(how: str) -> None:
    prints = {"a": fingerprint(sample(), RIG), "b": fingerprint(SAME[how], RIG)}
    prints |= {name: fingerprint(sample(name), RIG) for name in MOTIONS if name != "walk"}
    assert near_duplicates(prints) == [["a", "b"]]


def test_others_are_not() -> None:
    """Other motions, the walk in place, twice as fast, and its second half."""
    walk = sample()
    in_place = replace(walk, root_pos=walk.root_pos * [0, 0, 1])
    others = {
        **{name: sample(name) for name in MOTIONS},
        "in place": in_place,
        "fast": replace(walk, frame_time=walk.frame_time / 2),
        "half": walk.frames(len(walk) // 2, len(walk)),
    }
    assert near_duplicates({name: fingerprint(m, RIG) for name, m in others.items()}) == []


def test_all_of_a_kind_are_one_group() -> None:
    walk, squat = fingerprint(sample(), RIG), fingerprint(sample("squat"), RIG)
    prints = {"d": walk, "a": walk, "c": squat, "b": walk, "e": squat}
    assert near_duplicates(prints) == [["a", "b", "d"], ["c", "e"]]
    assert near_duplicates({"a": walk}) == near_duplicates({}) == []


def test_another_skeleton_has_the_same_motion() -> None:
    """The sample walk is made once for each rig, from the same limbs' directions."""
    rig = sample_rig("dancer")
    motion = sample_motion("wave", rig, BUILDS["dancer"].fps)
    prints = {"one": fingerprint(sample("wave"), RIG), "two": fingerprint(motion, rig)}
    assert near_duplicates(prints) == [["one", "two"]]
