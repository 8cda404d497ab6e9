"""VRM: avatars as targets, and motions for avatars, read again and as three-vrm plays them."""

from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.errors import SkeletonError
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.io.gltf_file import GltfFile
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.roles import Role
from spark.rig.vrm_bones import bones_of_rig
from spark.transfer.humanoid import on_bones
from spark_sim import Clip
from tests.helpers.node import in_three, needs, validated
from tests.helpers.smpl import model_rig
from tests.helpers.vrm import avatar

TIMES = (0.0, 0.4, 0.9)  # [s]


def test_what_is_written_is_read_again(walk: Clip, tmp_path: Path) -> None:
    """Bones by VRM's names, in the T-pose at rest, each where it is in the motion."""
    back = spark_sim.load(walk.save(tmp_path / "walk.vrma"))
    assert isinstance(back, Clip)
    bones = bones_of_rig(walk.rig)
    assert set(back.joint_names) == set(bones)
    theirs, _ = forward(back.motion)
    ours, _ = forward(walk.motion)
    floor = [0, 0, walk.canonical.floor_z]
    for bone, joint in bones.items():
        at = theirs[:, back.joint_names.index(bone)]
        if bone in ("hips", "head") or "Upper" in bone or "Lower" in bone:
            np.testing.assert_allclose(at, ours[:, joint] - floor, atol=2e-3, err_msg=bone)
    assert back.fps == pytest.approx(walk.fps)
    # At rest it is the T-pose: arms straight out along Y, legs down, as high as it stands.
    rest = dict(zip(back.joint_names, back.motion.skeleton.rest_positions, strict=True))
    arm = rest["leftHand"] - rest["leftUpperArm"]
    leg = rest["leftFoot"] - rest["leftUpperLeg"]
    assert arm[1] > 0.98 * np.linalg.norm(arm)
    assert -leg[2] > 0.98 * np.linalg.norm(leg)
    middle = (rest["leftUpperLeg"] + rest["rightUpperLeg"]) / 2
    assert middle[2] == pytest.approx(walk.rig.hip_height, abs=1e-6)


def test_bones_turn_in_the_world_as_in_the_motion(walk: Clip) -> None:
    """Whatever joints lie between two bones: each keeps its rotation since the T-pose."""
    bones = bones_of_rig(walk.rig)
    moved = on_bones(walk.canonical, bones)
    _, world = forward(moved)
    wanted = walk.canonical.rotations[:, list(bones.values())]
    dots = np.abs(np.sum(world * wanted, axis=-1))
    np.testing.assert_allclose(dots, 1, atol=1e-9)


def test_the_file_says_what_it_is(walk: Clip, tmp_path: Path) -> None:
    file = GltfFile(walk.save(tmp_path / "walk.vrma"))
    entry = file.json["extensions"]["VRMC_vrm_animation"]
    assert file.json["extensionsUsed"] == ["VRMC_vrm_animation"]
    assert entry["specVersion"] == "1.0"
    for bone, where in entry["humanoid"]["humanBones"].items():
        assert file.nodes[where["node"]]["name"] == bone
        assert "rotation" not in file.nodes[where["node"]]  # the T-pose
    moved = [c["target"] for c in file.json["animations"][0]["channels"]]
    hips = entry["humanoid"]["humanBones"]["hips"]["node"]
    assert {t["node"] for t in moved if t["path"] == "translation"} == {hips}


def test_khronos_validator_finds_no_error(walk: Clip, tmp_path: Path) -> None:
    needs("gltf-validator")
    (messages,) = validated(walk.save(tmp_path / "walk.vrma"))
    assert not [m for m in messages if m["severity"] < 2], messages


def test_three_vrm_moves_an_avatar_as_it_moves_here(walk: Clip, tmp_path: Path) -> None:
    """On an avatar with the walker's own body, whose nodes have any axes. Its hips' path is scaled
    by the height of its hips at rest, as the format has it."""
    needs("three")
    avatar(walk.motion).write(tmp_path / "walker.vrm")
    body = spark_sim.load(tmp_path / "walker.vrm")
    moved = spark_sim.retarget(walk, body)
    assert isinstance(moved, Clip)
    moved.save(tmp_path / "walk.vrma")
    asked = {"avatar": "walker.vrm", "file": "walk.vrma", "times": ",".join(map(str, TIMES))}
    seen = in_three("vrma.html", tmp_path, **asked)
    positions, _ = forward(moved.motion)
    bones = bones_of_rig(moved.rig)
    theirs = body.motion.skeleton.rest_positions[bones["hips"], 2]
    height = GltfFile(tmp_path / "walk.vrma").nodes[0]["translation"][1]
    for time, frame in zip(TIMES, seen["frames"], strict=True):
        there = positions[round(time * moved.fps)] - [0, 0, moved.canonical.floor_z]
        there = there + (theirs / height - 1) * there[bones["hips"]]
        for bone, joint in bones.items():
            np.testing.assert_allclose(
                frame[bone], there[joint][[1, 2, 0]], atol=2e-3, err_msg=f"{bone} at {time} s"
            )


@pytest.mark.parametrize("version", [0, 1])
def test_the_roles_of_a_vrm_are_those_that_it_says(
    version: int, walk: Clip, tmp_path: Path
) -> None:
    """Whatever its nodes are called, and though no animation and no skin names some of them."""
    names = tuple(f"b{j}" for j in range(len(walk.joint_names)))
    path = avatar(walk.motion, version=version, names=names).write(tmp_path / "odd.vrm")
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    order = [names.index(name) for name in clip.joint_names]
    said = {order[j]: role for j, role in enumerate(clip.rig.roles.roles) if role is not None}
    for role in Role:
        if role not in (Role.SPINE, Role.NECK):
            assert [j for j in said if said[j] is role] == list(walk.rig.roles.joints(role))
    given = [r for r, why in zip(clip.rig.roles.roles, clip.rig.roles.reasons, strict=True)
             if why == "given by the map"]  # fmt: skip
    assert len(given) >= 18


def test_all_fingers_have_their_bones(tmp_path: Path) -> None:
    """Of a body with fifteen joints a hand, through VRMA and back."""
    body = model_rig(52, 1.7)
    still = np.tile([1.0, 0, 0, 0], (2, len(body.skeleton), 1))
    motion = Motion(body.skeleton, 1 / 30, np.tile([0.0, 0, 0.95], (2, 1)), still)
    write_bvh(encode_new(motion, unit="m", up="z"), tmp_path / "hands.bvh")
    clip = spark_sim.load(tmp_path / "hands.bvh", unit="m", up="z")
    assert isinstance(clip, Clip)
    bones = bones_of_rig(clip.rig)
    for side in ("left", "right"):
        for finger in ("Index", "Middle", "Ring", "Little"):
            for bone in ("Proximal", "Intermediate", "Distal"):
                assert f"{side}{finger}{bone}" in bones
        for bone in ("Metacarpal", "Proximal", "Distal"):
            assert f"{side}Thumb{bone}" in bones
    back = spark_sim.load(clip.save(tmp_path / "hands.vrma"))
    assert isinstance(back, Clip)
    assert len(back.rig.fingers) == 30


def test_what_has_no_hands_is_no_avatar(tmp_path: Path, walk: Clip) -> None:
    from dataclasses import replace

    rig = walk.rig
    roles = replace(
        rig.roles,
        roles=tuple(None if r and r.part == "hand" else r for r in rig.roles.roles),
    )
    with pytest.raises(SkeletonError, match="leftHand"):
        bones_of_rig(replace(rig, roles=roles))
