"""What an FBX file says of itself: its unit, its axes and its frame rate.

The library that evaluates FBX scenes does not hand these on. They are numbers under known names in
the block GlobalSettings, in binary as in text files.
"""

import re
import struct
from dataclasses import dataclass

from spark.errors import ConventionError
from spark.io.convention import UPS, Up

_MAGIC = b"Kaydara FBX Binary"

# Frames per second of the time modes (FbxTime::EMode); 14 is a rate of the file's own.
_RATES = {
    0: 30.0,
    1: 120.0,
    2: 100.0,
    3: 60.0,
    4: 50.0,
    5: 48.0,
    6: 30.0,
    7: 30.0,
    8: 30 / 1.001,
    9: 30 / 1.001,
    10: 25.0,
    11: 24.0,
    12: 1000.0,
    13: 24 / 1.001,
    15: 96.0,
    16: 72.0,
    17: 60 / 1.001,
    18: 120 / 1.001,
}
_CUSTOM = 14

# Where FBX 6 has it, which may have no time mode: as a text, in binary files after its length.
_OLD_RATE = re.compile(rb'\bFrameRate:\s*"(\d+\.?\d*)"|FrameRateS.\0\0\0(\d+\.?\d*)', re.DOTALL)

# Little-endian layouts of the number types of a binary property.
_NUMBERS = {b"I": "<i", b"L": "<q", b"F": "<f", b"D": "<d", b"Y": "<h"}


@dataclass(frozen=True)
class FbxSettings:
    """Metres in a unit, the axis that points up, and the frame time [s]; None where not said."""

    unit_m: float | None
    up: Up | None
    frame_time: float


def read_settings(data: bytes) -> FbxSettings:
    """The settings in the bytes of an FBX file. Raises `ConventionError` where the axes are ones
    that no common program writes: mirrored, or none at all."""
    unit_cm = _number(data, "UnitScaleFactor")
    rate = _rate(data)
    return FbxSettings(
        unit_cm / 100 if unit_cm is not None and 1e-9 < unit_cm < 1e9 else None,
        _up(data),
        1 / rate,
    )


def _rate(data: bytes) -> float:
    """Frames per second."""
    said = _number(data, "TimeMode")
    if said is None and (old := _OLD_RATE.search(data)) is not None:
        rate: float | None = float(old[1] or old[2])
        where = "FrameRate"
    else:
        mode = int(said or 0)
        rate = _number(data, "CustomFrameRate") if mode == _CUSTOM else _RATES.get(mode)
        where = f"time mode {mode}"
    if rate is None or not 1e-3 < rate < 1e5:
        raise ConventionError(f"frame rate of {where} is {rate}; expected a known one")
    return rate


def _up(data: bytes) -> Up | None:
    axes = [_number(data, f"{name}Axis") for name in ("Coord", "Up", "Front")]
    signs = [_number(data, f"{name}AxisSign") for name in ("Coord", "Up", "Front")]
    if axes[1] is None:
        return None
    known = [(axis, 1.0 if sign is None else sign) for axis, sign in zip(axes, signs, strict=True)]
    right, up, front = known
    if up[0] not in (0, 1, 2) or up[1] not in (-1, 1):
        raise ConventionError(
            f"up axis {up[0]:g} with sign {up[1]:g} is not known; expected 0, 1 or 2 (x, y, z) "
            "with sign 1 or -1; export it again"
        )
    if right[0] is not None and front[0] is not None:
        turn = [right[0], up[0], front[0]]
        even = turn in ([0, 1, 2], [1, 2, 0], [2, 0, 1])
        if sorted(turn) != [0, 1, 2] or (right[1] * up[1] * front[1] > 0) != even:
            raise ConventionError(
                f"axes {turn} with signs {[right[1], up[1], front[1]]} (right, up, front) are "
                "left-handed or no axes; expected right-handed ones; export it with those"
            )
    return UPS[int(up[0]) + (3 if up[1] < 0 else 0)]


def _number(data: bytes, name: str) -> float | None:
    """The value of the property `name`; None where the file has none."""
    if not data.startswith(_MAGIC):
        found = re.search(rb'"%s"\s*,[^\r\n]*,\s*([-+.\deE]+)' % name.encode(), data)
        return None if found is None else float(found[1])
    key = b"S" + struct.pack("<I", len(name)) + name.encode()
    at = data.find(key)
    if at < 0:
        return None
    at += len(key)
    try:
        while data[at : at + 1] == b"S":  # the names of its type, and flags
            at += 5 + struct.unpack_from("<I", data, at + 1)[0]
        layout = _NUMBERS[data[at : at + 1]]
        return float(struct.unpack_from(layout, data, at + 1)[0])
    except (struct.error, KeyError):
        return None
