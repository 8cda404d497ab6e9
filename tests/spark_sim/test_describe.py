"""What `inspect` says of a body's joints."""

from pathlib import Path

import numpy as np

from spark.demo import gait
from spark.demo.sample import sample_rig
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.transfer.canonical import from_canonical
from spark_sim.describe import describe, text
from spark_sim.loading import load
from tests.helpers.rigs import RIGS, build, walk
from tests.helpers.twisting import BONES, turning, with_bones


def test_each_joint_is_named_once_and_fingers_as_fingers(tmp_path: Path) -> None:
    skeleton, roles = build(RIGS["mixamo"])
    write_bvh(encode_new(walk(skeleton, roles), unit="cm", up="y"), tmp_path / "rig.bvh")
    facts = describe(load(tmp_path / "rig.bvh"))
    said = text(facts)
    lines = {line.split(":")[0].strip(): line for line in said.splitlines()[4:] if ":" in line}
    for side in ("Left", "Right"):
        for finger in ("Thumb", "Index"):
            names = [f"mixamorig:{side}Hand{finger}{n}" for n in (1, 2)]
            assert f"{side.lower()} {finger.lower()} {', '.join(names)}" in lines["fingers"]
            assert not any(name in lines["follow their parents"] for name in names)
            found = {joint["joint"]: joint["finger"] for joint in facts["body"]["joints"]}
            assert {found[name] for name in names} == {f"{side.lower()} {finger.lower()}"}
    assert "mixamorig:LeftEye" in lines["follow their parents"]


def test_twist_bones_are_told_as_what_they_are(tmp_path: Path) -> None:
    """And what hangs elsewhere on a limb follows its parent."""
    skeleton = with_bones((*BONES, ("ForeArm", "Hand", 0.5, "Bracelet")))
    path = tmp_path / "character.bvh"
    write_bvh(encode_new(turning(skeleton, {"Hips": np.zeros((2, 3))})), path)
    facts = describe(load(path))
    twists = {joint["joint"]: joint["twists"] for joint in facts["body"]["joints"]}
    assert twists["LeftForeArmTwist02"] == "LeftForeArm"
    assert twists["LeftForeArm"] is None
    *_, shares, _, follow = text(facts).splitlines()
    assert shares.startswith("  take their share of a limb's twist or bend: ")
    assert "LeftArmTwist01 (LeftArm)" in shares
    assert follow == "  follow their parents: LeftBracelet, RightBracelet"


def test_a_loop_in_place_is_told_as_both(tmp_path: Path) -> None:
    rig = sample_rig("walker")
    stride = gait.walk(rig, 30.0).frames(20, 21 + round(30 * gait.stride_time(rig)))
    walk = from_canonical(stride)
    ahead = walk.root_pos[-1] - walk.root_pos[0]
    pace = float(np.linalg.norm(ahead)) / walk.duration
    in_place = walk.moved(-np.linspace(0, 1, len(walk))[:, None] * ahead)
    facts = []
    for name, motion in (("travels", walk), ("in_place", in_place), ("cut", walk.frames(0, 20))):
        write_bvh(encode_new(motion), tmp_path / f"{name}.bvh")
        facts.append(describe(load(tmp_path / f"{name}.bvh")))
    assert [each["loop"] for each in facts] == [True, True, False]
    travels, treadmill, cut = (each["treadmill_m_s"] for each in facts)
    assert travels is None
    assert cut is None
    assert abs(treadmill - pace) < 0.05 * pace
    assert f"as on a treadmill at {treadmill:.2f} m/s" in text(facts[1])
    assert "a loop" in text(facts[0])
