"""The Virtual Motion Capture protocol: a person's pose as VMC apps (VirtualMotionCapture, VSeeFace,
Warudo and others) send it through OSC, by default to UDP port 39539.

The protocol is at https://protocol.vmc.info/english. Bones are Unity's `HumanBodyBones`, with their
places and turns in their parents, in metres, X to the right, Y up, Z ahead, left-handed. A rig of
VRM 0 is in its T-pose where no bone is turned.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError
from spark.io import osc
from spark.motion import Motion
from spark.rotation import quat_mul, quat_rotate
from spark.skeleton import Skeleton

_PARENTS: dict[str, tuple[str, ...]] = {
    "Hips": (),
    "Spine": ("Hips",),
    "Chest": ("Spine",),
    "UpperChest": ("Chest", "Spine"),
    "Neck": ("UpperChest", "Chest", "Spine"),
    "Head": ("Neck", "UpperChest", "Chest", "Spine"),
}
"""The bones that a bone may hang on, the nearest first; a rig may lack some."""
for _side in ("Left", "Right"):
    _PARENTS |= {
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
NEEDED = ("Hips", "Spine", "Head", *(f"{s}{bone}" for s in ("Left", "Right") for bone in _LIMBS))
_RESTART = 1.0  # [s]: a sender whose clock goes back by more has been started anew


@dataclass
class VmcPose:
    """The newest pose of a sender, put together from its packets.

    `dropped` counts packets that are no OSC or hold broken numbers, `reordered` those that are
    older than one that was taken before. `heard` says when each bone was last heard of [s].
    """

    dropped: int = 0
    reordered: int = 0
    frames: int = 0
    heard: dict[str, float] = field(default_factory=dict)
    _time: float = -np.inf
    _root: Float[np.ndarray, "7"] = field(default_factory=lambda: np.array([0.0, 0, 0, 1, 0, 0, 0]))
    _bones: dict[str, Float[np.ndarray, "7"]] = field(default_factory=dict)

    def take(self, packet: bytes, now: float) -> bool:
        """Take a packet that came at `now` [s]; whether it told of the pose."""
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
        if times:
            if self._time - _RESTART < times[-1] < self._time:
                self.reordered += 1
                return False
            self._time = times[-1]
        told = False
        for name, arguments in parts:
            if name not in ("/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos"):
                continue
            pose = _pose(arguments)
            if pose is None:
                self.dropped += 1
            elif name.endswith("Root/Pos"):
                self._root = pose
            elif arguments[0] in _PARENTS:
                bone = str(arguments[0])
                self._bones[bone], self.heard[bone], told = pose, now, True
        self.frames += told
        return told

    @property
    def missing(self) -> tuple[str, ...]:
        """The bones that are needed and were not heard of yet."""
        return tuple(bone for bone in NEEDED if bone not in self._bones)

    def tpose(self, frame_time: float) -> Motion:
        """One frame of the sender's rig in its T-pose, its lowest joint on the floor."""
        names = tuple(bone for bone in _PARENTS if bone in self._bones)
        parents = np.array([_parent(bone, names) for bone in names])
        offsets = np.array([self._bones[bone][:3] for bone in names])
        offsets[0] = 0.0
        places = offsets.copy()
        for j, parent in enumerate(parents.tolist()):
            if parent >= 0:
                places[j] += places[parent]
        turns = np.zeros((1, len(names), 4))
        turns[..., 0] = 1.0
        skeleton = Skeleton(names, parents, offsets, np.arange(len(names)) == 0)
        root = np.array([[0.0, 0.0, -places[:, 2].min()]])
        return Motion(skeleton, frame_time, root, turns)

    def frame(self, skeleton: Skeleton) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "J 4"]]:
        """The newest pose on the skeleton of `tpose`: the root's place and all local turns. A bone
        that is heard of no more stays as it was."""
        hips = self._bones["Hips"]
        place = self._root[:3] + quat_rotate(self._root[3:], hips[:3])
        turns = np.array([self._bones[bone][3:] for bone in skeleton.names])
        turns[0] = quat_mul(self._root[3:], hips[3:])
        return place, turns


def _parent(bone: str, names: tuple[str, ...]) -> int:
    found = [names.index(parent) for parent in _PARENTS[bone] if parent in names]
    return found[0] if found else -1


def _numbers(arguments: list[osc.Argument]) -> bool:
    return all(isinstance(a, float | int) and np.isfinite(a) for a in arguments)


def _pose(arguments: list[osc.Argument]) -> Float[np.ndarray, "7"] | None:
    """Place and turn (wxyz) in our axes (X ahead, Y left, Z up, right-handed); None if broken."""
    if len(arguments) < 8 or not isinstance(arguments[0], str) or not _numbers(arguments[1:8]):
        return None
    x, y, z, i, j, k, w = (float(a) for a in arguments[1:8] if isinstance(a, float | int))
    size = float(np.linalg.norm([i, j, k, w]))
    if not 0.5 < size < 2.0 or max(abs(x), abs(y), abs(z)) > 1e3:
        return None
    # A mirror takes left-handed axes to ours, so axes of turns change their sign as well.
    return np.array([z, -x, y, w / size, -k / size, i / size, -j / size])
