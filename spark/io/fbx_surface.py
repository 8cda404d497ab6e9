"""The skin of an FBX file as pictures and pages show it."""

from pathlib import Path

import numpy as np

from spark.errors import DependencyError, name_list
from spark.io.convention import Convention
from spark.io.fbx_materials import FbxMaterial
from spark.io.fbx_skin import read_fbx_skin
from spark.io.images import picture
from spark.io.skin_parts import IMAGE_SIDE, SkinPart, skin_of
from spark.skin import Material, Skin


def read_fbx_surface(path: Path, convention: Convention) -> tuple[Skin | None, tuple[str, ...]]:
    """The skin of a file whose recording has this convention, and notes; None where it has none.

    Raises what `read_fbx` raises.
    """
    found = read_fbx_skin(path)
    if found is None:
        return None, ()
    notes: list[str] = []
    looks = {
        material: _look(material, notes) for mesh in found.meshes for material in mesh.materials
    }
    parts = [
        SkinPart(
            vertices=mesh.vertices,
            faces=mesh.faces[mesh.material_of == m],
            joints=mesh.joints,
            to_rest=mesh.to_rest,
            bones_of=mesh.bones_of,
            weights=mesh.weights,
            uv=np.column_stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]]),
            material=looks[material],
        )
        for mesh in found.meshes
        for m, material in enumerate(mesh.materials)
        if (mesh.material_of == m).any()
    ]
    missing = [material.missing for material in looks if material.missing is not None]
    if missing:
        notes.append(
            f"pictures that are not in {path.name}, nor beside it as PNG or JPEG: "
            f"{name_list(list(dict.fromkeys(missing)))}"
        )
    return skin_of(parts, found.rest, convention), tuple(dict.fromkeys(notes))


def _look(material: FbxMaterial, notes: list[str]) -> Material:
    if material.picture is None:
        return Material(material.rgb)
    try:
        return Material(material.rgb, picture(material.picture, side=IMAGE_SIDE)[..., :3])
    except ValueError as error:
        notes.append(f"a picture can't be read ({error}): its colour alone is shown")
    except DependencyError as error:
        notes.append(f"colours without pictures: {error}")
    return Material()
