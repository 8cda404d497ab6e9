"""Datagrams of Xsens' MVN Analyze and MVN Animate: what their network streamer sends, by default to
UDP port 9763.

The layout is that of Xsens' "MVN real-time network streaming protocol specification" (MV0305P). All
numbers are big-endian. Each datagram has a header of 24 bytes:

    6  "MXTP" and two digits, the type      1  character
    4  sample counter                       1  segments of the body   (these three: MVN 2019 on)
    1  part of the sample, +128 the last    1  props
    1  items                                1  segments of the fingers
    4  time code [ms]                       2  -
                                            2  bytes that follow      (MVN 2019 on)
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.errors import ConventionError
from spark.euler import quat_from_euler

EULER, QUATERNION, UNITY, META, SCALE = 1, 2, 5, 12, 13
KINDS = {
    EULER: "Position + Orientation (Euler)",
    QUATERNION: "Position + Orientation (Quaternion)",
    UNITY: "Unity 3D",
}
"""The types that hold a pose, as MVN's network streamer calls them."""

SEGMENTS = (
    *("Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head"),
    *("RightShoulder", "RightUpperArm", "RightForearm", "RightHand"),
    *("LeftShoulder", "LeftUpperArm", "LeftForearm", "LeftHand"),
    *("RightUpperLeg", "RightLowerLeg", "RightFoot", "RightToe"),
    *("LeftUpperLeg", "LeftLowerLeg", "LeftFoot", "LeftToe"),
)
"""The body's segments in the order of their ids, which begin with 1."""
UNITY_SEGMENTS = (
    *("Pelvis", "RightUpperLeg", "RightLowerLeg", "RightFoot", "RightToe"),
    *("LeftUpperLeg", "LeftLowerLeg", "LeftFoot", "LeftToe", "L5", "L3", "T12", "T8"),
    *("LeftShoulder", "LeftUpperArm", "LeftForearm", "LeftHand"),
    *("RightShoulder", "RightUpperArm", "RightForearm", "RightHand", "Neck", "Head"),
)
"""The same in type 05."""

_HEADER = struct.Struct(">6sIBBIBBBBHH")
_LAST = 0x80
_NUMBERS = {EULER: 6, QUATERNION: 7, UNITY: 7}  # after the id of each segment
_FAR = 1e6  # no place lies further off, in whatever unit
_FROM_UNITY = np.array([SEGMENTS.index(name) for name in UNITY_SEGMENTS])
_BY_NAME = {name.lower(): name for name in SEGMENTS}


@dataclass(frozen=True)
class Datagram:
    """A header, and what comes after it. `kind` is the type, `part` counts from 0."""

    kind: int
    sample: int
    part: int
    last: bool
    items: int
    time_ms: int
    character: int
    props: int
    fingers: int
    payload: bytes


def read(packet: bytes) -> Datagram:
    """A datagram. Raises `ConventionError` where the packet is none, or is cut short."""
    if len(packet) < _HEADER.size or packet[:4] != b"MXTP" or not packet[4:6].isdigit():
        raise ConventionError("the packet is no MVN datagram: it does not begin with MXTP")
    name, sample, part, items, time_ms, character, _, props, fingers, _, size = _HEADER.unpack_from(
        packet
    )
    payload = packet[_HEADER.size :]
    if size > len(payload):
        raise ConventionError(f"an MVN datagram says {size} bytes, and {len(payload)} are there")
    return Datagram(
        kind=int(name[4:]),
        sample=sample,
        part=part & ~_LAST,
        last=bool(part & _LAST),
        items=items,
        time_ms=time_ms,
        character=character,
        props=props,
        fingers=fingers,
        payload=payload[:size] if size else payload,
    )


def segments(datagram: Datagram) -> tuple[Int[np.ndarray, "N"], Float[np.ndarray, "N 7"]]:
    """The body's segments in a pose, as places in `SEGMENTS`, with place and turn (wxyz) of each in
    the axes and the unit of the datagram. Those whose numbers are broken are left out, as are props
    and fingers. Raises `ConventionError` where the datagram is shorter than it says."""
    width = 1 + _NUMBERS[datagram.kind]
    if len(datagram.payload) < 4 * width * datagram.items:
        raise ConventionError(
            f"an MVN datagram says {datagram.items} segments, and has "
            f"{len(datagram.payload) // (4 * width)}"
        )
    words = np.frombuffer(datagram.payload, ">i4", width * datagram.items).reshape(-1, width)
    which = words[:, 0].astype(int) - 1
    with np.errstate(invalid="ignore", over="ignore"):
        values = words[:, 1:].view(">f4").astype(float)
        if datagram.kind == EULER:
            # About the fixed axes x, then y, then z: as Xsens' own SDK takes them.
            turns = quat_from_euler(np.radians(values[:, :2:-1]), "zyx")
            values = np.concatenate([values[:, :3], turns], axis=1)
        size = np.sqrt((values[:, 3:] ** 2).sum(1))
        whole = np.isfinite(values).all(1) & (size > 0.5) & (size < 2.0)
        whole &= np.abs(values[:, :3]).max(1, initial=0.0) < _FAR
    whole &= (which >= 0) & (which < len(SEGMENTS))
    which, values = which[whole], values[whole]
    values[:, 3:] /= size[whole, None]
    return (_FROM_UNITY[which] if datagram.kind == UNITY else which), values


def scale(datagram: Datagram) -> dict[str, Float[np.ndarray, "3"]]:
    """Where the segments begin in the T-pose, in which no segment is turned (type 13). Empty where
    the datagram tells of points alone. Raises `ConventionError` where it ends in the middle."""
    payload, at = datagram.payload, 4
    out: dict[str, Float[np.ndarray, 3]] = {}
    for _ in range(_whole(payload, 0)):
        length = _whole(payload, at)
        at += 4
        if length < 0 or at + length + 12 > len(payload):
            raise ConventionError("an MVN datagram of the T-pose ends in the middle of a segment")
        name = payload[at : at + length].decode("utf-8", "replace")
        with np.errstate(invalid="ignore"):
            place = np.frombuffer(payload, ">f4", 3, at + length).astype(float)
        at += length + 12
        known = _BY_NAME.get(name.replace(" ", "").replace("_", "").lower())
        if known is not None and np.isfinite(place).all() and np.abs(place).max() < _FAR:
            out[known] = place
    return out


def metadata(datagram: Datagram) -> dict[str, str]:
    """What is told of the character (type 12): name, xmid, colour and others."""
    text = datagram.payload.decode("utf-8", "replace")
    # Some versions put the text's length in front of it.
    start = next((k for k, c in enumerate(text[:5]) if c.isalpha() and c.isascii()), 0)
    lines = (line.partition(":") for line in text[start:].split("\n")[:100] if ":" in line)
    return {tag.strip(): value.strip()[:100] for tag, _, value in lines}


def pose_datagram(
    values: Mapping[str, Sequence[float] | Float[np.ndarray, "7"]], *, sample: int, time_ms: int
) -> bytes:
    """A pose as MVN sends it in type 02: for each segment its place [m] and its turn (wxyz)."""
    form = f">I{_NUMBERS[QUATERNION]}f"
    payload = b"".join(struct.pack(form, SEGMENTS.index(s) + 1, *values[s]) for s in values)
    return _datagram(QUATERNION, payload, len(values), sample, time_ms)


def scale_datagram(places: Mapping[str, Float[np.ndarray, "3"]]) -> bytes:
    """The T-pose as MVN sends it: where each segment begins."""
    payload = struct.pack(">i", len(places))
    for name, place in places.items():
        raw = name.encode()
        payload += struct.pack(">i", len(raw)) + raw + struct.pack(">3f", *map(float, place))
    return _datagram(SCALE, payload + struct.pack(">i", 0), len(places))


def meta_datagram(tags: Mapping[str, str]) -> bytes:
    """What is told of the character, as MVN sends it."""
    payload = "".join(f"{tag}:{value}\n" for tag, value in tags.items()).encode()
    return _datagram(META, payload, 1)


def _datagram(kind: int, payload: bytes, items: int, sample: int = 0, time_ms: int = 0) -> bytes:
    """A whole sample, of the first character."""
    head = _HEADER.pack(
        f"MXTP{kind:02d}".encode(),
        sample % 2**32,
        _LAST,
        items,
        time_ms % 2**32,
        0,
        len(SEGMENTS),
        0,
        0,
        0,
        len(payload),
    )
    return head + payload


def _whole(payload: bytes, at: int) -> int:
    if at + 4 > len(payload):
        raise ConventionError("an MVN datagram ends in the middle of a number")
    return int(struct.unpack_from(">i", payload, at)[0])
