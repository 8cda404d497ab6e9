"""What a converter makes up beyond the toes says nothing of them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from spark.rig.feet import hip_height, human_soles
from spark.rig.roles import Role, RoleMap
from spark.rig.toes import toe_points
from spark.rig.tpose import find_tpose
from spark.rotation import quat_angle, quat_mul
from spark.skeleton import Skeleton
from tests.helpers.rerig import along_x, rerig

RIG = sample_rig("walker")
WALK = sample_motion("walk", RIG, 30.0)
TOES = [RIG.roles.require(role) for role in (Role.LEFT_TOE, Role.RIGHT_TOE)]
ASTRAY = {
    "up": [0.0, 0.0, 0.1],
    "down": [0.0, 0.0, -0.1],
    "back": [-0.1, 0.0, 0.02],
    "aside": [0.0, 0.1, 0.0],
    "a millimetre": [0.0005, 0.0, 0.001],
}


def ending(skeleton: Skeleton, tip: list[float]) -> Skeleton:
    """Toes that end there [m, from the toe joint in the T-pose, whose axes are the world's]."""
    ends = skeleton.end_offsets.copy()
    ends[np.isin(skeleton.end_parents, TOES)] = tip
    return replace(skeleton, end_offsets=ends)


def spread(skeleton: Skeleton, tip: list[float]) -> Skeleton:
    """Three toes on each toe joint; each ends in a bone to there [m], which has an End Site too."""
    names, parents, offsets = list(skeleton.names), skeleton.parents.tolist(), []
    for toe in TOES:
        for k, aside in enumerate((-0.02, 0.0, 0.02)):
            names += [f"{names[toe]} {k}", f"{names[toe]} {k} bone"]
            parents += [toe, len(parents)]
            offsets += [[0.02, aside, 0.0], tip]
    leaves = list(range(len(skeleton) + 1, len(names), 2))
    kept = ~np.isin(skeleton.end_parents, TOES)
    return Skeleton(
        tuple(names),
        np.array(parents),
        np.concatenate([skeleton.offsets, offsets]),
        np.arange(len(names)) == 0,
        np.concatenate([skeleton.end_parents[kept], leaves]),
        np.concatenate([skeleton.end_offsets[kept], [tip] * len(leaves)]),
    )


def beside(skeleton: Skeleton, tip: list[float]) -> Skeleton:
    """A joint beside each toe joint, as Character Creator's share bones, ends there [m]."""
    more = [len(skeleton), len(skeleton) + 1]
    return Skeleton(
        (*skeleton.names, *(f"{skeleton.names[toe]} share" for toe in TOES)),
        np.concatenate([skeleton.parents, skeleton.parents[TOES]]),
        np.concatenate([skeleton.offsets, skeleton.offsets[TOES]]),
        np.arange(len(skeleton) + 2) == 0,
        np.concatenate([skeleton.end_parents, more]),
        np.concatenate([skeleton.end_offsets, [tip] * 2]),
    )


def found(skeleton: Skeleton) -> tuple[np.ndarray, float]:
    """How far [rad] each toe's T-pose is from the true one, and how high [m] hips come out, where
    the rest pose shows neither: all bones lie along one axis."""
    more = len(skeleton) - len(RIG.skeleton)
    count, still = len(skeleton), np.tile([1.0, 0.0, 0.0, 0.0], (more, 1))
    roles = RoleMap((*RIG.roles.roles, *[None] * more), (1.0,) * count, ("",) * count)
    rig = replace(RIG, skeleton=skeleton, roles=roles, tpose=np.concatenate([RIG.tpose, still]))
    rotations = np.concatenate([WALK.rotations, np.tile(still, (len(WALK), 1, 1))], axis=1)
    axes = along_x(rig, (1, 2))
    motion = rerig(Motion(skeleton, WALK.frame_time, WALK.root_pos, rotations), axes)
    tpose, (note, *_) = find_tpose(motion, roles)
    assert "found from the motion" in note
    away = quat_angle(tpose, quat_mul(rig.tpose, axes))[TOES]
    return away, hip_height(motion.skeleton, roles, tpose)


@pytest.mark.parametrize("tip", ASTRAY.values(), ids=ASTRAY)
@pytest.mark.parametrize("ended", [ending, spread, beside])
def test_toes_are_level_whatever_they_end_in(
    ended: Callable[[Skeleton, list[float]], Skeleton], tip: list[float]
) -> None:
    """Within what toes bend in the mean of a walk; the hips, within what the tips gave: 1.7 cm."""
    away, height = found(ended(RIG.skeleton, tip))
    assert np.degrees(away).max() < 15
    assert height == pytest.approx(RIG.hip_height, abs=0.02)


@pytest.mark.parametrize("tip", ASTRAY.values(), ids=ASTRAY)
def test_hips_are_as_high_as_they_rest_whatever_toes_end_in(tip: list[float]) -> None:
    height = hip_height(ending(RIG.skeleton, tip), RIG.roles, RIG.tpose)
    assert height == pytest.approx(RIG.hip_height, abs=0.02)


def test_toes_that_go_on_as_their_feet_do_are_believed() -> None:
    """Laid level by their own direction: a tip that slopes by 40 degrees turns them by as much."""
    rest = RIG.skeleton
    away, _ = found(ending(rest, [0.05, 0.0, -0.042]))
    assert np.degrees(away) == pytest.approx(40, abs=3)
    for skeleton in (rest, spread(rest, [0.01, 0.004, 0.0])):
        places = skeleton.rest_positions
        tips = places[skeleton.end_parents] + skeleton.end_offsets
        for toe in TOES:
            joints, ends = toe_points(skeleton, toe, places, tips, np.array([1.0, 0.0, -0.5]))
            assert joints == list(skeleton.subtree(toe)[1:])
            assert len(ends) == (3 if joints else 1)


@pytest.mark.parametrize("name", ["LeftToe_End", "Bip01 L Toe0Nub", "toe_tip_L"])
def test_toes_end_where_a_joint_is_named_their_end(name: str) -> None:
    """Some converters put an End Site ahead of it, too: soles were as much longer, and dipped."""
    rest, count = RIG.skeleton, len(RIG.skeleton)
    tips = [rest.end_parents.tolist().index(toe) for toe in TOES]
    parents, offsets = rest.end_parents.copy(), rest.end_offsets.copy()
    parents[tips] = count, count + 1
    longer = Skeleton(
        (*rest.names, name, name.replace("L", "R")),
        np.concatenate([rest.parents, TOES]),
        np.concatenate([rest.offsets, offsets[tips]]),
        np.arange(count + 2) == 0,
        parents,
        offsets,  # as far again
    )
    roles = RoleMap((*RIG.roles.roles, None, None), (1.0,) * len(longer), ("",) * len(longer))
    tpose = np.concatenate([RIG.tpose, np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))])
    soles = human_soles(longer, roles, tpose, RIG.hip_height)
    for sole, own in zip(soles, RIG.soles, strict=True):
        assert sole.offsets == pytest.approx(own.offsets, abs=1e-9)
