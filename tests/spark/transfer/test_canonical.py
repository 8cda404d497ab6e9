"""Laws of the canonical form: what it keeps, and what it no longer depends on."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.contacts import floor_height
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from spark.rig.tpose import find_tpose
from spark.rotation import quat_angle, quat_mul, quat_normalize, quat_rotate
from spark.skeleton import Skeleton
from spark.transfer.canonical import canonical_positions, from_canonical, to_canonical
from tests.helpers.rerig import along_x, rerig
from tests.helpers.stick import joint, standing, stick_rig


def under_a_root(rig: Rig, moves: bool) -> Rig:
    """The same rig below a root joint on the floor; its pelvis has position channels if `moves`."""
    skeleton = rig.skeleton
    roles = (None, *rig.roles.roles)
    return replace(
        rig,
        skeleton=Skeleton(
            ("root", *skeleton.names),
            np.concatenate([[-1], skeleton.parents + 1]),
            np.concatenate([np.zeros((1, 3)), skeleton.offsets]),
            np.concatenate([[True, moves], skeleton.translating[1:]]),
            skeleton.end_parents + 1,
            skeleton.end_offsets,
        ),
        roles=RoleMap(roles, (1.0,) * len(roles), ("by hand",) * len(roles)),
        tpose=np.concatenate([[[1.0, 0, 0, 0]], rig.tpose]),
        root_joint=1 if moves else 0,
    )


def wild(rig: Rig, frames: int = 7, *, root: bool, pelvis: bool) -> Motion:
    """All joints turn at random; root and pelvis wander where asked."""
    rng = np.random.default_rng(3)
    count = len(rig.skeleton)
    rotations = quat_normalize(rng.normal(size=(frames, count, 4)))
    root_pos = np.tile(rig.skeleton.offsets[0], (frames, 1))
    if root:
        root_pos = root_pos + rng.normal(size=(frames, 3))
    translations = None
    if pelvis:
        translations = np.tile(rig.skeleton.offsets, (frames, 1, 1))
        translations[:, rig.pelvis] += rng.normal(size=(frames, 3))
        translations[:, 0] = root_pos
    return Motion(rig.skeleton, 1 / 60, root_pos, rotations, translations)


def test_a_motion_that_only_the_root_joint_moves_comes_back_whole() -> None:
    for rig in (stick_rig(), under_a_root(stick_rig(), moves=False)):
        motion = wild(rig, root=True, pelvis=False)
        back = from_canonical(to_canonical(motion, rig))
        assert np.abs(forward(back)[0] - forward(motion)[0]).max() < 1e-12
        assert back.translations is None
    rig = under_a_root(stick_rig(), moves=True)
    motion = wild(rig, root=False, pelvis=True)
    back = from_canonical(to_canonical(motion, rig))
    assert np.abs(forward(back)[0] - forward(motion)[0]).max() < 1e-12
    assert quat_angle(back.rotations, motion.rotations).max() < 1e-7


def test_a_body_comes_back_where_root_and_hips_both_move() -> None:
    """Two joints share the way through the world; one of them is enough to take it."""
    rig = under_a_root(stick_rig(), moves=True)
    motion = wild(rig, root=True, pelvis=True)
    back = from_canonical(to_canonical(motion, rig))
    body = list(rig.skeleton.subtree(rig.pelvis))
    assert np.abs(forward(back)[0][:, body] - forward(motion)[0][:, body]).max() < 1e-12
    assert np.abs(back.root_pos).max() == 0, "the root stays where it rests"


def test_positions_are_those_of_the_motion() -> None:
    rig = stick_rig()
    motion = wild(rig, root=True, pelvis=False)
    canonical = to_canonical(motion, rig)
    assert np.abs(canonical_positions(canonical) - forward(motion)[0]).max() < 1e-12
    hips = [joint(Role.LEFT_UPPER_LEG), joint(Role.RIGHT_UPPER_LEG)]
    assert np.abs(canonical.hips - forward(motion)[0][:, hips].mean(1)).max() < 1e-12


def test_the_tpose_has_no_rotation() -> None:
    for name in ("walker", "dancer"):
        rig = sample_rig(name)
        canonical = to_canonical(wild(rig, root=True, pelvis=False), rig)
        still = replace(
            canonical, rotations=np.tile([1.0, 0, 0, 0], (*canonical.rotations.shape[:2], 1))
        )
        _, world = forward(from_canonical(still))
        assert quat_angle(world, rig.tpose).max() < 1e-7


@pytest.mark.parametrize("quarters", [(0, 0), (1, 3)])
def test_local_axes_do_not_matter(quarters: tuple[int, int]) -> None:
    """A file with other local axes, and so another rest pose, has the same canonical form, and one
    whose T-pose had to be found from the motion has it but for feet and clavicles."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0)
    axes = along_x(rig, quarters)
    other = rerig(motion, axes)
    known = replace(rig, skeleton=other.skeleton, tpose=quat_mul(rig.tpose, axes))
    a, b = to_canonical(motion, rig), to_canonical(other, known)
    assert quat_angle(a.rotations, b.rotations).max() < 1e-6
    assert np.abs(a.hips - b.hips).max() < 1e-9
    assert abs(a.floor_z - b.floor_z) < 1e-9
    found = replace(known, tpose=find_tpose(other, rig.roles)[0])
    limbs = [j for j, role in enumerate(rig.roles.roles) if "foot" not in str(role)]
    limbs = [j for j in limbs if "toe" not in str(rig.roles.roles[j])]
    c = to_canonical(other, found)
    assert np.degrees(quat_angle(a.rotations, c.rotations)[:, limbs]).max() < 1


def test_the_floor_is_under_the_soles() -> None:
    rig = stick_rig()
    assert abs(to_canonical(standing(rig, 5), rig).floor_z) < 1e-12
    raised = replace(standing(rig, 5), root_pos=np.tile([0.0, 0, 1.3], (5, 1)))
    assert abs(to_canonical(raised, rig).floor_z - 0.4) < 1e-12
    assert abs(floor_height(rig, *forward(raised)) - 0.4) < 1e-12


def test_turning_the_world_turns_the_canonical_form() -> None:
    rig = stick_rig()
    motion = wild(rig, root=True, pelvis=False)
    q = quat_normalize(np.array([0.9, 0.0, 0.0, -0.5]))
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_mul(q, rotations[:, 0])
    turned = replace(motion, root_pos=quat_rotate(q, motion.root_pos), rotations=rotations)
    a, b = to_canonical(motion, rig), to_canonical(turned, rig)
    assert quat_angle(quat_mul(q, a.rotations), b.rotations).max() < 1e-6
    assert np.abs(quat_rotate(q, a.hips) - b.hips).max() < 1e-12


def test_a_canonical_motion_is_frozen() -> None:
    rig = stick_rig()
    canonical = to_canonical(standing(rig, 2), rig)
    with pytest.raises(FrozenInstanceError):
        canonical.floor_z = 1.0  # type: ignore[misc]


def test_joints_that_nobody_asked_for_are_in_no_sum(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are left as memory was, which may hold any bits: a NaN that warns, say."""
    rig = sample_rig("walker")
    motion = to_canonical(sample_motion("walk", rig, 60.0).frames(0, 9), rig)
    everywhere, empty = canonical_positions(motion), np.empty

    def foul(*shape: object, **how: object) -> np.ndarray:
        out = empty(*shape, **how)
        if out.dtype == np.float64:
            out.view(np.uint64)[...] = 0x7FF0000000000001
        return out

    monkeypatch.setattr(np, "empty", foul)
    for j in range(len(rig.skeleton)):
        np.testing.assert_array_equal(canonical_positions(motion, [j])[:, 0], everywhere[:, j])
