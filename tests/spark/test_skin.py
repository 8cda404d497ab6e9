"""Linear blend skinning against answers worked out vertex by vertex, bone by bone."""

import numpy as np
import pytest

from spark.errors import SkeletonError
from spark.rotation import quat_about, quat_normalize, quat_rotate
from spark.skeleton import Skeleton
from spark.skin import Material, Skin, skinned, strongest


def skeleton(count: int) -> Skeleton:
    offsets = np.tile([0.0, 0.0, 0.5], (count, 1))
    names = tuple(f"j{k}" for k in range(count))
    return Skeleton(names, np.arange(count) - 1, offsets, np.arange(count) == 0)


def random_skin(rng: np.random.Generator, joints: tuple[str, ...]) -> Skin:
    weights = rng.uniform(size=(40, 3))
    return Skin(
        joints=joints,
        inverse_bind=rng.normal(size=(len(joints), 3, 4)),
        vertices=rng.normal(size=(40, 3)),
        faces=rng.integers(0, 40, (20, 3)),
        bones_of=rng.integers(0, len(joints), (40, 3)),
        weights=weights / weights.sum(1, keepdims=True),
        uv=rng.uniform(size=(40, 2)),
        materials=(Material(), Material((1.0, 0.0, 0.0))),
        material_of=rng.integers(0, 2, 20),
    )


def test_each_vertex_is_the_mean_of_where_its_bones_have_it() -> None:
    rng = np.random.default_rng(0)
    body = skeleton(4)
    skin = random_skin(rng, ("j2", "j0", "j2", "j3"))  # a joint may have two bones
    positions = rng.normal(size=(5, 4, 3))
    rotations = quat_normalize(rng.normal(size=(5, 4, 4)))
    expected = np.zeros((5, 40, 3))
    for t in range(5):
        for v in range(40):
            for bone, weight in zip(skin.bones_of[v], skin.weights[v], strict=True):
                j = body.names.index(skin.joints[bone])
                inside = skin.inverse_bind[bone] @ np.append(skin.vertices[v], 1)
                expected[t, v] += weight * (positions[t, j] + quat_rotate(rotations[t, j], inside))
    np.testing.assert_allclose(skinned(skin, body, positions, rotations), expected, atol=1e-12)


def test_blended_halves_pinch_at_half_a_turn() -> None:
    # The known limit: halfway between a bone and its twin that is twisted by 180 degrees, the mean
    # lies on the axis.
    bind = np.tile(np.eye(3, 4), (2, 1, 1))
    around = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    skin = Skin(
        ("j0", "j1"),
        bind,
        around,
        np.array([[0, 1, 0]]),
        np.array([[0, 1]] * 2),
        np.full((2, 2), 0.5),
        np.zeros((2, 2)),
        (Material(),),
        np.array([0]),
    )
    rotations = np.stack([quat_about("z", np.array(a)) for a in (0.0, np.pi)])[None]
    at = skinned(skin, skeleton(2), np.zeros((1, 2, 3)), rotations)
    np.testing.assert_allclose(at, 0.0, atol=1e-12)


def test_a_joint_that_the_skeleton_lacks_is_an_error() -> None:
    skin = random_skin(np.random.default_rng(0), ("j0", "tail"))
    with pytest.raises(SkeletonError, match="tail"):
        skinned(skin, skeleton(2), np.zeros((1, 2, 3)), np.tile([1.0, 0, 0, 0], (1, 2, 1)))


def test_the_strongest_bones_are_kept() -> None:
    bones = np.array([[5, 6, 7, 8, 9, 4], [1, 2, 3, 4, 5, 6]])
    weights = np.array([[0.1, 0.2, 0.0, 0.3, 0.3, 0.2], [0.0] * 6])
    kept, shares = strongest(bones, weights)
    np.testing.assert_array_equal(kept, [[8, 9, 6, 4], [0, 0, 0, 0]])
    np.testing.assert_allclose(shares, [[0.3, 0.3, 0.2, 0.2], [0, 0, 0, 0]])


def test_some_faces_keep_their_corners() -> None:
    skin = random_skin(np.random.default_rng(1), ("j0", "j1"))
    part = skin.with_faces(np.array([3, 7]))
    np.testing.assert_array_equal(part.vertices[part.faces], skin.vertices[skin.faces[[3, 7]]])
    np.testing.assert_array_equal(part.uv[part.faces], skin.uv[skin.faces[[3, 7]]])
    np.testing.assert_array_equal(part.material_of, skin.material_of[[3, 7]])
    assert len(part.vertices) == len(np.unique(skin.faces[[3, 7]]))
