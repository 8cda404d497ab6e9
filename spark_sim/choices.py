"""The words that options take, for type checkers and editors."""

from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from sim.body.joints import JointType
    from spark.io.convention import Up

__all__ = ["Format", "JointType", "Method", "Quat", "RobotName", "Unit", "Up"]

Method = Literal["spark", "copy"]
"""How a motion is put on another body; `spark_sim.retarget` says more."""

Unit = Literal["m", "dm", "cm", "mm", "inch", "ft", "cmu"]
"""A file's unit of length; any other is given in metres."""

Quat = Literal["xyzw", "wxyz"]
"""The order of a CSV's quaternions."""

Format = Literal[
    "npz",
    "mjlab",
    "beyondmimic",
    "holosoma",
    "holomotion",
    "locomujoco",
    "csv",
    "csv-wxyz",
    "bones-seed",
    "gmr",
    "protomotions",
    "sonic",
]
"""What a robot's motion is written as; `robots.formats` says more."""

RobotName = Literal[
    "robot",
    "ember",
    "unitree_g1",
    "unitree_h1",
    "booster_t1",
    "apptronik_apollo",
    "berkeley_humanoid",
    "robotis_op3",
    "gymnasium_humanoid",
    "dm_control_humanoid",
    "dm_control_cmu",
    "g1_urdf",
    "talos",
    "icub",
    "romeo",
    "human",
    "alex",
    "baxter",
    "pr2",
    "tiago",
    "tiago_pro",
    "g1",
    "h1",
    "t1",
    "apollo",
    "op3",
]
"""The robots that `spark-sim robots` lists, and their aliases. A type checker knows that onto one
of these names `retarget` gives a `RobotClip`; of a path it can't."""
