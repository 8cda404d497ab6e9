"""The skins of motion files of any format."""

from pathlib import Path

from spark.io.convention import Convention
from spark.io.reading import FBX, GLTF, format_of
from spark.skin import Skin


def read_skin(path: str | Path, convention: Convention) -> tuple[Skin | None, tuple[str, ...]]:
    """The skin in a file whose recording has this convention, on the recording's joints, and notes;
    None where the file, or its format, has none.

    Raises what the format's reader raises.
    """
    path = Path(path)
    if format_of(path) is GLTF:
        from spark.io.gltf_skin import read_gltf_skin

        return read_gltf_skin(path, convention)
    if format_of(path) is FBX:
        from spark.io.fbx_surface import read_fbx_surface

        return read_fbx_surface(path, convention)
    return None, ()
