"""Doubles of limbs: they go where their originals go, and nothing else is taken for one."""

from dataclasses import replace

import numpy as np
import pytest

from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.doubles import doubles_of
from spark.rig.nulls import nulls_of
from spark.rig.rig import understand
from spark.rig.roles import Role
from spark.rotation import quat_angle, quat_from_rotvec, quat_from_yaw, quat_rotate
from spark.skeleton import Skeleton
from spark.transfer.analytic import copied, transfer
from spark.transfer.canonical import from_canonical, to_canonical
from spark.transfer.foot_lock import lock_feet
from spark.transfer.leg_fit import fit_legs
from tests.helpers.rigs import RIGS, build, walk

# Of one leg: the original's joint, and its double's; `turn` doubles nothing but carries the double.
LEG = {"足": "turn", "ひざ": "ひざD", "足首": "足首D", "つま先": "足先EX"}


def with_doubles(shift: float = 0.0) -> Motion:
    """A model with a second chain beside each leg, `shift` [m] away from it, at rest."""
    skeleton, roles = build(RIGS["mikumikudance"])
    names, parents = list(skeleton.names), skeleton.parents.tolist()
    offsets = skeleton.offsets.tolist()
    for side in "左右":
        above = names.index("下半身")
        for own, beside in LEG.items():
            original = names.index(side + own)
            names.append(side + beside)
            parents.append(above)
            offsets.append((skeleton.offsets[original] + [shift * (own == "足"), 0, 0]).tolist())
            above = len(names) - 1
    made = Skeleton(
        tuple(names),
        np.array(parents),
        np.array(offsets),
        np.arange(len(names)) == 0,
        skeleton.end_parents,
        skeleton.end_offsets,
    )
    return walk(made, roles + (None,) * (len(names) - len(roles)), frames=2)


def pairs(skeleton: Skeleton) -> list[tuple[int, int]]:
    """Each double and its original."""
    names = skeleton.names
    return [
        (names.index(side + beside), names.index(side + own))
        for side in "左右"
        for own, beside in LEG.items()
    ]


def onto(target: Motion) -> Motion:
    """A walk of another body on the rig of `target`, as `retarget` does it."""
    walking = walk(*build(RIGS["mixamo"]), frames=60)
    source = to_canonical(walking, understand(walking))
    moved = transfer(source, understand(target))
    return from_canonical(lock_feet(source, fit_legs(source, moved)))


def test_doubles_go_where_their_originals_go() -> None:
    out = onto(with_doubles())
    positions, _ = forward(out)
    for double, own in pairs(out.skeleton):
        np.testing.assert_allclose(positions[:, double], positions[:, own], atol=2e-3)
    ankle = out.skeleton.names.index("左足首D")
    assert np.ptp(positions[:, ankle], axis=0).max() > 0.1


def test_doubles_of_feet_head_where_their_originals_head() -> None:
    """Of a body whose feet rest outwards, beside that of the source."""
    walking, target = walk(*build(RIGS["mixamo"]), frames=2), with_doubles()
    skeleton = target.skeleton
    offsets = skeleton.offsets.copy()
    for j, name in enumerate(skeleton.names):
        if name[1:] in ("つま先", "足先EX"):
            outwards = quat_from_yaw(np.radians(18.0 if name[0] == "左" else -18.0))
            offsets[j] = quat_rotate(outwards, offsets[j])
    rig = understand(replace(target, skeleton=replace(skeleton, offsets=offsets)))
    source = to_canonical(walking, understand(walking))
    turns = transfer(source, rig).rotations
    feet = [pair for pair in pairs(rig.skeleton) if skeleton.names[pair[1]][1:] == "足首"]
    assert quat_angle(turns, copied(source, rig).rotations)[:, feet].min() > np.radians(15)
    for double, own in pairs(rig.skeleton):
        np.testing.assert_allclose(turns[:, double], turns[:, own], atol=1e-12)


def test_a_chain_elsewhere_is_no_double() -> None:
    """Twin: a skirt's bones, a hand's breadth before the legs."""
    rig = understand(with_doubles(0.1))
    assert rig.doubles == {}
    assert len(understand(with_doubles()).doubles) == 2 * len(LEG)


def test_a_rig_in_another_pose_than_t() -> None:
    """Legs that rest apart: their doubles stand in the T-pose with them."""
    motion = with_doubles()
    spread, offsets = np.radians(20), motion.skeleton.offsets.copy()
    for j, name in enumerate(motion.skeleton.names):
        if "ひざ" in name or "足首" in name:
            side = 1 if name[0] == "左" else -1
            length = np.linalg.norm(offsets[j])
            offsets[j] = [0, side * length * np.sin(spread), -length * np.cos(spread)]
    rig = understand(replace(motion, skeleton=replace(motion.skeleton, offsets=offsets)))
    places = rig.tpose_positions
    for double, own in pairs(rig.skeleton):
        np.testing.assert_allclose(places[double], places[own], atol=2e-3)


def test_a_bodys_own_motion_keeps_its_doubles_as_they_are() -> None:
    """Whatever they do: the file says it."""
    motion = with_doubles()
    turns = np.zeros((2, len(motion.skeleton), 3))
    turns[1, motion.skeleton.names.index("左ひざD")] = [0, 0.5, 0]
    motion = replace(motion, rotations=quat_from_rotvec(turns))
    rig = understand(motion)
    back = from_canonical(transfer(to_canonical(motion, rig), rig))
    np.testing.assert_allclose(forward(back)[0], forward(motion)[0], atol=1e-9)


@pytest.mark.parametrize("name", RIGS)
def test_no_rig_without_a_second_chain_has_doubles(name: str) -> None:
    skeleton, roles = build(RIGS[name])
    assert doubles_of(skeleton, roles).keys() <= nulls_of(skeleton).keys()


def test_what_is_held_in_a_hand_is_no_double() -> None:
    """A prop where the wrist is, on the forearm: nothing goes on below it."""
    skeleton, roles = build(RIGS["mixamo"])
    hand = list(roles).index(Role.LEFT_HAND)
    held = Skeleton(
        (*skeleton.names, "sword"),
        np.append(skeleton.parents, skeleton.parents[hand]),
        np.vstack([skeleton.offsets, skeleton.offsets[hand]]),
        np.append(skeleton.translating, False),
    )
    assert doubles_of(held, (*roles, None)) == {}
