"""From the meshes of a character's file to one skin: what readers of skins share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.io.convention import Convention
from spark.skin import Material, Skin, strongest

MAX_VERTICES, MAX_FACES = 2_000_000, 4_000_000  # of a character's file
IMAGE_SIDE = 512  # pixels of a material's picture
_FLAT = 1e-30  # determinant of a scale of zero, which hides things


@dataclass(frozen=True, eq=False)
class SkinPart:
    """A mesh of one material, as a file has it.

    `vertices` are in the mesh's own space. `joints` are names of a recording's joints, and
    `to_rest[b]` maps a vertex to where joint `b` alone has it while the file's nodes are at rest,
    in the file's units and axes. `weights` need not add up to one.
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    joints: tuple[str, ...]
    to_rest: Float[np.ndarray, "B 4 4"]
    bones_of: Int[np.ndarray, "V N"]
    weights: Float[np.ndarray, "V N"]
    uv: Float[np.ndarray, "V 2"]
    material: Material


def skin_of(
    parts: Sequence[SkinPart], rest: Mapping[str, Float[np.ndarray, "3"]], convention: Convention
) -> Skin | None:
    """The parts as one skin in metres, Z up; None where no face is left.

    `rest` has where each joint of the recording is at rest, its topmost joint first, in the file's
    units and axes. Faces of which a vertex hangs on nothing are left out.
    """
    axes = convention.to_internal
    order = {name: k for k, name in enumerate(rest)}
    bones: dict[tuple[str, bytes], int] = {}
    binds: list[Float[np.ndarray, "3 4"]] = []
    materials: list[Material] = []
    made = []
    for part in parts:
        # The pose in which a part was bound, as large as the body and placed by its first joint.
        solid = np.flatnonzero(np.abs(np.linalg.det(part.to_rest[:, :3, :3])) > _FLAT)
        if not len(solid):
            continue
        placed = part.to_rest[min(solid, key=lambda b: order[part.joints[b]])]
        back = np.linalg.inv(placed)
        number = np.zeros(len(part.joints), dtype=np.int64)
        for b, name in enumerate(part.joints):
            moved = part.to_rest[b] @ back
            linear = axes @ moved[:3, :3] @ np.linalg.inv(axes)
            bind = np.column_stack([linear, axes @ (moved[:3, 3] - rest[name])])
            key = (name, np.round(bind, 5).tobytes())
            number[b] = bones.setdefault(key, len(binds))
            if number[b] == len(binds):
                binds.append(bind)
        bones_of, weights = strongest(number[part.bones_of], part.weights)
        points = part.vertices @ placed[:3, :3].T + placed[:3, 3]
        faces = part.faces[(weights.sum(axis=1) > 0)[part.faces].all(axis=1)]
        if np.linalg.det(placed[:3, :3]) < 0:
            faces = faces[:, ::-1]
        if part.material not in materials:
            materials.append(part.material)
        made.append((points @ axes.T, faces, bones_of, weights, part.uv, part.material))
    if not any(len(faces) for _, faces, *_ in made):
        return None
    starts = np.cumsum([0, *(len(points) for points, *_ in made)])
    width = max(bones_of.shape[1] for _, _, bones_of, *_ in made)
    skin = Skin(
        joints=tuple(name for name, _ in bones),
        inverse_bind=np.array(binds),
        vertices=np.concatenate([points for points, *_ in made]),
        faces=np.concatenate(
            [faces + start for (_, faces, *_), start in zip(made, starts, strict=False)]
        ),
        bones_of=np.concatenate([_wide(bones_of, width) for _, _, bones_of, *_ in made]),
        weights=np.concatenate([_wide(weights, width) for *_, weights, _, _ in made]),
        uv=np.concatenate([uv for *_, uv, _ in made]),
        materials=tuple(materials),
        material_of=np.concatenate(
            [np.full(len(faces), materials.index(m)) for _, faces, *_, m in made]
        ),
    )
    return skin.with_faces(np.arange(len(skin.faces)))


def _wide(values: np.ndarray, width: int) -> np.ndarray:
    return np.pad(values, ((0, 0), (0, width - values.shape[1])))
