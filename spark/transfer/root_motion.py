"""Root motion: of bodies that a joint above their hips carries through the world, as game engines
have it, that joint goes the source's way, and the hips do what is left.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.kinematics import forward
from spark.motion import Motion, lazy_motion
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_rotate

_LEAST = 0.05  # [hip heights] over the ground: less is no way


def with_root_motion(
    motion: Motion, rig: Rig, source: Motion, source_rig: Rig, travel: float
) -> tuple[Motion, tuple[str, ...]]:
    """`motion` on `rig`, made of `source` frame by frame, whose topmost joint goes over the ground
    as the source's, `travel` times as far, while every joint from `rig.root_joint` down stays where
    it was in the world; and a note. The same motion where one of the two bodies has no such joint
    above the one that moves its hips, or the source's stays in its place."""
    way = source.root_pos[:, :2]
    if 0 in (rig.root_joint, source_rig.root_joint) or not len(way):
        return motion, ()
    if np.ptp(way, axis=0).max() < _LEAST * source_rig.hip_height:
        return motion, ()
    rest, own_rest = (each.offsets[0, :2] for each in (source.skeleton, motion.skeleton))
    shift = np.zeros((len(motion), 3))
    shift[:, :2] = own_rest + travel * (way - rest) - motion.root_pos[:, :2]
    carried = lazy_motion(lambda span: _carried(motion.picked(span), rig, shift[span]), len(motion))
    own, theirs = motion.skeleton.names[0], source.skeleton.names[0]
    return carried, (f"{own!r} goes over the ground as the source's {theirs!r} does: root motion",)


def _carried(motion: Motion, rig: Rig, shift: Float[np.ndarray, "T 3"]) -> Motion:
    """With its topmost joint elsewhere by `shift` [m, world], under a body that stays."""
    assert motion.translations is not None
    _, world = forward(motion)
    above = world[:, int(rig.skeleton.parents[rig.root_joint])]
    translations = motion.translations.copy()
    translations[:, 0] += shift
    translations[:, rig.root_joint] -= quat_rotate(quat_conj(above), shift)
    return replace(motion, root_pos=motion.root_pos + shift, translations=translations)
