"""Files as PyTorch saves them (`torch.save` of a dict of tensors), written without PyTorch.

Such a file is a zip: `data.pkl` is the dict, written by hand here, and tensors in it point to raw
numbers in `data/KEY`. `spark.io.tensors` reads them.
"""

import io
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from spark.files import write_atomically
from spark.io.tensors import STORAGES

_FOLDER = "archive"


def write_tensors(path: Path, entries: Mapping[str, np.ndarray | int | float]) -> None:
    """Write a dict of tensors and numbers as `torch.save` does; `torch.load(weights_only=True)`
    reads it. Raises `OutputError` where `path` can't be written."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        program = [b"\x80\x02}("]
        for number, (name, value) in enumerate(entries.items()):
            program.append(_text(name))
            if isinstance(value, np.ndarray):
                stored = next(s for s, kind in STORAGES.items() if value.dtype == kind)
                program.append(_tensor(value, stored, str(number)))
                archive.writestr(f"{_FOLDER}/data/{number}", np.ascontiguousarray(value).tobytes())
            else:
                program.append(_number(value))
        archive.writestr(f"{_FOLDER}/data.pkl", b"".join([*program, b"u."]))
        archive.writestr(f"{_FOLDER}/byteorder", "little")
        archive.writestr(f"{_FOLDER}/version", "3\n")
    write_atomically(path, out.getvalue())


def _text(value: str) -> bytes:
    data = value.encode()
    return b"X" + struct.pack("<I", len(data)) + data


def _number(value: int | float) -> bytes:
    if isinstance(value, float):
        return b"G" + struct.pack(">d", value)
    return b"J" + struct.pack("<i", value)


def _tensor(value: np.ndarray, storage: str, key: str) -> bytes:
    """A call of `_rebuild_tensor_v2`, as PyTorch's own pickles have it."""
    steps = [step // value.itemsize for step in np.ascontiguousarray(value).strides]
    at = [b"(", _text("storage"), f"ctorch\n{storage}\n".encode(), _text(key), _text("cpu")]
    shape = b"".join([b"(", *map(_number, value.shape), b"t(", *map(_number, steps), b"t"])
    return b"".join(
        [
            b"ctorch._utils\n_rebuild_tensor_v2\n(",
            *at,
            _number(value.size),
            b"tQ",
            _number(0),
            shape,
            b"\x89ccollections\nOrderedDict\n)RtR",
        ]
    )
