"""The files that lie beside a motion and are read with it."""

from pathlib import Path

from spark.errors import FileFormatError
from spark.io.reading import ACCLAIM, GLTF, format_of


def companions(path: Path) -> tuple[Path, ...]:
    """The skeleton (.asf) of an AMC, and the buffers (.bin) of a glTF file; none of a file that
    can't be read, or that is read alone."""
    try:
        known = format_of(path)
        if known is ACCLAIM:
            from spark.io.acclaim import skeleton_of

            skeleton = skeleton_of(path)
            return () if skeleton == path else (skeleton,)
        if known is GLTF:
            from spark.io.gltf_file import GltfFile

            return GltfFile(path).files_beside()
    except (FileFormatError, OSError):
        pass
    return ()
