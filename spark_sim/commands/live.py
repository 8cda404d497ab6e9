"""`spark-sim live`: a robot follows a person who moves now."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from spark_sim.commands.options import add_force

SUMMARY = "let a robot follow a person who moves now"
USAGE = "--from vmc://[HOST]:PORT --to ROBOT [--send udp://HOST:PORT] [--record NPZ]"
DESCRIPTION = """\
Take a person's pose from the network as it comes, put it on a robot, and send
the robot's coordinates on. Poses come by the VMC protocol (OSC through UDP),
as VirtualMotionCapture, VSeeFace, Warudo and others send it. What is sent on
is one JSON object a frame: frame, time [s, Unix] and qpos, as MuJoCo has it.

Late and lost packets, and trackers that vanish, leave the last pose standing.
Ctrl-C ends it, and tells the latency."""
EXAMPLES = """\
examples:
  spark-sim live --from vmc://:39539 --to unitree_g1 --send udp://localhost:9000
  spark-sim live --from vmc://:39539 --to robot --record session.npz
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--from",
        dest="source",
        metavar="vmc://[HOST]:PORT",
        required=True,
        help="where poses come in; without a HOST, from any machine",
    )
    parser.add_argument("--to", metavar="ROBOT", required=True, help="a robot's name or MJCF")
    parser.add_argument("--send", metavar="udp://HOST:PORT", help="where coordinates go")
    parser.add_argument("--record", metavar="NPZ", help="write the robot's motion")
    parser.add_argument("--fps", type=float, default=60.0, help="frames a second (default: 60)")
    add_force(parser)


def run(args: Namespace) -> int:
    from contextlib import suppress

    from spark.errors import ConventionError
    from spark_sim import console, files
    from spark_sim.commands.session import Session, address

    host, port = address(args.source, "vmc", any_host=True)
    send = None if args.send is None else address(args.send, "udp")
    if args.send is None and args.record is None:
        raise ConventionError(
            "nothing would come of it; give --send udp://HOST:PORT or --record NPZ"
        )
    record = None if args.record is None else Path(args.record)
    if record is not None:
        files.claim(record, force=args.force, endings=(".npz",), what="a recording")
    with Session((host, port), args.to, args.fps, send=send, record=record) as session:
        console.note(f"listens on UDP port {session.port} for a pose; Ctrl-C ends it")
        with suppress(KeyboardInterrupt):
            session.run(console.note)
    console.say(session.summary())
    return 0
