"""The points in a C3D file: their names, places, rate and unit.

Motion Lab Systems, "The C3D File Format User Guide": a header, parameters in groups, then frames of
points and analogue samples, as the processors of Intel, DEC or SGI write numbers.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.opening import read_bytes

_BLOCK, _KEY = 512, 0x50
_INTEL, _DEC, _SGI = 84, 85, 86
_TYPES = {-1: "S1", 1: "u1", 2: "u2", 4: "f4"}
_MOST_LABELS = 100  # blocks of labels: LABELS, LABELS2, ...


@dataclass(frozen=True, eq=False)
class C3dPoints:
    """Points in file units and axes; NaN where one was not seen. Words are None where not said."""

    labels: tuple[str, ...]
    values: Float[np.ndarray, "T P 3"]
    rate: float | None
    unit: str | None
    notes: tuple[str, ...] = ()


def read_c3d_points(path: Path) -> C3dPoints:
    """The points of the file. Raises `FileFormatError` where it is no C3D, or has none."""
    data = read_bytes(path, expected="a C3D file")
    try:
        if len(data) < _BLOCK or data[1] != _KEY:
            raise ValueError("it does not begin as one")
        with np.errstate(all="ignore"):  # numbers that are none
            return _Reader(data).points()
    except (ValueError, IndexError, KeyError, struct.error, OverflowError, MemoryError) as error:
        raise FileFormatError(path, None, f"is no C3D file that can be read ({error})") from error


class _Reader:
    def __init__(self, data: bytes) -> None:
        self.data = data
        self.start = (data[0] - 1) * _BLOCK
        if not _BLOCK <= self.start < len(data) - 4:
            raise ValueError(f"its parameters begin at byte {self.start}")
        self.processor = data[self.start + 3]
        if self.processor not in (_INTEL, _DEC, _SGI):
            raise ValueError(f"its processor is number {self.processor}; expected 84, 85 or 86")
        self.order = ">" if self.processor == _SGI else "<"
        self.parameters = self._parameters()

    def points(self) -> C3dPoints:
        """Those of all frames."""
        count = self._word(2) if (used := self._number("POINT", "USED")) is None else int(used)
        scale, rate = self._float(12), self._float(20)
        rate = self._number("POINT", "RATE") or rate
        rows = self._rows(count, as_floats=scale < 0)
        notes = []
        claimed = self._frames()
        if claimed is not None and len(rows) > claimed:
            rows = rows[:claimed]
        if claimed is not None and len(rows) < claimed:
            notes.append(f"the file ends after {len(rows)} of {claimed} frames")
        if not len(rows) or not count:
            raise ValueError("it has no points" if len(rows) else "it has no frames")
        values, seen = rows[..., :3].astype(float), rows[..., 3] >= 0
        values = values if scale < 0 else values * scale
        seen &= np.isfinite(values).all(axis=-1) & (values != 0).any(axis=-1)
        values = np.where(seen[..., None], values, np.nan)
        labels = [word for k in range(_MOST_LABELS) for word in self._words(f"LABELS{k or ''}")]
        labels = labels[:count] + [""] * (count - len(labels))
        units = self._words("UNITS")
        plausible = np.isfinite(rate) and 1 <= rate <= 10000
        return C3dPoints(
            tuple(labels),
            values,
            float(rate) if plausible else None,
            units[0] if units else None,
            tuple(notes),
        )

    def _rows(self, count: int, *, as_floats: bool) -> np.ndarray:
        """Frames of points, four numbers each, as far as the file has them."""
        width = 4 if as_floats else 2
        begin = self._number("POINT", "DATA_START") or self._word(16)
        start = (int(begin) - 1) * _BLOCK
        samples = self._word(4)
        each = (4 * count + samples) * width
        if not _BLOCK <= start <= len(self.data) or not each:
            raise ValueError(f"its frames begin at byte {start} and have {each} bytes")
        frames = (len(self.data) - start) // each
        whole = self.data[start : start + frames * each]
        if as_floats:
            rows = self._as_floats(whole)
        else:
            rows = np.frombuffer(whole, f"{self.order}i2").astype(float)
        return rows.reshape(frames, -1)[:, : 4 * count].reshape(frames, count, 4)

    def _frames(self) -> int | None:
        """How many frames the file says it has: the header's numbers end at 65535."""
        ends = [self._array("TRIAL", f"ACTUAL_{x}_FIELD") for x in ("START", "END")]
        if all(end.size == 2 for end in ends):
            first, last = (int(end[0]) + 65536 * int(end[1]) for end in ends)
        else:
            first, last = self._word(6), self._word(8)
        return last - first + 1 if last >= first and last != 65535 else None

    def _parameters(self) -> dict[tuple[str, str], np.ndarray | None]:
        """The values of all parameters by group and name, in capitals."""
        groups: dict[int, str] = {}
        found: dict[tuple[int, str], np.ndarray | None] = {}
        at = self.start + 4
        while at + 2 < len(self.data):
            length, number = struct.unpack_from("<bb", self.data, at)
            if length == 0 or number == 0:
                break
            name = self.data[at + 2 : at + 2 + abs(length)].decode("latin-1").strip().upper()
            body = at + 2 + abs(length)
            step = struct.unpack_from(f"{self.order}H", self.data, body)[0]
            if number < 0:
                groups[-number] = name
            else:
                found[number, name] = self._value(body + 2)
            if step == 0:
                break
            at = body + step
        return {(groups.get(number, ""), name): value for (number, name), value in found.items()}

    def _value(self, at: int) -> np.ndarray | None:
        kind, dimensions = struct.unpack_from("<bB", self.data, at)
        shape = tuple(self.data[at + 2 : at + 2 + dimensions])
        if kind not in _TYPES or len(shape) != dimensions:
            return None
        count = int(np.prod(shape, dtype=np.int64)) if shape else 1
        dtype = np.dtype(_TYPES[kind])
        dtype = dtype.newbyteorder(">") if self.order == ">" else dtype
        begin = at + 2 + dimensions
        content = self.data[begin : begin + count * dtype.itemsize]
        if len(content) < count * dtype.itemsize:
            return None
        flat = self._as_floats(content) if kind == 4 else np.frombuffer(content, dtype)
        return flat.reshape(shape[::-1])  # the first dimension changes fastest

    def _as_floats(self, content: bytes) -> np.ndarray:
        if self.processor == _DEC:  # words of 16 bits the other way round, exponents two higher
            words = np.frombuffer(content, "<u2").reshape(-1, 2)[:, ::-1]
            return np.ascontiguousarray(words).view("<f4").ravel() / np.float32(4)
        return np.frombuffer(content, f"{self.order}f4")

    def _float(self, at: int) -> float:
        return float(self._as_floats(self.data[at : at + 4])[0])

    def _word(self, at: int) -> int:
        return int(struct.unpack_from(f"{self.order}H", self.data, at)[0])

    def _array(self, group: str, name: str) -> np.ndarray:
        """The values of a parameter, the last dimension first; nothing where it isn't there."""
        value = self.parameters.get((group, name))
        return np.zeros(0) if value is None else value

    def _number(self, group: str, name: str) -> float | None:
        value = self._array(group, name)
        return float(value.ravel()[0]) if value.dtype.kind in "uf" and value.size else None

    def _words(self, name: str) -> list[str]:
        """The texts of a parameter of the points."""
        value = self._array("POINT", name)
        if value.dtype.kind != "S" or not value.ndim:
            return []
        rows = value.reshape(-1, value.shape[-1])
        return [b"".join(row.tolist()).decode("latin-1").strip(" \x00") for row in rows]
