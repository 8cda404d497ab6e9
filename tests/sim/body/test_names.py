"""Bodies of joints with any names, and of bones without length: loadable, or refused."""

import re
from pathlib import Path

import mujoco
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import spark_sim
from spark.errors import SparkSimError


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    spark_sim.sample(folder)
    return folder


def renamed(samples: Path, names: dict[str, str]) -> Path:
    """The sample walk, some of its joints, by their names after the colon, called otherwise."""
    joint = re.compile(rf"JOINT \S+:({'|'.join(names)})\n")
    walk = (samples / "walker_walk.bvh").read_text()
    text, count = joint.subn(lambda m: f"JOINT {names[m[1]]}\n", walk)
    assert count == len(names)
    (samples / "renamed.bvh").write_text(text)
    return samples / "renamed.bvh"


@settings(deadline=None, max_examples=25)
@given(name=st.text(st.characters(exclude_characters="\r\n{}", codec="utf-8"), min_size=1))
@example(name="world")
@example(name="007")
@example(name="nan")
@example(name="1e5")
@example(name='"><!--')
@example(name="a\0b")
@example(name="\x1b[2J")
@example(name="a\u2028b\ufffe")
@example(name="\x1f")
@example(name="\xa0")
@example(name="x" * 10_000)
def test_a_joint_of_any_name_is_one_of_mujocos(name: str, samples: Path) -> None:
    """Written, read back by MuJoCo with as many bodies; or refused as a joint without a name."""
    path = renamed(samples, {"Neck": name, "Head": f"{name}7"})
    if not name.encode().strip():
        with pytest.raises(SparkSimError, match=r"name of a joint|expected"):
            spark_sim.load(path)
        return
    clip = spark_sim.load(path)
    (_, scene), _ = clip.save_mjcf(samples / 'a "&< b.xml', force=True)
    model = mujoco.MjModel.from_xml_path(str(scene))
    assert model.nbody == len(clip.joint_names) + 1
    assert {model.body(b).name for b in range(1, model.nbody)} == set(clip.joint_names)


def flattened(walk: Path, joints: str) -> str:
    """The text of a BVH file with the OFFSETs of some joints at zero."""
    lines, zero = [], False
    for line in walk.read_text().splitlines():
        if found := re.match(r"\s*(?:ROOT|JOINT) (\S+)", line):
            zero = re.search(joints, found[1]) is not None
        lines.append(re.sub(r"OFFSET .*", "OFFSET 0 0 0", line) if zero else line)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    "joints", ["Toe", "Foot|Toe", "Leg$", "Arm", "Hand", "Spine", "Neck|Head", "Leg|Foot|Toe", "."]
)
def test_bones_without_length(joints: str, samples: Path, tmp_path: Path) -> None:
    """A result or a typed error in every way that a clip goes."""
    path, walk = tmp_path / "flat.bvh", samples / "dancer_walk.bvh"
    path.write_text(flattened(samples / "walker_walk.bvh", joints))
    done = 0
    for go in (
        lambda: spark_sim.load(path).save_mjcf(tmp_path / "o.xml", force=True),
        lambda: spark_sim.play(path, html=tmp_path / "o.html", force=True),
        lambda: spark_sim.report(path, html=tmp_path / "r.html", force=True),
        lambda: spark_sim.retarget(walk, path).save(tmp_path / "o.bvh", force=True),
        lambda: spark_sim.retarget(path, walk).save(tmp_path / "o.bvh", force=True),
        lambda: spark_sim.retarget(path, "robot").save(tmp_path / "o.npz", force=True),
    ):
        try:
            go()
            done += 1
        except SparkSimError as error:
            assert str(error)  # noqa: PT017
    assert done or joints in ("Leg|Foot|Toe", ".")  # no body is left
