"""Open Sound Control 1.0: messages and bundles, as they come in UDP packets.

The format is at https://opensoundcontrol.stanford.edu/spec-1_0.html.
"""

import struct
from collections.abc import Iterator
from itertools import groupby

from spark.errors import ConventionError

Argument = int | float | str | bytes | bool | None

_FIXED = {"i": "i", "f": "f", "h": "q", "d": "d", "t": "Q"}
_CONSTANTS: dict[str, Argument] = {"T": True, "F": False, "N": None, "I": None}
_MOST_NESTED = 8


def messages(packet: bytes, depth: int = 0) -> Iterator[tuple[str, list[Argument]]]:
    """The messages of a packet, in order: address and arguments.

    Raises `ConventionError` where the packet is none of OSC.
    """
    if packet.startswith(b"#bundle\0"):
        if depth > _MOST_NESTED:
            raise ConventionError("an OSC bundle in bundles in bundles; expected one or two")
        at = 16  # the name and a time, which no one fills in
        while at < len(packet):
            size = _size(packet, at)
            if size < 0 or at + 4 + size > len(packet):
                raise ConventionError("an OSC bundle ends in the middle of a message")
            yield from messages(packet[at + 4 : at + 4 + size], depth + 1)
            at += 4 + size
        return
    address, at = _text(packet, 0)
    if not address.startswith("/"):
        raise ConventionError("the packet is no OSC message: its address does not begin with /")
    kinds, at = _text(packet, at) if at < len(packet) else (",", at)
    arguments: list[Argument] = []
    for kind, several in groupby(kinds[1:]):
        count = sum(1 for _ in several)
        if kind in _FIXED:
            form = struct.Struct(f">{count}{_FIXED[kind]}")
            if at + form.size > len(packet):
                raise ConventionError("an OSC message ends in the middle of a number")
            arguments += form.unpack_from(packet, at)
            at += form.size
        elif kind in _CONSTANTS:
            arguments += [_CONSTANTS[kind]] * count
        elif kind in "sSb":
            for _ in range(count):
                argument, at = (_blob if kind == "b" else _text)(packet, at)
                arguments.append(argument)
        else:
            raise ConventionError(f"{address}: an OSC argument of type {kind!r} is not known")
    yield address, arguments


def message(address: str, *arguments: str | int | float) -> bytes:
    """A message of strings, integers and numbers, as bytes."""
    kinds, body = ",", b""
    for argument in arguments:
        if isinstance(argument, str):
            kinds, body = kinds + "s", body + _padded(argument)
        elif isinstance(argument, int):
            kinds, body = kinds + "i", body + struct.pack(">i", argument)
        else:
            kinds, body = kinds + "f", body + struct.pack(">f", argument)
    return _padded(address) + _padded(kinds) + body


def bundle(parts: list[bytes]) -> bytes:
    """A bundle of messages, to be taken at once."""
    head = b"#bundle\0" + struct.pack(">Q", 1)
    return head + b"".join(struct.pack(">i", len(part)) + part for part in parts)


def _padded(text: str) -> bytes:
    raw = text.encode() + b"\0"
    return raw + b"\0" * (-len(raw) % 4)


def _text(packet: bytes, at: int) -> tuple[str, int]:
    end = packet.find(b"\0", at)
    if end < 0:
        raise ConventionError("the packet is no OSC message: a string in it does not end")
    return packet[at:end].decode("utf-8", "replace"), end + 4 - end % 4


def _blob(packet: bytes, at: int) -> tuple[bytes, int]:
    size = _size(packet, at)
    if size < 0 or at + 4 + size > len(packet):
        raise ConventionError("an OSC message ends in the middle of a blob")
    return packet[at + 4 : at + 4 + size], at + 4 + size + -size % 4


def _size(packet: bytes, at: int) -> int:
    if at + 4 > len(packet):
        raise ConventionError("an OSC message ends in the middle of a number")
    return int(struct.unpack_from(">i", packet, at)[0])
