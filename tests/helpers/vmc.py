"""What a sender of the VMC protocol sends, for a person whose pose is known."""

import numpy as np
from scipy.spatial.transform import Rotation

from spark.io import osc

# A person in Unity's axes (X right, Y up, Z ahead): bone, its parent, its place in the parent [m].
BODY: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "Hips": (None, (0.0, 0.95, 0.0)),
    "Spine": ("Hips", (0.0, 0.12, 0.0)),
    "Chest": ("Spine", (0.0, 0.15, 0.0)),
    "Neck": ("Chest", (0.0, 0.22, 0.0)),
    "Head": ("Neck", (0.0, 0.1, 0.02)),
}
for side, x in (("Left", -1.0), ("Right", 1.0)):
    BODY |= {
        f"{side}UpperLeg": ("Hips", (0.09 * x, -0.05, 0.0)),
        f"{side}LowerLeg": (f"{side}UpperLeg", (0.0, -0.42, 0.0)),
        f"{side}Foot": (f"{side}LowerLeg", (0.0, -0.40, -0.02)),
        f"{side}Toes": (f"{side}Foot", (0.0, -0.06, 0.14)),
        f"{side}Shoulder": ("Chest", (0.03 * x, 0.17, 0.0)),
        f"{side}UpperArm": (f"{side}Shoulder", (0.13 * x, 0.0, 0.0)),
        f"{side}LowerArm": (f"{side}UpperArm", (0.27 * x, 0.0, 0.0)),
        f"{side}Hand": (f"{side}LowerArm", (0.25 * x, 0.0, 0.0)),
    }
FROM_UNITY = np.array([[0.0, 0, 1], [-1, 0, 0], [0, 1, 0]])
Turns = dict[str, Rotation]


def packet(
    turns: Turns,
    clock: float,
    hips: tuple[float, float, float] = (0.0, 0.95, 0.0),
    size: float = 1.0,
) -> bytes:
    """A pose at a clock [s], each bone turned in its parent."""
    parts = [osc.message("/VMC/Ext/T", clock)]
    for bone, (_, place) in BODY.items():
        quat = turns.get(bone, Rotation.identity()).as_quat()
        scaled = [size * x for x in (hips if bone == "Hips" else place)]
        parts.append(osc.message("/VMC/Ext/Bone/Pos", bone, *map(float, (*scaled, *quat))))
    return osc.bundle(parts)
