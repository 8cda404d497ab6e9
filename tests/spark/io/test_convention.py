"""Unit and up axis: inferred from what a file holds, or given."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spark.errors import ConventionError
from spark.io.bvh import Bvh, write_bvh
from spark.io.bvh_hierarchy import BvhJoint
from spark.io.convention import UNITS
from spark.io.encoding import encode, encode_new
from spark.io.recording import read_recording
from spark.kinematics import forward
from spark.motion import Motion
from spark.rotation import quat_identity
from spark.skeleton import Skeleton
from tests.helpers.bvh_by_hand import by_hand, human, save, to_file, zxy
from tests.helpers.recordings import recording
from tests.helpers.rigs import RIGS, build, walk

# What each set is, as its README says. fair1 is about 3.5 to 4 cm: between inch and CMU's unit.
CONVENTIONS = {
    "cmu_asf/*": ("cm", "y"),
    "cmu_expmap/*": ("cmu", "y"),
    "reactidle/*": ("m", "y"),
    "mesh2motion/*": ("m", "y"),
    "makehuman/*": ("dm", "z"),
    "animateddrawings/jesse_dance": ("cm", "y"),
    "animateddrawings/jumping_jacks": ("cmu", "y"),
    "animateddrawings/dab": ("cmu", "z"),
    "zoo/ad_cmu1": ("cmu", "y"),
    "zoo/ad_fair1_zup": ("cmu", "z"),
    "zoo/ad_rokoko_mixamo": ("cm", "y"),
    "zoo/cmu_asf_cm": ("cm", "y"),
    "zoo/cmu_cgspeed_31j": ("cmu", "y"),
    "zoo/cmu_max_131": ("cmu", "y"),
    "zoo/cmu_scaled_metre": ("m", "y"),
    "zoo/m2m_*": ("m", "y"),
    "zoo/makehuman_*": ("dm", "z"),
    "zoo/reactidle_blender": ("m", "y"),
}


@pytest.mark.parametrize("pattern", CONVENTIONS)
def test_conventions_of_recordings_are_inferred(pattern: str) -> None:
    folder = recording(pattern).parent
    paths = sorted(folder.glob(recording(pattern).name + ".bvh"))
    assert paths
    for path in paths[:: 1 + len(paths) // 12]:
        found = read_recording(path)
        assert (found.convention.unit, found.convention.up) == CONVENTIONS[pattern], path


@pytest.mark.parametrize("unit", sorted(UNITS.keys() - {"ft"}))
@pytest.mark.parametrize("tall", [1.3, 1.5, 1.8, 2.0])
def test_people_of_all_sizes_show_the_unit(tmp_path: Path, unit: str, tall: float) -> None:
    found = read_recording(save(human("z", UNITS[unit], scale=tall / 1.7), tmp_path))
    assert (found.convention.unit, found.convention.up) == (unit, "z")
    assert f"unit {unit} " in found.notes[0]


@pytest.mark.parametrize("tall", [1.3, 1.5, 1.8, 2.0])
def test_people_in_feet_are_pointed_out(tmp_path: Path, tall: float) -> None:
    """They may as well be giants in metres, or infants in decimetres."""
    path = save(human("z", UNITS["ft"], scale=tall / 1.7), tmp_path)
    assert any("--unit ft" in note for note in read_recording(path).notes)
    given = read_recording(path, unit="ft")
    metres = read_recording(save(human("z", 1.0, scale=tall / 1.7), tmp_path))
    np.testing.assert_allclose(
        given.motion.skeleton.offsets, metres.motion.skeleton.offsets, atol=1e-4
    )
    assert not any("--unit ft" in note for note in metres.notes)


@pytest.mark.parametrize("name", RIGS)
def test_rigs_of_the_ecosystem_show_unit_and_axis(tmp_path: Path, name: str) -> None:
    """Whatever else carries a foot's name: goals of inverse kinematics, footsteps, controls."""
    walking = walk(*build(RIGS[name]), frames=10)
    for unit, up in (("cm", "y"), ("m", "z")):
        write_bvh(encode_new(walking, unit=unit, up=up), tmp_path / "rig.bvh")
        found = read_recording(tmp_path / "rig.bvh")
        assert (found.convention.unit, found.convention.up) == (unit, up)


def test_a_foot_on_a_single_bone_shows_the_height_all_the_same(tmp_path: Path) -> None:
    """Of a body whose legs have no knees."""
    joints = [("hips", -1, (0.0, 0.0, 0.0)), ("head", 0, (0.0, 0.0, 0.7))]
    joints += [(f"{side}_foot", 0, (0.0, y, -0.9)) for side, y in (("l", 0.1), ("r", -0.1))]
    size = len(joints)
    skeleton = Skeleton(
        tuple(name for name, _, _ in joints),
        np.array([parent for _, parent, _ in joints]),
        np.array([place for _, _, place in joints]),
        np.arange(size) == 0,
    )
    still = Motion(
        skeleton, 1 / 30, np.array([[0, 0, 0.9]] * 2), quat_identity(np.zeros((2, size, 1)))
    )
    write_bvh(encode_new(still, unit="cm", up="y"), tmp_path / "doll.bvh")
    found = read_recording(tmp_path / "doll.bvh")
    assert (found.convention.unit, found.convention.up) == ("cm", "y")
    assert "from its head to its feet: 1.6" in found.notes[0]


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("away", [0.0, 12.0, 500.0])
def test_a_body_far_from_its_reference_shows_unit_and_axis(
    tmp_path: Path, away: float, named: bool
) -> None:
    """The way from a joint that stays at the origin to the hips is no bone of the body."""
    bvh = human("z")
    joints = tuple(
        replace(j, name=j.name if named else f"b{i}", parent=j.parent + 1)
        for i, j in enumerate(bvh.joints)
    )
    reference = BvhJoint("Reference", -1, (0.0, 0.0, 0.0), ("Zrotation",))
    values = np.insert(bvh.values, 0, 0.0, axis=1)
    values[:, 1:4] += np.array([away, -away, 1.0]) / 0.01
    found = read_recording(save(Bvh((reference, *joints), 0.1, values), tmp_path))
    alone = read_recording(
        save(replace(bvh, joints=tuple(replace(j, parent=j.parent - 1) for j in joints)), tmp_path)
    )
    assert (found.convention.unit, found.convention.up) == ("cm", "z")
    assert found.notes[0] == alone.notes[0]


def test_a_size_between_two_units_is_pointed_out(tmp_path: Path) -> None:
    found = read_recording(save(human("y", 0.0375), tmp_path))
    assert {found.convention.unit, "inch"} == {"cmu", "inch"}
    assert "unit inch (1.10 m) is nearly as likely" in " ".join(found.notes)


@pytest.mark.parametrize("tall", [0.85, 0.95, 1.1])
def test_children_are_in_centimetres_not_giants_in_inches(tmp_path: Path, tall: float) -> None:
    found = read_recording(save(human("y", 0.01, scale=tall / 1.7), tmp_path))
    assert found.convention.unit == "cm"


def test_a_child_that_may_be_an_adult_in_inches_is_pointed_out(tmp_path: Path) -> None:
    found = read_recording(save(human("y", 0.01, scale=0.8 / 1.7), tmp_path))
    assert found.convention.unit in ("cm", "inch")
    said = re.search(r"unit (\w+) \(\d\.\d+ m\) is nearly as likely", " ".join(found.notes))
    assert said is not None
    assert {found.convention.unit, said[1]} == {"cm", "inch"}


@pytest.mark.parametrize("tall", [0.5, 0.7, 1.7])
def test_programs_that_know_centimetres_alone_are_told_by_their_names(
    tmp_path: Path, tall: float
) -> None:
    body = human("y", 0.01, scale=tall / 1.7)
    named = tuple(replace(j, name=f"mixamorig:{j.name}") for j in body.joints)
    found = read_recording(save(replace(body, joints=named), tmp_path))
    assert found.convention.unit == "cm"
    metres = human("y", 1.0, scale=tall / 1.7)  # as Blender writes it
    named = tuple(replace(j, name=f"mixamorig:{j.name}") for j in metres.joints)
    assert read_recording(save(replace(metres, joints=named), tmp_path)).convention.unit == "m"


def test_a_height_no_human_has_is_pointed_out(tmp_path: Path) -> None:
    found = read_recording(save(human("y", 1.0, scale=60), tmp_path), up="y")
    assert found.convention.unit == "cm"
    found = read_recording(save(human("y", 1.0, scale=3), tmp_path), up="y")
    assert " ".join(found.notes).count("no human's height") == 1


@pytest.mark.parametrize(("rest", "up"), [("z", "y"), ("x", "y"), ("y", "z")])
def test_the_motion_and_not_the_rest_pose_shows_what_is_up(
    tmp_path: Path, rest: str, up: str
) -> None:
    """The rest pose stands along `rest`; the root's rotation stands it along `up`."""
    bvh = human(rest)
    turn = Rotation.align_vectors([np.eye(3)["xyz".index(up)]], [np.eye(3)["xyz".index(rest)]])[0]
    values = bvh.values.copy()
    values[:, :3] = to_file((0.3, 0.5, 0.93), up, 0.01)
    values[:, 3:6] = zxy(turn)
    found = read_recording(save(Bvh(bvh.joints, 0.1, values), tmp_path))
    assert found.convention.up == up
    positions, _ = forward(found.motion)
    assert positions[0, 3, 2] - positions[0, 10, 2] == pytest.approx(1.52)  # head above foot


@pytest.mark.parametrize("heading", [90.0, -90.0])
@pytest.mark.parametrize("bent", [0.0, 30.0])
def test_a_walk_shows_what_is_up_however_the_rest_pose_is_built(
    tmp_path: Path, heading: float, bent: float
) -> None:
    """Of SMPL's rest pose, y up, in AMASS's world, z up: straight along x, so that one side of the
    body keeps to y = 0, on a floor that isn't at zero."""
    upright = Rotation.from_euler("z", heading, degrees=True) * Rotation.from_euler(
        "x", 90.0 + bent, degrees=True
    )
    bvh = human("y", turns=np.tile(zxy(upright), (30, 1)))
    bvh.values[:, 0] = np.linspace(-60.0, 60.0, 30)
    bvh.values[:, 1:3] = 75.0, 120.0
    found = read_recording(save(bvh, tmp_path))
    assert found.convention.up == "z"
    assert not any("as likely" in note for note in found.notes)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_body_that_rolls_does_not_turn_the_world(tmp_path: Path, side: float) -> None:
    """Over and over along x, stretched along z: it travels across itself as who walks does."""
    angles = np.linspace(0.0, side * 4.0 * np.pi, 30)
    turns = Rotation.from_euler("z", angles[:, None]) * Rotation.from_euler("x", np.pi / 2)
    bvh = _arms_down(human("y", turns=zxy(turns)))
    bvh.values[:, 0], bvh.values[:, 1:3] = -15.0 * angles, (0.0, 200.0)
    lowest = np.array([by_hand(bvh, t)[:, 1].min() for t in range(30)])
    bvh.values[:, 1] -= lowest
    assert read_recording(save(bvh, tmp_path)).convention.up == "y"


def _arms_down(bvh: Bvh) -> Bvh:
    values = bvh.values.copy()
    for j, joint in enumerate(bvh.joints):
        if joint.name.endswith("Arm"):
            values[:, 3 + 3 * j] = -90.0 if joint.name.startswith("Left") else 90.0  # about z
    return Bvh(bvh.joints, bvh.frame_time, values)


@pytest.mark.parametrize("heading", [0.0, 30.0, 45.0, 90.0, 180.0])
def test_a_body_that_lies_on_the_floor_does_not_turn_the_world(
    tmp_path: Path, heading: float
) -> None:
    lying = Rotation.from_euler("YX", [heading, 90.0], degrees=True)
    turns = np.tile(zxy(lying), (4, 1))
    found = read_recording(save(human("y", turns=turns, root=(1.3, 2.2, 0.15)), tmp_path))
    assert found.convention.up == "y"


def test_a_body_that_lies_against_z_does_not_turn_the_world_over(tmp_path: Path) -> None:
    """On a bed, with its soles at zero. Its rest pose stands along y, and cameras' do as well as
    their frames do."""
    turns = np.tile([0.0, -90.0, 0.0], (4, 1))
    found = read_recording(save(human("y", turns=turns, root=(-0.93, 2.2, 0.4)), tmp_path))
    assert found.convention.up == "y"
    assert not any("as likely" in note for note in found.notes)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_cartwheel_on_a_collapsed_rig_does_not_turn_the_world(
    tmp_path: Path, side: float
) -> None:
    """Upside down half of the time, while its side passes through zero."""
    angles = np.linspace(0.0, 360.0, 30)
    turns = zxy(Rotation.from_euler("Z", side * angles[:, None], degrees=True))
    bvh = _folded(human("y", turns=turns, root=(1.0, 2.0, 1.1)))
    found = read_recording(save(bvh, tmp_path))
    assert found.convention.up == "y"


def _folded(bvh: Bvh) -> Bvh:
    """The same motion on a rig whose legs point up at rest, as every bone."""
    legs = [j for j, joint in enumerate(bvh.joints) if joint.name.endswith("UpLeg")]
    below = [j for j, joint in enumerate(bvh.joints) if joint.parent in legs]
    below += [j for j, joint in enumerate(bvh.joints) if joint.parent in below]
    joints = tuple(
        replace(joint, offset=(joint.offset[0], -joint.offset[1], joint.offset[2]))
        if j in below
        else joint
        for j, joint in enumerate(bvh.joints)
    )
    values = bvh.values.copy()
    values[:, [4 + 3 * j for j in legs]] = 180.0  # about x
    return Bvh(joints, bvh.frame_time, values)


@pytest.mark.parametrize("frames", [0, 1, 3])
def test_a_collapsed_rest_pose_turns_nothing_over(tmp_path: Path, frames: int) -> None:
    """Legs point up at rest, and may do so in a tenth of the frames."""
    bvh = _folded(human("y", turns=np.zeros((30, 3))))
    legs = [j for j, joint in enumerate(bvh.joints) if joint.name.endswith("UpLeg")]
    bvh.values[:frames, [4 + 3 * j for j in legs]] = 0.0
    found = read_recording(save(bvh, tmp_path))
    assert found.convention.up == "y"
    assert not any("as likely" in note for note in found.notes)


def test_what_cannot_be_known_is_called_a_guess(tmp_path: Path) -> None:
    bvh = human()
    joints = tuple(BvhJoint(f"b{j}", *_rest(joint)) for j, joint in enumerate(bvh.joints))
    notes = " ".join(read_recording(save(Bvh(joints, 0.1, bvh.values), tmp_path)).notes)
    assert "judged by its longest chain of bones" in notes
    assert "up axis y, a guess" in notes


def _rest(joint: BvhJoint) -> tuple[object, ...]:
    return joint.parent, joint.offset, joint.channels, joint.ends


def test_a_body_upside_down_is_pointed_out(tmp_path: Path) -> None:
    turns = np.tile([0.0, 180.0, 0.0], (4, 1))
    found = read_recording(save(human("y", turns=turns, root=(3.0, 2.0, 1.7)), tmp_path))
    assert found.convention.up == "y"
    assert "upside down along y; check, and give --up" in found.notes[-1]


def test_a_skeleton_in_one_point_needs_a_unit(tmp_path: Path) -> None:
    path = save(human(scale=0.0), tmp_path)
    with pytest.raises(ConventionError, match=f"{path}: all joints lie in one point.*--unit"):
        read_recording(path)
    assert read_recording(path, unit="m", up="y").motion.skeleton.offsets.max() == 0.0


@pytest.mark.parametrize("unit", ["yard", "", "nan", "-1", "0", 0.0, float("inf")])
def test_unknown_units_are_refused(tmp_path: Path, unit: str | float) -> None:
    with pytest.raises(ConventionError, match="expected one of m, cm, cmu, inch, mm, dm, ft"):
        read_recording(tmp_path / "never read", unit=unit)


def test_unknown_axes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConventionError, match="expected one of x, y, z"):
        read_recording(tmp_path / "never read", up="w")


def _turned(bvh: Bvh, turn: Rotation) -> Bvh:
    """The same file in turned axes: rest pose and motion."""

    def vector(v: np.ndarray) -> tuple[float, float, float]:
        x, y, z = turn.apply(v).tolist()
        return x, y, z

    joints = tuple(
        replace(j, offset=vector(j.offset), ends=tuple(map(vector, j.ends))) for j in bvh.joints
    )
    values = bvh.values.copy()
    values[:, :3] = turn.apply(values[:, :3])
    for columns in range(3, values.shape[1], 3):
        own = Rotation.from_euler("ZXY", values[:, columns : columns + 3], degrees=True)
        values[:, columns : columns + 3] = zxy(turn * own * turn.inv())
    return Bvh(joints, bvh.frame_time, values)


@pytest.mark.parametrize(
    ("up", "named"),  # by its build alone, -z is not told from a body on its back, y up
    [
        (up, named)
        for up in ("y", "z", "-y", "-z")
        for named in (True, False)
        if named or up != "-z"
    ],
)
def test_an_axis_may_point_down(tmp_path: Path, up: str, named: bool) -> None:
    """As a camera's y does: the body stands, and is written back as it was."""
    turns = np.array([[10.0, -5.0, 30.0], [0.0, 4.0, 35.0], [-8.0, 2.0, 44.0]])
    upright = human("y", turns=turns, root=(1.3, 2.2, 1.9))  # on no floor at zero
    goal = np.eye(3)["xyz".index(up[-1])] * (-1 if up.startswith("-") else 1)
    turn = (
        Rotation.align_vectors([goal, [1.0, 0, 0]], [[0, 1.0, 0], [0, 0, 1.0]])[0]
        if (up[-1] == "z")
        else Rotation.from_euler("X", 180 if up == "-y" else 0, degrees=True)
    )
    bvh = _turned(upright, turn)
    if not named:
        bvh = replace(bvh, joints=tuple(replace(j, name=f"b{i}") for i, j in enumerate(bvh.joints)))
    found = read_recording(save(bvh, tmp_path))
    assert (found.convention.up, found.convention.unit) == (up, "cm")
    assert any("points down" in note for note in found.notes) == up.startswith("-")
    known = read_recording(save(upright, tmp_path), up="y").motion
    (expected, _), (positions, _) = forward(known), forward(found.motion)
    np.testing.assert_allclose(positions[..., 2], expected[..., 2], atol=1e-6)
    spans = [np.linalg.norm(p[:, :, None] - p[:, None], axis=-1) for p in (positions, expected)]
    np.testing.assert_allclose(*spans, atol=1e-6)
    across = [np.cross(p[:, 8] - p[:, 12], p[:, 3] - p[:, 0]) for p in (positions, expected)]
    ahead = [
        np.sum(a * (p[:, 11] - p[:, 10]), -1)
        for a, p in zip(across, (positions, expected), strict=True)
    ]
    np.testing.assert_allclose(*ahead, atol=1e-6)  # not mirrored
    back, lost = encode(found.motion, found)
    assert lost == ()
    np.testing.assert_allclose(back.values[:, :3], found.bvh.values[:, :3], atol=1e-5)
    np.testing.assert_allclose(
        np.sin(np.radians(back.values[:, 3:] - found.bvh.values[:, 3:])), 0, atol=1e-6
    )


def test_a_given_convention_that_the_body_contradicts_is_pointed_out(tmp_path: Path) -> None:
    """It is taken all the same: a giant may be meant, and somebody who lies."""
    path = save(human("y", 0.01), tmp_path)
    right = read_recording(path, unit="cm", up="y")
    assert right.notes == ()
    wrong = read_recording(path, unit="m", up="z")
    assert (wrong.convention.unit, wrong.convention.up) == ("m", "z")
    assert "no human's height" in wrong.notes[0]
    assert "stands along y" in wrong.notes[1]
