"""A surface that hangs on the joints of a skeleton, and where it is when they move.

Linear blend skinning: a vertex is the mean, by its weights, of where each of its bones has it.
Magnenat-Thalmann, Laperrière and Thalmann, "Joint-dependent local deformations" (1988). Where a
joint is twisted by half a turn, that mean pinches (the "candy wrapper").
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int, UInt8
from scipy.sparse import csr_array

from spark.errors import SkeletonError, name_list
from spark.rotation import matrix_from_quat
from spark.skeleton import Skeleton
from spark.summary import brief, counted

INFLUENCES = 4  # bones that a vertex hangs on at most


@dataclass(frozen=True, eq=False)
class Material:
    """A colour (sRGB, 0 to 1), and a picture (sRGB, rows from the top) that it tints."""

    rgb: tuple[float, float, float] = (0.8, 0.8, 0.8)
    image: UInt8[np.ndarray, "H W 3"] | None = None

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Skin:
    """Triangles on bones, in the pose in which they were bound to them.

    `vertices` [m] are in the axes of the clip (Z up). Each hangs on at most `INFLUENCES` bones, on
    `bones_of` with `weights`, which add up to one. Bone `b` goes with the joint `joints[b]`, and
    `inverse_bind[b]` maps a vertex into that joint's own axes [m]. One joint may have several
    bones: meshes of a file may be bound in different poses. `uv` is where a vertex lies in its
    material's picture: across, and down from the top; pictures repeat.
    """

    joints: tuple[str, ...]
    inverse_bind: Float[np.ndarray, "B 3 4"]
    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    bones_of: Int[np.ndarray, "V K"]
    weights: Float[np.ndarray, "V K"]
    uv: Float[np.ndarray, "V 2"]
    materials: tuple[Material, ...]
    material_of: Int[np.ndarray, "F"]

    def __repr__(self) -> str:
        return f"Skin({counted(len(self.faces), 'face')} on {counted(len(self.joints), 'bone')})"

    def with_faces(self, faces: Int[np.ndarray, "N"]) -> "Skin":
        """These faces alone, and the vertices that they have."""
        used, renumbered = np.unique(self.faces[faces], return_inverse=True)
        return replace(
            self,
            vertices=self.vertices[used],
            faces=renumbered.reshape(-1, 3),
            bones_of=self.bones_of[used],
            weights=self.weights[used],
            uv=self.uv[used],
            material_of=self.material_of[faces],
        )


def strongest(
    bones: Int[np.ndarray, "V N"], weights: Float[np.ndarray, "V N"]
) -> tuple[Int[np.ndarray, "V K"], Float[np.ndarray, "V K"]]:
    """The bones of the greatest weights of each vertex, `INFLUENCES` at most, and these weights,
    made to add up to one. A vertex without any keeps zeros."""
    first = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weights, first, axis=1)
    total = kept.sum(axis=1, keepdims=True)
    bones = np.where(kept > 0, np.take_along_axis(bones, first, axis=1), 0)
    return bones, np.divide(kept, total, out=np.zeros_like(kept), where=total > 0)


def joints_in(skeleton: Skeleton, skin: Skin) -> list[int]:
    """The skeleton's joint of each bone. Raises `SkeletonError` where it lacks one."""
    number = {name: j for j, name in enumerate(skeleton.names)}
    if missing := [name for name in skin.joints if name not in number]:
        raise SkeletonError(f"the skin hangs on {name_list(missing)}, which the skeleton lacks")
    return [number[name] for name in skin.joints]


def skinned(
    skin: Skin,
    skeleton: Skeleton,
    positions: Float[np.ndarray, "T J 3"],
    rotations: Float[np.ndarray, "T J 4"],
) -> Float[np.ndarray, "T V 3"]:
    """Where the vertices are [m, world] in frames in which the skeleton's joints have these world
    positions and rotations. Raises `SkeletonError` where it lacks one of the skin's."""
    at = joints_in(skeleton, skin)
    turned = matrix_from_quat(rotations[:, at])
    maps = turned @ skin.inverse_bind
    maps[..., 3] += positions[:, at]
    return blended(skin, maps)


def blended(skin: Skin, maps: Float[np.ndarray, "T B 3 4"]) -> Float[np.ndarray, "T V 3"]:
    """Where the vertices are, given what maps each bone's of them into the world.

    That is linear in the maps: one sparse matrix (V, 4 B) times all frames at once.
    """
    count, width = skin.bones_of.shape
    corners = np.append(skin.vertices, np.ones((count, 1)), axis=1)
    values = skin.weights[:, :, None] * corners[:, None, :]
    columns = 4 * skin.bones_of[:, :, None] + np.arange(4)
    starts = np.arange(0, 4 * count * width + 1, 4 * width)
    matrix = csr_array(
        (values.ravel(), columns.ravel(), starts), shape=(count, 4 * len(skin.joints))
    )
    frames = len(maps)
    columns_of_frames = maps.transpose(1, 3, 0, 2).reshape(-1, 3 * frames)
    return (matrix @ columns_of_frames).reshape(count, frames, 3).transpose(1, 0, 2)
