"""Mass on a rig: sums to one, mirrors, lies where textbooks say, whatever the spine is made of."""

from dataclasses import replace

import numpy as np
import pytest

from spark.errors import SkeletonError
from spark.kinematics import forward
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from spark.rig.segments import Segments, segments
from spark.rotation import quat_rotate
from tests.helpers.stick import joint, standing, stick_rig


def coms_world(rig: Rig, parts: Segments) -> np.ndarray:
    pos, world = forward(standing(rig, 1))
    return pos[0, parts.joints] + quat_rotate(world[0, parts.joints], parts.coms)


def test_masses_sum_to_one_and_every_inertia_is_a_bodys() -> None:
    parts = segments(stick_rig())
    assert parts.masses.sum() == pytest.approx(1)
    for inertia in parts.inertias:
        np.testing.assert_allclose(inertia, inertia.T, atol=1e-12)
        moments = np.linalg.eigvalsh(inertia)
        assert moments[0] > 0
        assert moments[2] <= moments[0] + moments[1] + 1e-12


def test_the_body_mirrors_and_its_centre_of_mass_is_a_humans() -> None:
    rig = stick_rig()
    parts = segments(rig)
    com = parts.masses @ coms_world(rig, parts)
    assert com[1] == pytest.approx(0, abs=1e-12)
    # Arms raised to the side: about 57 % of the height, a little above that of arms hanging.
    assert com[2] / rig.standing_height == pytest.approx(0.57, abs=0.03)


def test_a_thigh_weighs_and_balances_as_de_leva_measured() -> None:
    rig = stick_rig()
    parts = segments(rig)
    thigh = list(parts.joints).index(joint(Role.LEFT_UPPER_LEG))
    assert parts.masses[thigh] == pytest.approx(0.1447, rel=0.01)
    np.testing.assert_allclose(parts.coms[thigh], [0, 0, -0.385 * 0.4], atol=1e-12)
    # Thin about its own axis, m (0.35 · 0.4 m)² across it.
    np.testing.assert_allclose(
        np.diag(parts.inertias[thigh]),
        [(0.35 * 0.4) ** 2, (0.35 * 0.4) ** 2, (0.155 * 0.4) ** 2],
        atol=1e-12,
    )


def test_splitting_the_spine_moves_no_mass() -> None:
    rig = stick_rig()
    spine = joint(Role.SPINE)
    # A second spine joint 0.12 m above the first takes over its children.
    s = rig.skeleton
    parents = [int(p) for p in s.parents]
    new = spine + 1
    shifted = [p + (p >= new) for p in parents]
    parents = [*shifted[:new], spine, *(new if p == spine else p for p in shifted[new:])]
    offsets = np.insert(s.offsets, new, [0, 0, 0.12], axis=0)
    offsets[[j for j, p in enumerate(parents) if p == new]] -= [0, 0, 0.12]
    roles = [*rig.roles.roles]
    roles.insert(new, Role.SPINE)
    names = [*s.names]
    names.insert(new, "spine2")
    split = replace(
        rig,
        skeleton=replace(
            s,
            names=tuple(names),
            parents=np.array(parents),
            offsets=offsets,
            translating=np.insert(s.translating, new, False),
            end_parents=s.end_parents + (s.end_parents >= new),
        ),
        roles=RoleMap(tuple(roles), (1.0,) * len(roles), ("",) * len(roles)),
        groups=(frozenset(),) * len(roles),
        tpose=np.tile([1.0, 0, 0, 0], (len(roles), 1)),
    )
    whole, pieces = segments(rig), segments(split)
    np.testing.assert_allclose(
        whole.masses @ coms_world(rig, whole), pieces.masses @ coms_world(split, pieces), atol=1e-12
    )


def test_a_rig_without_legs_is_refused() -> None:
    rig = stick_rig()
    roles = tuple(None if r and "upper_leg" in r else r for r in rig.roles.roles)
    with pytest.raises(SkeletonError, match="upper leg"):
        segments(replace(rig, roles=RoleMap(roles, rig.roles.confidence, rig.roles.reasons)))
