"""MuJoCo bodies for skeletons, playback of motions on them, and the plausibility report."""

import os

DISTRIBUTION = "spark-sim"


def has_display() -> bool:
    """Whether a window can be opened."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


# MuJoCo chooses how it draws when it is first imported, which is after this.
if not has_display():
    os.environ.setdefault("MUJOCO_GL", "egl")
