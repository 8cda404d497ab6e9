"""A clip of a dataset as the recording that it was: on its body with the rest pose that its file
has, over the file's own ground."""

from dataclasses import replace

import numpy as np

from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_rotate
from spark.training.dataset import Performance
from spark.training.variants import Variant, same_body
from spark.transfer.analytic import FLOOR_TOLERANCE
from spark.transfer.canonical import CanonicalMotion


def on_ground(
    one: Performance, variant: Variant | None = None, frames: int | None = None
) -> CanonicalMotion:
    """The clip of `one` in hip heights, on its body or on a `variant` of it; the first `frames`.

    A dataset counts heights from the floor that the feet stand on. Here z = 0 is that of the file,
    as it is for `retarget`, unless the feet say that the floor is elsewhere.
    """
    clip, body = one.clip, one.clip.body
    variant = variant or same_body(body)
    rotations = variant.rotations(np.asarray(clip.rotations[:frames], np.float64))
    floor = one.floor_z / body.rig.hip_height
    if abs(floor) > FLOOR_TOLERANCE:
        floor = 0.0
    hips = np.asarray(clip.hips[:frames], np.float64) + np.array([0.0, 0.0, floor])
    rig = _at_rest(variant, body.rig.tpose[body.joints[variant.first]])
    return CanonicalMotion(rig, clip.frame_time, rotations, hips, floor)


def _at_rest(variant: Variant, tpose: np.ndarray) -> Rig:
    """The variant's rig with the rest pose that is turned into the T-pose by `tpose`."""
    rig = variant.body.rig
    skeleton = rig.skeleton
    offsets = quat_rotate(quat_conj(tpose[skeleton.parents]), skeleton.offsets)
    offsets[0] = skeleton.offsets[0]
    return replace(rig, skeleton=replace(skeleton, offsets=offsets), tpose=tpose)
