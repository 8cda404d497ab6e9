"""The application: command line and public Python API.

    import spark_sim

    walk = spark_sim.load("walk.bvh")
    out = spark_sim.retarget(walk, "mutant.bvh")
    out.save("out.bvh")
    print(spark_sim.report(out, source=walk).text())
    spark_sim.retarget(walk, "robot").save("robot.npz")

Names are loaded when they are first used, so that the import itself costs nothing.
"""

from typing import TYPE_CHECKING, Any

DISTRIBUTION = "spark-sim"

if TYPE_CHECKING:
    from spark.errors import SparkSimError
    from spark_sim.clip import Clip, load, play, report, retarget, sample
    from spark_sim.robot import Retargeter, RobotClip
    from spark_sim.show import Simulated, simulate

__all__ = [
    "Clip",
    "Retargeter",
    "RobotClip",
    "Simulated",
    "SparkSimError",
    "load",
    "play",
    "report",
    "retarget",
    "sample",
    "simulate",
]
_ELSEWHERE = {
    "SparkSimError": "spark.errors",
    "Retargeter": "spark_sim.robot",
    "RobotClip": "spark_sim.robot",
    "Simulated": "spark_sim.show",
    "simulate": "spark_sim.show",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version(DISTRIBUTION)
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_ELSEWHERE.get(name, "spark_sim.clip")), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
