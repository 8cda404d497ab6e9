"""Motion files of any format, and the folders that hold them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spark.errors import ConventionError, FileFormatError
from spark.io.arrays import npy_shape, npz_names
from spark.io.humanml3d import WIDTH as FEATURES
from spark.io.intermimic import holds_states
from spark.io.position_files import POSITION_KEYS
from spark.io.position_layouts import layouts
from spark.io.recording import Recording
from spark.io.smpl_columns import WIDTHS as SMPL_WIDTHS
from spark.io.smpl_layouts import KEYS, SIGNS
from spark.io.tensors import says
from spark.opening import beginning

Reader = Callable[..., Recording]

UNIT_AND_UP = ("unit", "up")


@dataclass(frozen=True)
class Format:
    """A format: what messages call it, the endings of its files, the bytes that they begin with,
    and the options of `read_motion` that it takes."""

    name: str
    endings: tuple[str, ...]
    options: tuple[str, ...]
    magic: bytes | None = None


BVH = Format("BVH", (".bvh",), (*UNIT_AND_UP, "fps"), b"HIERARCHY")
FBX = Format("FBX", (".fbx",), (*UNIT_AND_UP, "clip"), b"Kaydara FBX Binary")
GLTF = Format("glTF", (".glb", ".gltf", ".vrm", ".vrma"), (*UNIT_AND_UP, "fps", "clip"), b"glTF")
ACCLAIM = Format("ASF/AMC", (".amc", ".asf"), (*UNIT_AND_UP, "fps"))
SMPL = Format("SMPL", (".npz", ".npy", ".pt", ".pth"), (*UNIT_AND_UP, "fps", "body_model"))
C3D = Format("C3D", (".c3d",), (*UNIT_AND_UP, "fps"))
TRC = Format("TRC", (".trc",), (*UNIT_AND_UP, "fps"), b"PathFileType")
POSITIONS = Format("positions", (".npz", ".npy", ".pt", ".pth"), (*UNIT_AND_UP, "fps"))

FORMATS = (BVH, FBX, GLTF, ACCLAIM, C3D, TRC, SMPL, POSITIONS)
SMPL_KEYS = KEYS | SIGNS
_NOT_READ = {
    ".mvnx": "MVNX is not read; export BVH or FBX from Xsens MVN",
    **dict.fromkeys(
        (".blend", ".dae", ".usd", ".usda", ".usdc", ".usdz", ".vmd", ".ma", ".mb", ".max"),
        "is not read; export it as GLB, FBX or BVH from the program that made it",
    ),
}
"""What to do with files that people have and that are not read."""
_ROBOTS = frozenset({"qpos", "joint_pos", "dof_pos"})
"""An npz with one of these arrays is a robot's motion."""

SUFFIXES = tuple(dict.fromkeys(ending for known in FORMATS for ending in known.endings))
_ALL_ENDINGS = f"{', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"


def read_motion(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
    body_model: str | Path | None = None,
    clip: str | None = None,
) -> Recording:
    """The recording in a file of any of the formats, told apart by content and ending.

    What is given replaces what the file says, or what would be inferred. Raises what the format's
    reader raises, and `ConventionError` where an option does not go with the format.
    """
    path = Path(path)
    if _is_missing(path):
        raise FileFormatError(path, None, f"no such file; expected a motion: {_ALL_ENDINGS}")
    known = format_of(path)
    if known is BVH and (why := _NOT_READ.get(path.suffix.lower())) and path.is_file():
        raise FileFormatError(path, None, why)
    given: dict[str, Any] = {"unit": unit, "up": up, "fps": fps, "body_model": body_model}
    given["clip"] = clip
    given = {name: value for name, value in given.items() if value is not None}
    for name in given:
        if name not in known.options:
            raise ConventionError(f"{path}: {name} does not go with {known.name}; leave it out")
    if fps is not None and not 1 <= fps <= 10000:
        raise ConventionError(f"{fps:g} fps is no frame rate; expected 1 to 10000")
    return _reader(known)(path, **given)


def _is_missing(path: Path) -> bool:
    """Whether there is no such file; not where the system does not say."""
    try:
        path.stat()
    except FileNotFoundError:
        return True
    except (OSError, ValueError):
        pass
    return False


def format_of(path: Path) -> Format:
    """The format of a file, by what it begins with, or else by its ending; BVH by any other."""
    head = beginning(path, 64).lstrip(b"\xef\xbb\xbf \t\r\n")
    if path.suffix.lower() in (".npy", ".npz") and head.startswith((b"\x93NUMPY", b"PK")):
        return SMPL if _is_smpl(path) else POSITIONS
    if path.suffix.lower() in (".pt", ".pth") and holds_states(path):
        return POSITIONS
    by_content = (f for f in FORMATS if f.magic is not None and head.startswith(f.magic))
    by_ending = (f for f in FORMATS if path.suffix.lower() in f.endings)
    return next(by_content, None) or next(by_ending, BVH)


def holds_person(path: Path) -> bool:
    """Whether a file of arrays is the motion of a person, not of a robot or any other numbers."""
    match path.suffix.lower():
        case ".npz":
            names = npz_names(path)
            return bool(names & {*SMPL_KEYS, *POSITION_KEYS}) and not names & _ROBOTS
        case ".npy":
            shape = npy_shape(path)
            known = len(shape) == 3 and bool(layouts(shape[1]))
            return _is_smpl(path) or known or shape[1:] == (FEATURES,)
        case ".pt" | ".pth":
            return says(path, (b"global_orient", b"root_orient")) or holds_states(path)
        case ".asf":  # a skeleton, which its AMCs move
            return False
        case _:
            return path.suffix.lower() in SUFFIXES


def _is_smpl(path: Path) -> bool:
    shape = npy_shape(path)
    return bool(npz_names(path) & SMPL_KEYS) or (len(shape) == 2 and shape[1] in SMPL_WIDTHS)


def _reader(known: Format) -> Reader:
    """Readers are loaded when needed: the libraries of one format are no burden on another."""
    if known is FBX:
        from spark.io.fbx import read_fbx

        return read_fbx
    if known is GLTF:
        from spark.io.gltf import read_gltf

        return read_gltf
    if known is ACCLAIM:
        from spark.io.acclaim import read_acclaim

        return read_acclaim
    if known is C3D:
        from spark.io.c3d import read_c3d

        return read_c3d
    if known is TRC:
        from spark.io.c3d import read_trc

        return read_trc
    if known is SMPL:
        from spark.io.smpl import read_smpl

        return read_smpl
    if known is POSITIONS:
        from spark.io.positions import read_positions

        return read_positions
    from spark.io.recording import read_recording

    return read_recording


def motion_files(path: Path, suffixes: tuple[str, ...] = SUFFIXES) -> list[Path]:
    """The files of some endings below a folder, in order of their names; a file itself.

    Links are followed. Of the endings of `FORMATS`, files of arrays that are no motion of a person
    are left out. Raises `FileFormatError` where there is none.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise FileFormatError(path, None, "no such file or folder")
    found = sorted(
        p
        for p in _files(path, set())
        if p.suffix.lower() in suffixes and (suffixes != SUFFIXES or holds_person(p))
    )
    if not found:
        raise FileFormatError(
            path, None, f"holds no {' or '.join(suffixes)} file; expected one or more"
        )
    return found


def _files(folder: Path, seen: set[Path]) -> Iterator[Path]:
    """All files below a folder, each folder once: a link may lead back to one above it."""
    if (real := folder.resolve()) in seen:
        return
    seen.add(real)
    for path in sorted(folder.iterdir()):
        if path.is_dir():
            yield from _files(path, seen)
        elif path.is_file():
            yield path
