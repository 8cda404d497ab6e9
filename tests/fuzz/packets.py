"""What comes from a network: poses of VMC and of Xsens MVN, a packet a case."""

from collections.abc import Callable
from pathlib import Path

from scipy.spatial.transform import Rotation

from spark.io.live_pose import LivePose
from spark.io.mvn_pose import MvnPose
from spark.io.vmc import VmcPose
from spark.kinematics import forward
from spark.motion import Motion
from tests.fuzz.target import Target, finite
from tests.helpers import mvn, vmc

_BENT = {bone: Rotation.from_rotvec([0.3, -0.2, 0.4]) for bone in (*mvn.NAMES, *vmc.BODY)}


def _vmc_seeds(folder: Path) -> list[bytes]:
    return [vmc.packet(_BENT, 3.0)]


def _mvn_seeds(folder: Path) -> list[bytes]:
    poses = [send(mvn.world(_BENT)) for send in (mvn.quaternions, mvn.euler, mvn.unity)]
    return [*poses, mvn.scale(mvn.world({}))]


def _use(kind: type[LivePose], good: bytes) -> Callable[[Path], None]:
    def use(path: Path) -> None:
        """The packet comes first, or after a good one: what is made of the pose is finite."""
        for packets in ((path.read_bytes(), good), (good, path.read_bytes())):
            pose = kind()
            for packet in packets:
                pose.take(packet, 0.0)
            assert all(isinstance(note, str) for note in pose.notes)
            if pose.missing:
                continue
            skeleton = pose.tpose(1 / 60).skeleton
            root, turns, _ = pose.frame(skeleton)
            moved = Motion(skeleton, 1 / 60, root[None], turns[None])
            finite(root=root, turns=turns, positions=forward(moved)[0])

    return use


FORMATS: dict[str, Target] = {
    "vmc": Target(".osc", _vmc_seeds, _use(VmcPose, vmc.packet({}, 1.0))),
    "xsens": Target(".mxtp", _mvn_seeds, _use(MvnPose, mvn.quaternions(mvn.world({})))),
}
