"""`spark-sim robots`: the robots that have names here."""

from argparse import ArgumentParser, Namespace

from spark_sim.commands.options import add_json

SUMMARY = "list the robots that have names"
USAGE = "[--json]"
DESCRIPTION = """\
List the robots that `--to` and `--robot` know by name: number of joints,
height, origin and licence of the model, and how to install it. Any other
humanoid robot is given by the path of its MJCF or URDF file."""
EXAMPLES = """\
examples:
  spark-sim robots
  spark-sim retarget walk.bvh --to unitree_g1
  spark-sim retarget walk.bvh --to path/to/robot.xml
"""


def configure(parser: ArgumentParser) -> None:
    add_json(parser, "one line for each robot")


def run(args: Namespace) -> int:
    from robots import registry
    from spark_sim import console

    if args.json:
        for entry in registry.ENTRIES:
            console.emit_json(
                {
                    "name": entry.name,
                    "joints": entry.joints,
                    "height": entry.height,
                    "from": entry.origin,
                    "licence": entry.licence,
                    "path": None if entry.path is None else str(entry.path),
                    "install": f"pip install '{entry.requirement}'",
                }
            )
        return 0
    rows = [("name", "joints", "height", "from", "licence", "")]
    rows += [
        (
            entry.name,
            str(entry.joints),
            f"{entry.height:.2f} m",
            entry.origin,
            entry.licence,
            "installed" if entry.path else f"pip install '{entry.requirement}'",
        )
        for entry in registry.ENTRIES
    ]
    console.say("\n".join(console.columns(rows)))
    others = registry.downloads()
    if others:
        console.say(
            f"\n  and {len(others)} models of robot_descriptions by their own names, "
            f"{others[0]} to {others[-1]};\n  each is downloaded when it is first asked for, and "
            "not all are humanoids"
        )
    else:
        console.say(
            "\n  `pip install robot_descriptions` adds more by their own names, such as "
            "g1_mj_description;\n  each is downloaded when it is first asked for"
        )
    return 0
