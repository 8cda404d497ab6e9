"""The same motion under two names is found; another one is not."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import BUILDS, MOTIONS, sample_motion, sample_rig
from spark.motion import Motion
from spark.rotation import quat_from_rotvec, quat_from_yaw, quat_mul
from spark_sim.shelf import duplicates
from spark_sim.shelf.duplicates import near_duplicates
from spark_sim.shelf.fingerprint import fingerprint

RIG = sample_rig("walker")
REST = sample_motion("walk", RIG, 30.0)


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
    found = near_duplicates(prints)
    assert (found.groups, found.parts) == ([["a", "b"]], [])


def test_others_are_not() -> None:
    """Other motions, the walk in place, and twice as fast."""
    walk = sample()
    in_place = replace(walk, root_pos=walk.root_pos * [0, 0, 1])
    others = {
        **{name: sample(name) for name in MOTIONS},
        "in place": in_place,
        "fast": replace(walk, frame_time=walk.frame_time / 2),
    }
    found = near_duplicates({name: fingerprint(m, RIG) for name, m in others.items()})
    assert (found.groups, found.parts) == ([], [])


def test_all_of_a_kind_are_one_group() -> None:
    walk, squat = fingerprint(sample(), RIG), fingerprint(sample("squat"), RIG)
    prints = {"d": walk, "a": walk, "c": squat, "b": walk, "e": squat}
    assert near_duplicates(prints).groups == [["a", "b", "d"], ["c", "e"]]
    assert near_duplicates({"a": walk}).groups == near_duplicates({}).groups == []


def test_another_skeleton_has_the_same_motion() -> None:
    """The sample walk is made once for each rig, from the same limbs' directions."""
    rig = sample_rig("dancer")
    motion = sample_motion("wave", rig, BUILDS["dancer"].fps)
    prints = {"one": fingerprint(sample("wave"), RIG), "two": fingerprint(motion, rig)}
    assert near_duplicates(prints).groups == [["one", "two"]]


def made(seed: int, seconds: float = 20.0, fps: float = 60.0) -> Motion:
    """A motion that no other seed makes, and that never repeats: each joint turns to and fro."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * fps) + 1) / fps
    joints = REST.rotations.shape[1]
    rates, phases = rng.uniform(0.2, 1.0, (3, joints, 3)), rng.uniform(0, 6.28, (3, joints, 3))
    waves = np.sin(6.28 * rates * times[:, None, None, None] + phases).sum(axis=1)
    rotations = quat_mul(REST.rotations[:1], quat_from_rotvec(0.2 * waves))
    path = np.cumsum(np.sin(0.3 * times[:, None] + rng.uniform(0, 6.28, 3)) / fps, axis=0)
    return Motion(REST.skeleton, 1 / fps, REST.root_pos[:1] + path, rotations)


def seconds(motion: Motion, start: float, stop: float) -> Motion:
    return motion.frames(round(start / motion.frame_time), round(stop / motion.frame_time) + 1)


OTHERS = {f"other {k}": fingerprint(made(k), RIG) for k in range(1, 4)}
LONG = made(0)


@pytest.mark.parametrize(
    "trimmed",
    [
        seconds(LONG, 2.31, 20.0),
        seconds(LONG, 0.0, 17.2),
        turned(seconds(LONG, 1.93, 18.77)),
        noisy(seconds(LONG, 3.1, 20.0)),
        seconds(made(0, fps=25.0), 1.12, 18.0),
    ],
)
def test_what_was_trimmed_is_the_same(trimmed: Motion) -> None:
    found = near_duplicates(OTHERS | {"a": fingerprint(LONG, RIG), "b": fingerprint(trimmed, RIG)})
    assert (found.groups, found.parts) == ([["a", "b"]], [])


@pytest.mark.parametrize("start", [0.0, 7.13, 12.9])
def test_a_part_is_found_where_it_is(start: float) -> None:
    part = noisy(turned(seconds(LONG, start, start + 6)))
    found = near_duplicates(OTHERS | {"all": fingerprint(LONG, RIG), "bit": fingerprint(part, RIG)})
    assert found.groups == []
    ((name, of, at),) = found.parts
    assert (name, of) == ("bit", "all")
    assert at == pytest.approx(start, abs=0.05)
    assert list(found.sentences()) == [f"bit is a part of all, from {at:.1f} s on"]


def test_rest_is_no_part_of_all_that_rests() -> None:
    """Who stands still for a while is nearly like anyone who does; that says nothing."""

    def still(seconds: float, lean: float) -> str:
        rotations = np.repeat(REST.rotations[:1], round(30 * seconds), axis=0)
        rotations = quat_mul(rotations, quat_from_rotvec(np.radians([lean, 0, 0])))
        place = np.repeat(REST.root_pos[:1], len(rotations), axis=0)
        return fingerprint(Motion(REST.skeleton, 1 / 30, place, rotations), RIG)

    prints = {"one": still(10, 0.0), "two": still(4, 0.5), "three": still(4, -0.5)}
    found = near_duplicates(prints)
    assert (found.groups, found.parts) == ([], [])
    assert near_duplicates({"one": still(4, 0.0), "copy": still(4, 0.0)}).groups == [
        ["copy", "one"]
    ]


def test_few_of_the_pairs_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that ten times as many motions cost ten times as much, and not a hundred times."""
    compared = []
    original = duplicates.compare

    def counted(one: object, other: object) -> object:
        compared.append((one, other))
        return original(one, other)

    monkeypatch.setattr(duplicates, "compare", counted)
    prints = {f"{k:02}": fingerprint(made(k, 5.0, 20.0), RIG) for k in range(30)}
    prints["again"] = fingerprint(made(20, 5.0), RIG)
    assert near_duplicates(prints).groups == [["20", "again"]]
    assert 0 < len(compared) < 30 * 30 / 2 / 5


def test_what_an_older_version_wrote_is_left_out() -> None:
    assert near_duplicates({"a": "4.983:AAAA", "b": "4.983:AAAA"}).groups == []
