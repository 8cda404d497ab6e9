"""The application: command line and public Python API.

    import spark_sim

    walk = spark_sim.load("walk.bvh")
    out = spark_sim.retarget(walk, "mutant.bvh")
    out.save("out.bvh")
    print(spark_sim.report(out, source=walk).text())
    spark_sim.retarget(walk, "robot").save("robot.npz")

Names are loaded when they are first used, so that the import itself costs nothing.
"""

TYPE_CHECKING = False  # what type checkers take as true; `typing` itself takes time to import

DISTRIBUTION = "spark-sim"

if TYPE_CHECKING:
    from typing import Any

    from sim.report import Report
    from spark.errors import SparkSimError
    from spark_sim.api import play, report, retarget, sample
    from spark_sim.clips import AnyClip, Clip, RobotClip
    from spark_sim.live.listener import Listener
    from spark_sim.live.retargeter import Retargeter
    from spark_sim.loading import load
    from spark_sim.simulation import Followed, Simulated, follow, simulate

_MODULE_OF = {
    "AnyClip": "spark_sim.clips",
    "Clip": "spark_sim.clips",
    "Followed": "spark_sim.simulation",
    "Listener": "spark_sim.live.listener",
    "Report": "sim.report",
    "Retargeter": "spark_sim.live.retargeter",
    "RobotClip": "spark_sim.clips",
    "Simulated": "spark_sim.simulation",
    "SparkSimError": "spark.errors",
    "follow": "spark_sim.simulation",
    "load": "spark_sim.loading",
    "play": "spark_sim.api",
    "report": "spark_sim.api",
    "retarget": "spark_sim.api",
    "sample": "spark_sim.api",
    "simulate": "spark_sim.simulation",
}
__all__ = [
    "AnyClip",
    "Clip",
    "Followed",
    "Listener",
    "Report",
    "Retargeter",
    "RobotClip",
    "Simulated",
    "SparkSimError",
    "follow",
    "load",
    "play",
    "report",
    "retarget",
    "sample",
    "simulate",
]


def __getattr__(name: str) -> "Any":
    if name == "__version__":
        from spark_sim.version import own_version

        return own_version()
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
