"""What `inspect` says of a body's joints."""

from pathlib import Path

import numpy as np

from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
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
