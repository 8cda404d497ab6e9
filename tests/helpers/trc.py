"""TRC files as markerless programs write them."""

from collections.abc import Sequence

import numpy as np

from spark.rig.roles import Role

# Names of HALPE's joints, as Pose2Sim has them, and what they are.
HALPE = {
    "Hip": Role.PELVIS,
    "RHip": Role.RIGHT_UPPER_LEG,
    "RKnee": Role.RIGHT_LOWER_LEG,
    "RAnkle": Role.RIGHT_FOOT,
    "RBigToe": Role.RIGHT_TOE,
    "LHip": Role.LEFT_UPPER_LEG,
    "LKnee": Role.LEFT_LOWER_LEG,
    "LAnkle": Role.LEFT_FOOT,
    "LBigToe": Role.LEFT_TOE,
    "Neck": Role.NECK,
    "Head": Role.HEAD,
    "RShoulder": Role.RIGHT_UPPER_ARM,
    "RElbow": Role.RIGHT_FOREARM,
    "RWrist": Role.RIGHT_HAND,
    "LShoulder": Role.LEFT_UPPER_ARM,
    "LElbow": Role.LEFT_FOREARM,
    "LWrist": Role.LEFT_HAND,
}


def trc_text(
    names: Sequence[str], points: np.ndarray, *, rate: float = 30.0, unit: str = "m"
) -> str:
    """Points (T P 3) as text; those that are NaN as empty fields, at a row's end as nothing."""
    axes = "\t".join(f"{axis}{i}" for i in range(1, len(names) + 1) for axis in "XYZ")
    head = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
        "OrigNumFrames",
        f"{rate!r}\t{rate!r}\t{len(points)}\t{len(names)}\t{unit}\t{rate!r}\t1\t{len(points)}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + axes,
    ]
    rows = []
    for i, frame in enumerate(points, start=1):
        fields = ["" if np.isnan(x) else f"{x:.5f}" for x in frame.ravel()]
        rows.append("\t".join([str(i), f"{(i - 1) / rate:.5f}", *fields]).rstrip("\t"))
    return "\n".join([*head, "", *rows, ""])
