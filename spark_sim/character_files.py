"""The motion of a character as a file: its ending says which, and what it lacks is told."""

from pathlib import Path
from typing import TYPE_CHECKING

from spark.errors import name_list
from spark.io.bvh import write_bvh
from spark.io.glb import write_glb
from spark.io.glb_skin import write_on_skin
from spark.io.reading import BVH, FBX, GLTF, format_of
from spark.io.recording import Recording
from spark.io.vrma import write_vrma
from spark.rig.vrm_bones import bones_of_rig
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.humanoid import on_bones

if TYPE_CHECKING:
    from spark.io.fbx_skin import FbxSkin

ENDINGS = (".bvh", ".glb", ".vrma")
"""What the motion of a character is written as."""
_SKINNED = (".glb", ".gltf", ".vrm")  # glTF files that have meshes: a .vrma has none


def write(recording: Recording, body: Path | None, path: Path, name: str) -> None:
    """Write a motion as BVH, or as GLB: with the skin of its `body` where that is an FBX, glTF or
    VRM file, else with bones to see."""
    motion, convention = recording.motion, recording.convention
    if path.suffix.lower() == ".bvh":
        write_bvh(recording.bvh, path)
    elif body is not None and body.suffix.lower() in _SKINNED and format_of(body) is GLTF:
        write_on_skin(motion, body, path, unit_m=convention.unit_m, name=name)
    else:
        write_glb(motion, path, name=name, skin=_skin(body), convention=convention)


def write_for_avatars(canonical: CanonicalMotion, path: Path, name: str) -> None:
    """Write a humanoid's motion as VRMA. Raises `SkeletonError` where it lacks arms, or hands."""
    write_vrma(on_bones(canonical, bones_of_rig(canonical.rig)), path, name=name)


def lacking(body: Path | None, path: Path) -> tuple[str, ...]:
    """What the file at `path` will lack of the body in the file `body`, as notes."""
    kind = BVH if body is None else format_of(body)
    if path.suffix.lower() == ".bvh":
        named = f"written as a BVH of its own; {kind.name} files are read only"
        shown = ": .glb has the skin too" if kind in (FBX, GLTF) else ""
        return () if kind is BVH else (named + shown,)
    if body is None or kind is not FBX or path.suffix.lower() != ".glb":
        return ()
    if (skin := _skin(body)) is None:
        return (f"{body.name} has no skin (Mixamo: download it with skin): bones are drawn",)
    missing = [m.missing for mesh in skin.meshes for m in mesh.materials if m.missing is not None]
    if not missing:
        return ()
    names = name_list(list(dict.fromkeys(missing)))
    return (f"pictures that are not in {body.name}, nor beside it as PNG or JPEG: {names}",)


def _skin(body: Path | None) -> "FbxSkin | None":
    """The skin of an FBX file; None where there is none."""
    if body is None or format_of(body) is not FBX:
        return None
    from spark.io.fbx_skin import read_fbx_skin

    return read_fbx_skin(body)
