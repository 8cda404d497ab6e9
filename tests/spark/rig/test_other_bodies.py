"""Two bodies in one tree are told, and nothing else is taken for a second one."""

import numpy as np
import pytest

from spark.motion import Motion
from spark.rig.other_bodies import other_bodies
from spark.rig.rig import understand
from spark.rig.role_assignment import assign_roles
from spark.skeleton import Skeleton
from tests.helpers.rigs import RIGS, build, walk


def side_by_side(*bodies: Motion, apart: float = 1.5) -> Motion:
    """The bodies below one joint of the scene, each `apart` [m] from the one before."""
    skeletons = [body.skeleton for body in bodies]
    starts = 1 + np.cumsum([0, *map(len, skeletons)])
    names, parents, offsets, rotations = ["World"], [-1], [np.zeros((1, 3))], []
    for k, (start, body) in enumerate(zip(starts, bodies, strict=False)):
        skeleton = body.skeleton
        names += [f"{'ABC'[k]}:{name}" for name in skeleton.names]
        parents += [0, *(int(parent) + int(start) for parent in skeleton.parents[1:])]
        offsets.append(
            skeleton.offsets + np.outer(np.arange(len(skeleton)) == 0, [0, k * apart, 0])
        )
        rotations.append(body.rotations)
    still = np.broadcast_to([1.0, 0, 0, 0], (len(bodies[0]), 1, 4))
    made = Skeleton(
        tuple(names),
        np.array(parents),
        np.concatenate(offsets),
        np.isin(np.arange(len(names)), starts[:-1]) | (np.arange(len(names)) == 0),
        np.concatenate([s.end_parents + n for s, n in zip(skeletons, starts, strict=False)]),
        np.concatenate([s.end_offsets for s in skeletons]),
    )
    root = np.zeros((len(bodies[0]), 3))
    return Motion(made, 1 / 30, root, np.concatenate([still, *rotations], axis=1))


def others(motion: Motion) -> list[str]:
    found = other_bodies(motion, assign_roles(motion.skeleton, motion))
    return [motion.skeleton.names[j] for j in found]


@pytest.fixture
def one() -> Motion:
    return walk(*build(RIGS["lafan1"]))


def test_each_body_beside_the_one_that_is_used(one: Motion) -> None:
    assert others(side_by_side(one, one)) == ["B:Hips"]
    assert others(side_by_side(one, one, one)) == ["B:Hips", "C:Hips"]
    rig = understand(side_by_side(one, one))
    assert {rig.skeleton.names[j][:2] for j in rig.roles.held} == {"A:"}
    (note,) = (note for note in rig.notes if "several bodies" in note)
    assert "'A:Hips' is used, and not 'B:Hips'" in note


def test_a_body_over_again_in_its_place_is_none(one: Motion) -> None:
    assert not others(side_by_side(one, one, apart=0.0))


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_is_one_body(name: str) -> None:
    motion = walk(*build(RIGS[name]), frames=4)
    assert not others(motion)
