"""The Virtual Motion Capture protocol: a person's pose as VMC apps (VirtualMotionCapture, VSeeFace,
Warudo and others) send it through OSC, by default to UDP port 39539.

The protocol is at https://protocol.vmc.info/english. Bones are Unity's `HumanBodyBones`, with their
places and turns in their parents, in metres, X to the right, Y up, Z ahead, left-handed. A rig of
VRM 0 is in its T-pose where no bone is turned.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot, isfinite

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError
from spark.io import osc
from spark.io.live_pose import LivePose, Order, Places, Pose, tpose_of
from spark.motion import Motion
from spark.rotation import quat_mul, quat_rotate
from spark.skeleton import Skeleton

PARENTS: dict[str, tuple[str, ...]] = {
    "Hips": (),
    "Spine": ("Hips",),
    "Chest": ("Spine",),
    "UpperChest": ("Chest", "Spine"),
    "Neck": ("UpperChest", "Chest", "Spine"),
    "Head": ("Neck", "UpperChest", "Chest", "Spine"),
}
"""The bones that a bone may hang on, the nearest first; a rig may lack some."""
for _side in ("Left", "Right"):
    PARENTS |= {
        f"{_side}UpperLeg": ("Hips",),
        f"{_side}LowerLeg": (f"{_side}UpperLeg",),
        f"{_side}Foot": (f"{_side}LowerLeg",),
        f"{_side}Toes": (f"{_side}Foot",),
        f"{_side}Shoulder": ("UpperChest", "Chest", "Spine"),
        f"{_side}UpperArm": (f"{_side}Shoulder", "UpperChest", "Chest", "Spine"),
        f"{_side}LowerArm": (f"{_side}UpperArm",),
        f"{_side}Hand": (f"{_side}LowerArm",),
    }
_LIMBS = ("UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand")
_MOST_PACKETS = 256  # of one clock that are remembered
_COARSE = 4096.0  # [s]: clocks are single floats, which from here on leave out half milliseconds
NEEDED = ("Hips", "Spine", "Head", *(f"{s}{bone}" for s in ("Left", "Right") for bone in _LIMBS))


@dataclass
class VmcPose(LivePose):
    """The newest pose of a VMC sender."""

    _order: Order = field(default_factory=Order)
    _root: Float[np.ndarray, "7"] = field(default_factory=lambda: np.array([0.0, 0, 0, 1, 0, 0, 0]))
    _bones: dict[str, Float[np.ndarray, "7"]] = field(default_factory=dict)
    _clock: float = float("nan")
    # Packets with that clock: a pose may be in several.
    _seen: set[int] = field(default_factory=set)

    def take(self, packet: bytes, now: float) -> bool:
        try:
            parts = list(osc.messages(packet))
        except ConventionError:
            self.dropped += 1
            return False
        times = [
            float(a[0])
            for name, a in parts
            if name == "/VMC/Ext/T" and a and isinstance(a[0], float | int) and np.isfinite(a[0])
        ]
        if times and self._order.is_late(times[-1], now):
            self.reordered += 1
            return False
        if times and self._is_repeated(packet, times[-1]):
            self.repeated += 1
            return False
        if times:
            self.clock = times[-1] if abs(times[-1]) < _COARSE else None
        told = False
        for name, arguments in parts:
            if name not in ("/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos"):
                continue
            pose = _pose(arguments)
            if pose is None:
                self.dropped += 1
            elif name.endswith("Root/Pos"):
                self._root = pose
            elif arguments[0] in PARENTS:
                bone = str(arguments[0])
                self._bones[bone], self.heard[bone], told = pose, now, True
        self.frames += told
        return told

    def _is_repeated(self, packet: bytes, clock: float) -> bool:
        if clock != self._clock or len(self._seen) > _MOST_PACKETS:
            self._clock, self._seen = clock, set()
        content = hash(packet)
        repeated = content in self._seen
        self._seen.add(content)
        return repeated

    @property
    def missing(self) -> tuple[str, ...]:
        return tuple(bone for bone in NEEDED if bone not in self._bones)

    @property
    def notes(self) -> tuple[str, ...]:
        return ("VMC: metres, Y up, left-handed; in its T-pose where no bone is turned",)

    def bones(self) -> Places:
        return {bone: self._bones[bone][:3] for bone in PARENTS if bone in self._bones}

    def tpose(self, frame_time: float) -> Motion:
        return tpose_of(self.bones(), PARENTS, frame_time)

    def frame(self, skeleton: Skeleton) -> Pose:
        hips = self._bones["Hips"]
        place = self._root[:3] + quat_rotate(self._root[3:], hips[:3])
        turns = np.array([self._bones[bone][3:] for bone in skeleton.names])
        turns[0] = quat_mul(self._root[3:], hips[3:])
        return place, turns, None


def packet(
    bones: Mapping[str, tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4"]]], clock: float
) -> bytes:
    """A pose as a sender sends it at `clock` [s]: for each bone its place in its parent [m] and its
    turn (wxyz), in our axes."""
    parts = [osc.message("/VMC/Ext/OK", 1), osc.message("/VMC/Ext/T", float(clock))]
    for bone, ((x, y, z), (w, i, j, k)) in bones.items():
        values = (-y, z, x, j, -k, -i, w)
        parts.append(osc.message("/VMC/Ext/Bone/Pos", bone, *map(float, values)))
    return osc.bundle(parts)


def _numbers(arguments: list[osc.Argument]) -> bool:
    return all(isinstance(a, float | int) and isfinite(a) for a in arguments)


def _pose(arguments: list[osc.Argument]) -> Float[np.ndarray, "7"] | None:
    """Place and turn (wxyz) in our axes (X ahead, Y left, Z up, right-handed); None if broken."""
    if len(arguments) < 8 or not isinstance(arguments[0], str) or not _numbers(arguments[1:8]):
        return None
    x, y, z, i, j, k, w = (float(a) for a in arguments[1:8] if isinstance(a, float | int))
    size = hypot(i, j, k, w)
    if not 0.5 < size < 2.0 or max(abs(x), abs(y), abs(z)) > 1e3:
        return None
    # A mirror takes left-handed axes to ours, so axes of turns change their sign as well.
    return np.array([z, -x, y, w / size, -k / size, i / size, -j / size])
