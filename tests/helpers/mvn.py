"""What Xsens MVN sends, made from its specification by hand, for a person whose pose is known."""

import struct
from collections.abc import Iterable, Mapping

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

# Segments in the order of their ids: name, parent, place in the parent's T-pose [m], in X ahead, Y
# left, Z up. The pelvis is over the floor.
BODY: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "Pelvis": (None, (0.0, 0.0, 0.98)),
    "L5": ("Pelvis", (-0.01, 0.0, 0.105)),
    "L3": ("L5", (0.0, 0.0, 0.11)),
    "T12": ("L3", (0.0, 0.0, 0.1)),
    "T8": ("T12", (0.0, 0.0, 0.1)),
    "Neck": ("T8", (0.0, 0.0, 0.14)),
    "Head": ("Neck", (0.0, 0.0, 0.1)),
    "RightShoulder": ("T8", (0.0, -0.03, 0.09)),
    "RightUpperArm": ("RightShoulder", (0.0, -0.15, 0.0)),
    "RightForearm": ("RightUpperArm", (0.0, -0.3, 0.0)),
    "RightHand": ("RightForearm", (0.0, -0.26, 0.0)),
    "LeftShoulder": ("T8", (0.0, 0.03, 0.09)),
    "LeftUpperArm": ("LeftShoulder", (0.0, 0.15, 0.0)),
    "LeftForearm": ("LeftUpperArm", (0.0, 0.3, 0.0)),
    "LeftHand": ("LeftForearm", (0.0, 0.26, 0.0)),
    "RightUpperLeg": ("Pelvis", (0.0, -0.09, 0.0)),
    "RightLowerLeg": ("RightUpperLeg", (0.01, 0.0, -0.45)),
    "RightFoot": ("RightLowerLeg", (-0.01, 0.0, -0.43)),
    "RightToe": ("RightFoot", (0.17, 0.0, -0.08)),
    "LeftUpperLeg": ("Pelvis", (0.0, 0.09, 0.0)),
    "LeftLowerLeg": ("LeftUpperLeg", (0.01, 0.0, -0.45)),
    "LeftFoot": ("LeftLowerLeg", (-0.01, 0.0, -0.43)),
    "LeftToe": ("LeftFoot", (0.17, 0.0, -0.08)),
}
NAMES = tuple(BODY)
UNITY_NAMES = (
    *("Pelvis", "RightUpperLeg", "RightLowerLeg", "RightFoot", "RightToe", "LeftUpperLeg"),
    *("LeftLowerLeg", "LeftFoot", "LeftToe", "L5", "L3", "T12", "T8", "LeftShoulder"),
    *("LeftUpperArm", "LeftForearm", "LeftHand", "RightShoulder", "RightUpperArm"),
    *("RightForearm", "RightHand", "Neck", "Head"),
)
_Y_UP = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # X left, Y up, Z ahead
_UNITY = np.array([[0.0, -1, 0], [0, 0, 1], [1, 0, 0]])  # X right, Y up, Z ahead: left-handed
Turns = Mapping[str, Rotation]
Placed = dict[str, tuple[Float[np.ndarray, "3"], Rotation]]


def world(turns: Turns, *, size: float = 1.0, at: tuple[float, float] = (0.0, 0.0)) -> Placed:
    """Place [m] and turn of each segment in the world, each turned in its parent."""
    out: Placed = {}
    for name, (parent, place) in BODY.items():
        turn = turns.get(name, Rotation.identity())
        if parent is None:
            out[name] = np.array([*at, size * place[2]]), turn
        else:
            above, up = out[parent]
            out[name] = above + up.apply(size * np.array(place)), up * turn
    return out


def quaternions(placed: Placed, *, y_up: bool = False, unit: float = 1.0, **head: int) -> bytes:
    """Type 02; `unit` [m]."""
    axes = _Y_UP if y_up else np.eye(3)
    return _pose(2, placed, NAMES, {n: _absolute(*placed[n], axes, unit) for n in placed}, **head)


def euler(placed: Placed, **head: int) -> bytes:
    """Type 01: centimetres, degrees, Y up."""
    rows = {}
    for name, (place, turn) in placed.items():
        own = Rotation.from_matrix(_Y_UP @ turn.as_matrix() @ _Y_UP.T)
        rows[name] = [*(100 * _Y_UP @ place), *own.as_euler("xyz", degrees=True)]
    return _pose(1, placed, NAMES, rows, **head)


def unity(placed: Placed, **head: int) -> bytes:
    """Type 05: metres, Y up, left-handed, in the parent."""
    rows = {}
    for name, (place, turn) in placed.items():
        parent = BODY[name][0]
        if parent is not None:
            above, up = placed[parent]
            place, turn = up.inv().apply(place - above), up.inv() * turn
        rows[name] = _absolute(place, turn, _UNITY, 1.0)
    return _pose(5, placed, UNITY_NAMES, rows, **head)


def scale(placed: Placed, spelled: Mapping[str, str] | None = None) -> bytes:
    """Type 13: where the segments begin in the T-pose."""
    payload = struct.pack(">i", len(placed))
    for name, (place, _) in placed.items():
        raw = (spelled or {}).get(name, name).encode()
        payload += struct.pack(">i", len(raw)) + raw + struct.pack(">fff", *place)
    return header(13, len(placed), len(payload) + 4) + payload + struct.pack(">i", 0)


def header(
    kind: int,
    items: int,
    size: int,
    *,
    sample: int = 0,
    part: int = 0x80,
    character: int = 0,
    props: int = 0,
    fingers: int = 0,
) -> bytes:
    """The 24 bytes before a datagram's content."""
    counts = bytes([character, 23, props, fingers])
    return (
        b"MXTP%02d" % kind
        + (sample % 2**32).to_bytes(4, "big")
        + bytes([part, items])
        + (1000).to_bytes(4, "big")
        + counts
        + bytes(2)
        + size.to_bytes(2, "big")
    )


def numbered(datagram: bytes, sample: int) -> bytes:
    """A datagram with another sample counter."""
    return datagram[:6] + (sample % 2**32).to_bytes(4, "big") + datagram[10:]


def _absolute(
    place: Float[np.ndarray, "3"], turn: Rotation, axes: Float[np.ndarray, "3 3"], unit: float
) -> list[float]:
    x, y, z, w = Rotation.from_matrix(axes @ turn.as_matrix() @ axes.T).as_quat()
    return [*(axes @ place / unit), w, x, y, z]


def _pose(
    kind: int,
    placed: Iterable[str],
    names: tuple[str, ...],
    rows: Mapping[str, Iterable[float]],
    **head: int,
) -> bytes:
    items = [(names.index(name) + 1, [*rows[name]]) for name in placed]
    payload = b"".join(struct.pack(f">I{len(row)}f", number, *row) for number, row in items)
    return header(kind, len(items), len(payload), **head) + payload
