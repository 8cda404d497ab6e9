"""Compiled models on disk, by the hash of all that goes into them: compiling the meshes of a robot
takes most of the time in which it is understood.

`$XDG_CACHE_HOME/spark-sim/models` or `~/.cache/spark-sim/models` has them. Each file's name holds
the hash of its bytes too, so that one that was cut off or changed is seen. The folder may be
deleted at any time; where it can't be written, models are compiled as ever.
"""

import hashlib
import os
import stat
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from spark.errors import FileFormatError
from spark.opening import read_bytes

_LARGEST = 200_000_000  # [bytes] of a model that is kept
_MOST = 1_000_000_000  # [bytes] of all; those that were not used for longest go
_STALE = 3600.0  # [s] after which a file that was left half written goes
# What stands between a model's text and the spec that is compiled.
_CODE: Final = ("compiling.py", "mjcf.py", "mjcf_source.py", "meshes.py", "urdf.py")


def key(spec: mujoco.MjSpec, text: str, visuals: bool) -> str | None:
    """The hash of what `spec.compile()` reads: the `text` that the spec was made of, its meshes and
    pictures, the code between, and MuJoCo itself. None where that is not all, or where there is no
    mesh and nothing to be gained."""
    others = (spec.plugins, spec.flexes, spec.skins)
    attached = "<model " in text  # a model of its own, with its own folders
    if not list(spec.meshes) or any(map(list, others)) or spec.strippath or attached:
        return None
    digest = hashlib.sha256(f"{mujoco.__version__} {_code()} {visuals}\n{text}".encode())
    for name, content in assets(spec):
        if content is None:  # MuJoCo says what is wrong
            return None
        digest.update(f"\n{name} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()[:32]


def assets(spec: mujoco.MjSpec) -> Iterator[tuple[str, bytes | None]]:
    """The meshes and pictures of a spec by name, with their bytes; None where they can't be
    read."""
    folder = Path(spec.modelfiledir)
    for below, name in _assets(spec):
        content = spec.assets.get(name)
        if content is None:
            try:
                content = read_bytes(folder / below / name, limit=_LARGEST)
            except (FileFormatError, ValueError):
                content = None
        yield name, content.encode() if isinstance(content, str) else content


def load(name: str) -> mujoco.MjModel | None:
    """The model that was stored under a `key`; None where there is none, or it is not whole, or
    someone else may have written it."""
    folder = _folder()
    if folder is None:
        return None
    with suppress(OSError, ValueError):
        for path in sorted(folder.glob(f"{name}-*.mjb")):
            if _is_whole(path):
                os.utime(path)
                return mujoco.MjModel.from_binary_path(str(path))
            path.unlink(missing_ok=True)
    return None


def store(name: str, model: mujoco.MjModel) -> None:
    """Keep a model for processes to come; nothing happens where that is not possible."""
    folder, size = _folder(), mujoco.mj_sizeModel(model)
    if folder is None or size > _LARGEST:
        return
    content = np.empty(size, np.uint8)
    mujoco.mj_saveModel(model, None, content)
    with suppress(OSError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        _make_room(folder, size)
        number, part = tempfile.mkstemp(".part", dir=folder)
        try:
            with os.fdopen(number, "wb") as file:
                file.write(content.data)
            os.replace(part, folder / f"{name}-{hashlib.sha256(content.data).hexdigest()}.mjb")
        finally:
            Path(part).unlink(missing_ok=True)


def _folder() -> Path | None:
    """Where models are kept; None without a home, or where others may write."""
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        base = given if given.is_absolute() else Path.home() / ".cache"
        folder = base / "spark-sim" / "models"
        return folder if not folder.exists() or _is_ours(folder.stat()) else None
    except (OSError, RuntimeError):
        return None


def _is_whole(path: Path) -> bool:
    """Whether a file is the one that this user stored, to the last byte."""
    with path.open("rb") as file:
        if not _is_ours(os.fstat(file.fileno())):
            return False
        return hashlib.file_digest(file, "sha256").hexdigest() == path.stem.partition("-")[2]


def _is_ours(status: os.stat_result) -> bool:
    """Whether nobody but this user can have written it. Windows keeps others out of a home."""
    if os.name == "nt":
        return True
    return status.st_uid == os.geteuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _make_room(folder: Path, size: int) -> None:
    """Delete what was not used for longest until `size` bytes more fit."""
    found = []
    for path in folder.iterdir():
        status = path.stat()
        if path.suffix == ".part" and status.st_mtime < time.time() - _STALE:
            path.unlink(missing_ok=True)
        elif path.suffix == ".mjb":
            found.append((status.st_mtime, status.st_size, path))
    left = size + sum(size for _, size, _ in found)
    for _, of_this, path in sorted(found):
        if left > _MOST:
            path.unlink(missing_ok=True)
            left -= of_this


def _assets(spec: mujoco.MjSpec) -> Iterable[tuple[str, str]]:
    """The files that a spec names, each below the folder that it is looked for in."""
    for mesh in spec.meshes:
        if mesh.file:
            yield spec.meshdir, mesh.file
    for field in spec.hfields:
        if field.file:
            yield spec.meshdir, field.file
    for texture in spec.textures:
        for name in (texture.file, *texture.cubefiles):
            if name:
                yield spec.texturedir, name


@cache
def _code() -> str:
    here = Path(__file__).parent
    return hashlib.sha256(b"".join((here / name).read_bytes() for name in _CODE)).hexdigest()
