"""C3D files made by hand, as the processors of Intel, DEC and SGI write them."""

import struct
from pathlib import Path

import numpy as np

_BLOCK = 512
_CODES = {"intel": 84, "dec": 85, "sgi": 86}


class _Numbers:
    def __init__(self, processor: str) -> None:
        self.processor = processor
        self.order = ">" if processor == "sgi" else "<"

    def words(self, values: object) -> bytes:
        return np.asarray(values).astype(f"{self.order}i2").tobytes()

    def floats(self, values: object) -> bytes:
        plain = np.atleast_1d(np.asarray(values, dtype=np.float32))
        if self.processor == "dec":  # VAX F: exponent + 2, halves swapped
            halves = (plain * np.float32(4)).astype("<f4").view("<u2").reshape(-1, 2)
            return np.ascontiguousarray(halves[:, ::-1]).tobytes()
        return plain.astype(f"{self.order}f4").tobytes()


def write_c3d(
    path: Path,
    labels: list[str],
    points: np.ndarray,
    *,
    rate: float = 100.0,
    unit: str = "mm",
    processor: str = "intel",
    integers: bool = False,
    analogue: int = 0,
) -> Path:
    """Points (T, P, 3) in that unit, not seen where they are NaN; `analogue` samples a frame."""
    number = _Numbers(processor)
    frames, count = points.shape[:2]
    scale = 0.1 if integers else -0.1
    width = max(map(len, labels), default=1)

    def parameter(name: str, group: int, kind: int, shape: list[int], content: bytes) -> bytes:
        body = struct.pack("<bB", kind, len(shape)) + bytes(shape) + content + b"\0"
        head = struct.pack("<bb", len(name), group) + name.encode()
        return head + number.words(len(body) + 2) + body

    def group(name: str, id: int) -> bytes:
        return struct.pack("<bb", len(name), -id) + name.encode() + number.words(3) + b"\0"

    texts = "".join(label.ljust(width) for label in labels).encode("latin-1")
    table = group("POINT", 1)
    table += parameter("USED", 1, 2, [], number.words(count))
    table += parameter("SCALE", 1, 4, [], number.floats(scale))
    table += parameter("RATE", 1, 4, [], number.floats(rate))
    table += parameter("UNITS", 1, -1, [len(unit)], unit.encode())
    table += parameter("LABELS", 1, -1, [width, count], texts)
    table += b"\0\0"
    blocks = -(-(4 + len(table)) // _BLOCK)
    section = struct.pack("<BBBB", 1, 0x50, blocks, _CODES[processor]) + table
    section += bytes(blocks * _BLOCK - len(section))
    header = struct.pack("<BB", 2, 0x50) + number.words([count, analogue, 1, frames, 10])
    header += number.floats(scale) + number.words([2 + blocks, 1 if analogue else 0])
    header += number.floats(rate)
    header += bytes(_BLOCK - len(header))
    seen = np.isfinite(points).all(axis=-1, keepdims=True)
    rows = np.concatenate([np.where(seen, points, 0), np.where(seen, 0, -1)], axis=-1)
    rows[..., :3] = np.round(rows[..., :3] / scale) if integers else rows[..., :3]
    rows = np.concatenate([rows.reshape(frames, -1), np.full((frames, analogue), 7)], axis=1)
    data = number.words(rows) if integers else number.floats(rows)
    path.write_bytes(header + section + data + bytes(-len(data) % _BLOCK))
    return path
