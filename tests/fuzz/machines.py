"""Robots: their models, their motions in every format, and what lies beside those."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import spark_sim
from robots.formats import dispatch
from robots.model.known import known
from robots.model.mjcf import read_mjcf
from robots.model.morphology import Morphology
from robots.model.understand import understand_robot
from sim.body.build import build_body
from sim.body.mjcf import to_xml
from spark.demo.sample import sample_rig
from spark_sim.choices import Format
from spark_sim.live.journal import Journal, recover
from tests.fuzz.characters import motion_seeds
from tests.fuzz.target import FRAMES, Target, finite, goes_further

_LEGS = """\
<mujoco><worldbody><body name="pelvis" pos="0 0 .9"><freejoint/>
<geom type="box" size=".1 .1 .1" mass="9"/>{}</body></worldbody></mujoco>"""
_LEG = """
<body name="{0}_thigh" pos="0 {1}.1 0"><joint name="{0}_hip_x" axis="1 0 0" range="-40 40"/>
<joint name="{0}_hip" axis="0 1 0" range="-90 90"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".05"/>
<body name="{0}_shank" pos="0 0 -.4"><joint name="{0}_knee" axis="0 1 0" range="0 120"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".04"/>
<body name="{0}_foot" pos="0 0 -.4"><joint name="{0}_ankle" axis="0 1 0" range="-40 40"/>
<geom type="box" size=".1 .04 .02" pos=".04 0 -.03"/></body></body></body>"""


@cache
def _robot() -> Morphology:
    return known("robot")


def _seeds(*ways: tuple[Format, str]) -> Callable[[Path], list[bytes]]:
    """A motion of the robot that ships, in these formats and endings."""

    def made(folder: Path) -> list[bytes]:
        motion_seeds(folder)
        moved = spark_sim.retarget(folder / "cm.bvh", "robot", refine=False)
        return [
            moved.save(folder / f"seed{ending}", force=True, format=format).read_bytes()
            for format, ending in ways
        ]

    return made


def _use_motion(path: Path) -> None:
    given = {"quat": "xyzw", "fps": 30.0} if path.suffix == ".csv" else {}
    motion = dispatch.read(path, _robot(), **given)
    finite(qpos=motion.qpos, root=motion.motion.root_pos)
    if goes_further(path) and len(motion) <= 4 * FRAMES:
        clip = spark_sim.load(path, robot="robot", **given)
        spark_sim.report(clip).json()


def _beside_seeds(folder: Path) -> list[bytes]:
    """The JSON beside a CSV, which stays whole."""
    _seeds(("csv", ".csv"))(folder)
    (folder / "case.csv").write_bytes((folder / "seed.csv").read_bytes())
    return [(folder / "seed.csv.json").read_bytes()]


def _use_beside(path: Path) -> None:
    motion = dispatch.read(path.with_suffix(""))
    finite(qpos=motion.qpos, root=motion.motion.root_pos)


def _sonic_seeds(folder: Path) -> list[bytes]:
    """All of SONIC's files that are read, one after the other; the case is one of them."""
    motion_seeds(folder)
    moved = spark_sim.retarget(folder / "cm.bvh", "robot", refine=False).resampled(50.0)
    moved.save(folder / "sonic", format="sonic")
    return [f"{name}\n".encode() + (folder / "sonic" / name).read_bytes() for name in _SONIC]


_SONIC = ("joint_pos.csv", "body_pos.csv", "body_quat.csv", "metadata.txt", "info.txt")


def _use_sonic(path: Path) -> None:
    """The first line says which file of the folder the rest replaces, for this time."""
    first, _, rest = path.read_bytes().partition(b"\n")
    name = next((name for name in _SONIC if name.encode() == first), _SONIC[len(first) % 5])
    target = path.parent / "sonic" / name
    whole = target.read_bytes()
    target.write_bytes(rest)
    try:
        motion = dispatch.read(target.parent, _robot())
        finite(qpos=motion.qpos, root=motion.motion.root_pos)
    finally:
        target.write_bytes(whole)


def _session_seeds(folder: Path) -> list[bytes]:
    """What a live session that was killed leaves."""
    robot = spark_sim.load("robot")
    journal = Journal(folder / "session.npz", robot, "robot", 1 / 50)
    for step in range(FRAMES):
        journal.write(step + step // 4, robot.qpos[0])
    return [(folder / "session.npz.part").read_bytes()]


def _use_session(path: Path) -> None:
    motion = dispatch.read(recover(path, force=True))
    finite(qpos=motion.qpos, root=motion.motion.root_pos)


def _legs() -> str:
    return _LEGS.format("".join(_LEG.format(side, sign) for side, sign in _SIDES))


_SIDES = (("left", ""), ("right", "-"))


def _mjcf_seeds(folder: Path) -> list[bytes]:
    ember = Path(spark_sim.__file__).parents[1] / "robots" / "ember" / "ember.xml"
    return [
        *[_legs().encode()] * 6,
        ember.read_bytes(),
        to_xml(build_body(sample_rig("walker"))).encode(),
    ]


def _urdf_seeds(folder: Path) -> list[bytes]:
    import mujoco

    from tests.helpers.urdf import twins

    return [twins(mujoco.MjSpec.from_string(_legs()))[1].encode()]


def _use_model(path: Path) -> None:
    model = read_mjcf(path, visuals=False)
    if goes_further(path):
        finite(tpose=understand_robot(model).rig.tpose)


FORMATS: dict[str, Target] = {
    "npz": Target(
        ".npz",
        _seeds(
            *(("npz", ".npz"), ("mjlab", ".npz"), ("beyondmimic", ".npz")),
            *(("holomotion", ".npz"), ("holosoma", ".npz"), ("locomujoco", ".npz")),
        ),
        _use_motion,
    ),
    "csv": Target(".csv", _seeds(("csv", ".csv"), ("bones-seed", ".csv")), _use_motion),
    "pkl": Target(".pkl", _seeds(("gmr", ".pkl")), _use_motion),
    "motion": Target(".motion", _seeds(("protomotions", ".motion")), _use_motion),
    "sidecar": Target(".csv.json", _beside_seeds, _use_beside),
    "session": Target(".npz.part", _session_seeds, _use_session),
    "sonic": Target(".file", _sonic_seeds, _use_sonic),
    "mjcf": Target(".xml", _mjcf_seeds, _use_model),
    "urdf": Target(".urdf", _urdf_seeds, _use_model),
}
