"""How near a body is to those that a network has met: names and places of the trunk's joints."""

from dataclasses import replace

import pytest

from spark.demo.sample import sample_rig
from spark.network.features import BodyFeatures, body_features
from spark.network.known_bodies import distinct_trunks, similarity, trunk_of
from spark.rig.roles import Role


@pytest.fixture(scope="module")
def body() -> BodyFeatures:
    return body_features(sample_rig("dancer"))


def of_role(body: BodyFeatures, role: Role) -> list[int]:
    return [k for k, j in enumerate(body.joints) if body.rig.roles.roles[j] is role]


def changed(body: BodyFeatures, role: Role, move: tuple[float, float, float]) -> BodyFeatures:
    """With the first joint of a role elsewhere, and all that hangs on it."""
    offsets = body.skeleton.offsets.copy()
    offsets[of_role(body, role)[0]] += move
    return replace(body, skeleton=replace(body.skeleton, offsets=offsets))


@pytest.mark.parametrize(("apart", "expected"), [(0.0, 1.0), (0.03, 0.7), (0.1, 0.0), (0.5, 0.0)])
def test_the_further_off_the_less_is_known(
    body: BodyFeatures, apart: float, expected: float
) -> None:
    other = changed(body, Role.SPINE, (0, 0.6 * apart, 0.8 * apart))
    assert similarity(other, [trunk_of(body)]) == pytest.approx(expected, abs=0.003)
    far = trunk_of(changed(body, Role.SPINE, (0, 0, -0.09)))
    assert similarity(other, [far, trunk_of(body), far]) == similarity(other, [trunk_of(body)])


def test_names_count_and_limbs_do_not(body: BodyFeatures) -> None:
    names = tuple(f"{name}_" for name in body.skeleton.names)
    renamed = replace(body, skeleton=replace(body.skeleton, names=names))
    assert similarity(renamed, [trunk_of(body)]) == 0.0
    assert similarity(body_features(sample_rig("walker")), [trunk_of(body)]) == 0.0
    assert similarity(body, []) == 0.0
    for role in (Role.LEFT_FOREARM, Role.RIGHT_LOWER_LEG):
        assert similarity(changed(body, role, (0, 0.2, 0)), [trunk_of(body)]) == 1.0


def test_of_equal_bodies_one_is_kept(body: BodyFeatures) -> None:
    other = changed(body, Role.SPINE, (0, 0, 0.02))
    same = changed(body, Role.SPINE, (0, 0, 0.0002))
    assert distinct_trunks([body, other, same]) == [trunk_of(body), trunk_of(other)]
