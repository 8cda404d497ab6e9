"""Poses on hinges: angles make the rotation again, and bodies are where ball joints put them."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from sim.body.hinges import angles_within, davenport_angles
from sim.body.joints import HINGES
from spark.rotation import quat_angle, quat_from_rotvec, quat_mul, quat_normalize
from tests.helpers.bodies import STANDING, at_key, rig_of, scene_of
from tests.helpers.recordings import recordings

TRIPLES = {kind: hinges for kind, hinges in HINGES.items() if len(hinges) == 3}


def turned(angles: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """`R(axes[0]) R(axes[1]) R(axes[2])`."""
    first, second, third = (quat_from_rotvec(angles[..., k, None] * axes[k]) for k in range(3))
    return quat_mul(quat_mul(first, second), third)


@pytest.mark.parametrize("kind", TRIPLES)
def test_the_angles_make_the_rotation_again(kind: str) -> None:
    axes = np.array([hinge.axis for hinge in TRIPLES[kind]], dtype=float)
    assert all(abs(a @ b) < 1e-12 for a, b in pairwise(axes))
    q = quat_normalize(np.random.default_rng(0).normal(size=(500, 4)))
    assert quat_angle(turned(davenport_angles(q, axes), axes), q).max() < 1e-6


@pytest.mark.parametrize("kind", HINGES)
def test_angles_within_their_ranges_are_found_again(kind: str) -> None:
    """In the middle of the ranges there is one solution."""
    hinges = HINGES[kind]
    axes = np.array([hinge.axis for hinge in hinges], dtype=float)
    ranges = np.radians([hinge.range_deg for hinge in hinges])
    for angles in np.random.default_rng(0).uniform(
        0.5 * ranges[:, 0], 0.5 * ranges[:, 1], (50, len(axes))
    ):
        padded, held = np.zeros(3), np.zeros((3, 3))
        padded[: len(axes)], held[: len(axes)] = angles, axes
        np.testing.assert_allclose(
            angles_within(turned(padded, held), axes, ranges), angles, atol=1e-9
        )


def test_an_angle_beyond_its_range_stops_there() -> None:
    axes, ranges = np.array([[0.0, 1.0, 0.0]]), np.array([[-0.2, 2.5]])
    for angle, expected in ((-0.5, -0.2), (1.0, 1.0), (2.9, 2.5)):
        q = quat_from_rotvec(angle * axes[0])
        np.testing.assert_allclose(angles_within(q, axes, ranges), [expected], atol=1e-12)


@pytest.mark.parametrize("key", ["tpose", "home"])
@pytest.mark.parametrize("path", recordings(*STANDING))
def test_keyframes_of_hinges_are_those_of_balls(path: Path, key: str) -> None:
    rig = rig_of(path)
    balls, hinges = (scene_of(rig, joints) for joints in ("ball", "hinge"))
    expected, data = at_key(balls, key), at_key(hinges, key)
    for j in rig.skeleton.subtree(rig.root_joint):
        name = rig.skeleton.names[j]
        np.testing.assert_allclose(data.body(name).xpos, expected.body(name).xpos, atol=1e-6)
        assert quat_angle(data.body(name).xquat, expected.body(name).xquat) < 1e-6
