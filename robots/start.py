"""Where the solver starts: a copied motion, moved by what a network has learned of solved ones.

The network, two convolutions over time, sees the cues of `robots.cues` and says how each part and
the hips are to move: much of what the solver does to a copy is alike on all robots (legs that give
way to the floor, shoulders that make up for what an elbow can't). It has learned that on other
motions, and on robots with other limbs and limits (`scripts/train_start.py`). A start changes how
long the solver takes and which optimum it comes to; what is asked for stays the same.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float
from safetensors.numpy import load_file
from scipy.ndimage import gaussian_filter1d

from robots.cues import Pose, answer_mirror, cue_mirror, cues_of, joints_of, pose_of, read_answer
from robots.footing import Footing
from robots.morphology import Morphology
from robots.project import project
from robots.targets import Targets
from robots.ties import unhurried
from robots.tree import Coordinates, forward
from spark.roles import Role
from spark.rotation import (
    quat_conj,
    quat_continuous,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_relative,
    quat_rotate,
)

SHIPPED = Path(__file__).parent / "shipped" / "start.safetensors"
STRIDES = 1, 2  # frames from one that a convolution sees to the next
MOST = 4.0  # standard deviations that a cue may be from its mean
_SMOOTH = 1.0  # frames over which the start is smoothed (a Gaussian's standard deviation)

Layers = dict[str, Float[np.ndarray, "..."]]


def learned_start(
    robot: Morphology,
    targets: Targets,
    footing: Sequence[Footing],
    q: Coordinates,
    layers: Layers | None = None,
) -> Coordinates:
    """Coordinates within the limits, nearer to the solved ones than the copied `q` are.

    Frames should be about `1 / 20` s apart, as those are that the network was trained on. `layers`
    are those in the package, where no other ones are given.
    """
    frames = forward(robot.tree, q)
    pose = pose_of(robot, frames)
    answer = predict(cues_of(robot, targets, footing, frames, pose), layers or shipped())
    return smoothed(unhurried(robot, moved(robot, targets, pose, answer), targets.frame_time))


@cache
def shipped() -> Layers:
    """The layers in the package, read when they are first asked for."""
    return {name: layer.astype(np.float32) for name, layer in load_file(SHIPPED).items()}


def predict(cues: Float[np.ndarray, "T C"], layers: Layers) -> Float[np.ndarray, "T A"]:
    """The network's answer: the mean of what it says to the cues and to their mirror image."""
    order, signs = cue_mirror()
    back, back_signs = answer_mirror()
    seen, mirrored = (
        _network(c.astype(np.float32), layers) for c in (cues, cues[:, order] * signs)
    )
    return (seen + mirrored[:, back] * back_signs) / 2


def moved(
    robot: Morphology, targets: Targets, pose: Pose, answer: Float[np.ndarray, "T A"]
) -> Coordinates:
    """A pose with its parts and hips moved as an answer says, as far as hinges can. The head and
    collarbones turn as they are wanted; what has no role goes with the part that it hangs on."""
    rig, was = robot.rig, pose.world
    turns, hips = read_answer(pose, answer, rig.hip_height)
    parts = {j: turns[:, k] for k, j in reversed(list(enumerate(joints_of(rig)))) if j is not None}
    spine = rig.roles.joints(Role.SPINE)
    for i, j in enumerate(spine[:-1]):
        share = (i + 1) / len(spine)
        parts[j] = (1 - share) * parts[rig.pelvis] + share * parts[spine[-1]]
    world = targets.world.copy()
    for j, parent in enumerate(rig.skeleton.parents.tolist()):
        if j in parts:
            own = quat_rotate(quat_conj(rig.tpose[j]), parts[j])
            world[:, j] = quat_mul(was[:, j], quat_from_rotvec(own))
        elif rig.roles.roles[j] is None and parent >= 0:
            world[:, j] = quat_mul(world[:, parent], quat_relative(was[:, parent], was[:, j]))
    return project(robot, world, hips)


def smoothed(q: Coordinates) -> Coordinates:
    """The same without what is left of the copy's jitter."""

    def smooth(values: Float[np.ndarray, "T *n"]) -> Float[np.ndarray, "T *n"]:
        return gaussian_filter1d(values, _SMOOTH, axis=0, mode="nearest")

    def smooth_turns(turns: Float[np.ndarray, "T *n 4"]) -> Float[np.ndarray, "T *n 4"]:
        return quat_normalize(smooth(quat_continuous(turns)))

    turns = None if q.turns is None else smooth_turns(q.turns)
    return Coordinates(smooth(q.pos), smooth_turns(q.quat), smooth(q.angles), turns)


def _network(cues: Float[np.ndarray, "T C"], layers: Layers) -> Float[np.ndarray, "T A"]:
    x = np.clip((cues - layers["mean"]) / layers["scale"], -MOST, MOST)
    first = _silu(_convolved(x, layers["first"], STRIDES[0]) + layers["first_bias"])
    second = first + _silu(_convolved(first, layers["second"], STRIDES[1]) + layers["second_bias"])
    said = _times(second, layers["last"]) + layers["last_bias"]
    return said + _times(x, layers["straight"])


def _convolved(
    x: Float[np.ndarray, "T I"], kernel: Float[np.ndarray, "W I O"], stride: int
) -> Float[np.ndarray, "T O"]:
    """Over time; before and after it, the first and last frames go on."""
    reach = len(kernel) // 2 * stride
    padded = np.pad(x, ((reach, reach), (0, 0)), mode="edge")
    out = np.zeros((len(x), kernel.shape[2]), dtype=x.dtype)
    for k, weights in enumerate(kernel):
        out += _times(padded[k * stride : k * stride + len(x)], weights)
    return out


def _times(
    x: Float[np.ndarray, "T I"], weights: Float[np.ndarray, "I O"]
) -> Float[np.ndarray, "T O"]:
    """Row by row: on a busy machine, BLAS's threads wait for each other longer than they work."""
    return (x[:, None] @ weights)[:, 0]


def _silu(x: Float[np.ndarray, "T H"]) -> Float[np.ndarray, "T H"]:
    return x / (1 + np.exp(-x))
