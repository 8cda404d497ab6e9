"""A motion played as a sender of poses: to try what listens without a suit or trackers."""

import socket
import time
from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError
from spark.io import mvn, vmc
from spark.io.live_pose import Places, tpose_of
from spark.io.mvn_body import PARENTS, mean_body
from spark.kinematics import forward
from spark.motion import Motion
from spark.resample import frames_at_rate, motion_at
from spark.rig.rig import Rig, understand
from spark.summary import counted
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical
from spark.transfer.foot_lock import lock_feet
from spark_sim.clips import AnyClip
from spark_sim.live.address import SOURCES, parse, resolved

_STANDS = 1.0  # [s] before the motion, in its first pose: so that who listens has seen all bones
_ABOUT_EVERY = 1.0  # [s]: MVN tells of the T-pose and the name again

_VMC_BONES: dict[str, tuple[str, ...]] = {
    "Hips": ("Pelvis",),
    "Spine": ("L5",),
    "Chest": ("L3",),
    "UpperChest": ("T12", "T8"),
    "Neck": ("Neck",),
    "Head": ("Head",),
}
"""Of which of MVN's segments a bone's place in its parent is the sum."""
for _side in ("Left", "Right"):
    for _bone in ("Shoulder", "UpperArm", "Hand", "UpperLeg", "LowerLeg", "Foot"):
        _VMC_BONES[f"{_side}{_bone}"] = (f"{_side}{_bone}",)
    _VMC_BONES |= {f"{_side}LowerArm": (f"{_side}Forearm",), f"{_side}Toes": (f"{_side}Toe",)}


def play(clip: AnyClip, address: str, fps: float | None, note: Callable[[str], object]) -> None:
    """Send a motion once, at its own rate or another, on a body of our own that is as tall.

    Raises `ConventionError` where the address is not one that senders of poses send to, and
    `SkeletonError` where the motion is no humanoid's.
    """
    where = parse(
        address, {scheme: a.replace("//:", "//localhost:") for scheme, a in SOURCES.items()}
    )
    to = resolved(where)
    motion = on_body(clip, where.scheme, fps)
    rate = 1.0 / motion.frame_time
    packets = _as_vmc(motion) if where.scheme == "vmc" else _as_mvn(motion, clip.name)
    held = round(_STANDS * rate)
    frames = counted(len(motion), "frame")
    note(f"stands for {_STANDS:g} s, then sends {frames} to {where}, {rate:g} a second")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        began = time.monotonic()
        for k, several in enumerate(packets(held)):
            time.sleep(max(began + k * motion.frame_time - time.monotonic(), 0.0))
            for packet in several:
                try:
                    out.sendto(packet, to)
                except ConnectionError:  # no one listens yet
                    continue
                except OSError as error:
                    raise ConventionError(
                        f"{where}: can't be sent to ({error.strerror})"
                    ) from error


def on_body(clip: AnyClip, scheme: str, fps: float | None = None) -> Motion:
    """The motion on the body that is sent, its floor at 0."""
    body = _body(scheme)
    names = vmc.PARENTS if scheme == "vmc" else PARENTS
    rig = understand(tpose_of(body, names, 1.0))
    size = clip.rig.hip_height / rig.hip_height
    scaled: Rig = understand(tpose_of({n: size * place for n, place in body.items()}, names, 1.0))
    canonical = clip.canonical
    motion = from_canonical(lock_feet(canonical, transfer(canonical, scaled)))
    if fps is None:
        return motion
    return motion_at(motion, frames_at_rate(len(motion), motion.frame_time, 1.0 / fps), 1.0 / fps)


def _body(scheme: str) -> Places:
    body = mean_body()
    if scheme == "xsens":
        return body
    return {bone: np.sum([body[part] for part in _VMC_BONES[bone]], axis=0) for bone in vmc.PARENTS}


def _frames(motion: Motion, held: int) -> Iterator[tuple[int, int]]:
    yield from enumerate([*[0] * held, *range(len(motion))])


def _as_vmc(motion: Motion) -> Callable[[int], Iterator[list[bytes]]]:
    names, offsets = motion.skeleton.names, motion.skeleton.offsets

    def packets(held: int) -> Iterator[list[bytes]]:
        for k, t in _frames(motion, held):
            places: list[Float[np.ndarray, 3]] = [motion.root_pos[t], *offsets[1:]]
            bones = dict(zip(names, zip(places, motion.rotations[t], strict=True), strict=True))
            yield [vmc.packet(bones, k * motion.frame_time)]

    return packets


def _as_mvn(motion: Motion, name: str) -> Callable[[int], Iterator[list[bytes]]]:
    names = motion.skeleton.names
    positions, world = forward(motion)
    tpose = dict(zip(names, motion.skeleton.rest_positions, strict=True))
    tpose = {n: place - tpose["Pelvis"] for n, place in tpose.items()}
    about = [mvn.scale_datagram(tpose), mvn.meta_datagram({"name": name})]
    often = max(round(_ABOUT_EVERY / motion.frame_time), 1)

    def packets(held: int) -> Iterator[list[bytes]]:
        for k, t in _frames(motion, held):
            values = np.concatenate([positions[t], world[t]], axis=1)
            pose = mvn.pose_datagram(
                dict(zip(names, values, strict=True)),
                sample=k,
                time_ms=round(1000 * k * motion.frame_time),
            )
            yield [*(about if k % often == 0 else ()), pose]

    return packets
