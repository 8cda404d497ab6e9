"""The network that ships, on recordings: it beats the transfer where it knows the rig."""

from dataclasses import replace

import numpy as np
import pytest

from spark.inference.weights import SHIPPED, read_weights
from spark.io.reading import read_motion
from spark.network.retarget import NetworkRetargeter
from spark.rig.rig import understand
from spark.rig.roles import Role
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from tests.helpers.recordings import recording
from tests.helpers.stick import without


@pytest.fixture(scope="module")
def network() -> NetworkRetargeter:
    return NetworkRetargeter(read_weights(SHIPPED))


def motion_of(name: str) -> CanonicalMotion:
    motion = read_motion(recording(name)).motion
    motion = motion.frames(0, min(len(motion), 300))
    return to_canonical(motion, understand(motion))


def over_the_hips(motion: CanonicalMotion) -> np.ndarray:
    return canonical_positions(motion) - motion.hips[:, None]


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("reactidle/000_genuine.bvh", 0.5),
        ("cmu_asf/cmu_02_01.bvh", 0.5),
        ("cmu_asf/cmu_03_01.bvh", 0.8),  # whom training has not seen
    ],
)
def test_a_neck_and_a_spine_that_the_source_lacks(
    network: NetworkRetargeter, name: str, most: float
) -> None:
    truth = motion_of(name)
    rig = truth.rig
    topmost = rig.roles.joints(Role.SPINE)[-1]
    lacking = without(rig, Role.NECK, Role.SPINE)
    roles = tuple(Role.SPINE if j == topmost else r for j, r in enumerate(lacking.roles.roles))
    source = replace(truth, rig=replace(lacking, roles=replace(lacking.roles, roles=roles)))
    copied, filled = (
        np.square(over_the_hips(moved) - over_the_hips(truth)).mean()
        for moved in (transfer(source, rig), network(source, rig))
    )
    assert filled < most * copied


def test_a_rig_that_it_has_not_met_is_left_to_the_transfer(network: NetworkRetargeter) -> None:
    truth = motion_of("zoo/m2m_human.bvh")
    source = replace(truth, rig=without(truth.rig, Role.NECK))
    moved = network(source, truth.rig)
    assert moved.notes[-1].startswith("no counterpart in the source: 'DEF-neck'")
    np.testing.assert_array_equal(moved.rotations, transfer(source, truth.rig).rotations)
