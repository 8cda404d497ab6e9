"""`spark-sim live`: a robot follows a person who moves now."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from spark_sim.commands.options import add_force

if TYPE_CHECKING:
    from spark_sim.live.viewer import Viewer

_INSIST = 1.0  # [s]: a second Ctrl-C later than this ends it at once
SUMMARY = "let a robot follow a person who moves now"
USAGE = "--from vmc://[HOST]:PORT --to ROBOT [--send udp://HOST:PORT] [--record NPZ] [--view]"
DESCRIPTION = """\
Take a person's pose from the network as it comes, put it on a robot, and send
the robot's coordinates on. Poses come by the VMC protocol (vmc://, OSC), as
VirtualMotionCapture, VSeeFace, Warudo and others send it, or from Xsens MVN's
network streamer (xsens://). Coordinates go as JSON, or with ?bytes at the end
of the address as bytes (docs/live.md), in UDP datagrams (udp://) or ZeroMQ
messages (zmq:// is PUB, zmq+push:// is PUSH).

Poses that come less often than steps are taken, late or not at all are made
steady, and the robot follows later by what that takes. Trackers that vanish,
and a sender that does, leave the last pose standing. Ctrl-C ends it, makes a
motion of what was recorded, and tells the latency.

Without hardware: --from FILE --send vmc://HOST:PORT (or xsens://) plays a
motion as such a sender."""
EXAMPLES = """\
examples:
  spark-sim live --from xsens://:9763 --to unitree_g1 --send udp://localhost:9000
  spark-sim live --from vmc://:39539 --to robot --view --record session.npz
  spark-sim live --from walk.bvh --send xsens://localhost:9763
  spark-sim live --recover session.npz.part
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--from",
        dest="source",
        metavar="SOURCE",
        help="vmc://[HOST]:PORT or xsens://[HOST]:PORT: where poses come in, from any machine "
        "without a HOST; or a motion to play",
    )
    parser.add_argument("--to", metavar="ROBOT", help="a robot's name or MJCF")
    parser.add_argument(
        "--send",
        metavar="ADDRESS",
        action="append",
        default=[],
        help="udp://HOST:PORT, zmq://[HOST]:PORT or zmq+push://HOST:PORT: where coordinates go; "
        "may be given again",
    )
    parser.add_argument("--record", metavar="NPZ", help="write the robot's motion")
    parser.add_argument(
        "--fps", type=float, help="steps a second (default: 60; of a motion, its own)"
    )
    parser.add_argument("--view", action="store_true", help="show person and robot in a window")
    parser.add_argument("--serve", action="store_true", help="show them in a browser")
    parser.add_argument(
        "--address", metavar="HOST:PORT", help="with --serve: where (localhost:8765)"
    )
    parser.add_argument(
        "--recover", metavar="PART", help="make a motion of what a killed session recorded"
    )
    add_force(parser)


def run(args: Namespace) -> int:
    from spark.errors import ConventionError
    from spark.motion import check_frame_time
    from spark_sim import console

    if args.recover is not None:
        others = ("to", "send", "record", "fps", "view", "serve", "address")
        refused = ["from"] * (args.source is not None) + [o for o in others if getattr(args, o)]
        if refused:
            raise ConventionError(f"--recover goes alone, without --{refused[0]}")
        from spark_sim.live.journal import recover

        console.say(str(recover(Path(args.recover), force=args.force)))
        return 0
    if args.source is None:
        raise ConventionError("give --from, such as vmc://:39539 or xsens://:9763")
    if args.fps is not None:
        check_frame_time(1.0 / args.fps if args.fps > 0 else float("inf"))
    if "://" not in args.source:
        return _play(args)
    if args.to is None:
        raise ConventionError("give --to ROBOT: a robot's name (`spark-sim robots`) or its MJCF")
    if not (args.send or args.record or args.view or args.serve):
        raise ConventionError(
            "nothing would come of it; give --send udp://HOST:PORT, --record NPZ or --view"
        )
    if args.view and args.serve:
        raise ConventionError("--view and --serve are two views; give one of them")
    if args.address and not args.serve:
        raise ConventionError("--address goes with --serve")
    return _follow(args)


def _follow(args: Namespace) -> int:
    import signal
    import time
    from contextlib import ExitStack

    from spark_sim import console, files
    from spark_sim.live.listener import Listener
    from spark_sim.live.session import Session
    from spark_sim.live.sinks import sink

    record = None if args.record is None else Path(args.record)
    if record is not None:
        files.claim(record, force=args.force, endings=(".npz",), what="a recording")
    with ExitStack() as stack:
        listener = stack.enter_context(Listener(args.source))
        session = Session(
            listener,
            args.to,
            args.fps or 60.0,
            console.note,
            sinks=[sink(address) for address in args.send],
            record=record,
            view=_viewer(args),
        )

        asked: list[float] = []

        def stop(*_: object) -> None:
            asked.append(time.monotonic())
            if asked[-1] - asked[0] > _INSIST:  # what is recorded stays in the part
                raise KeyboardInterrupt
            session.stopping = True

        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            if hasattr(signal, name):
                number = getattr(signal, name)
                stack.callback(signal.signal, number, signal.signal(number, stop))
        with session:
            opens = "the window opens once one is heard of; " if args.view else ""
            console.note(f"listens on UDP port {listener.port} for a person; {opens}Ctrl-C ends it")
            session.run()
    console.say(session.summary())
    return 0


def _viewer(args: Namespace) -> "Viewer | None":
    if not (args.view or args.serve):
        return None
    from spark_sim import console
    from spark_sim.commands.studio import address
    from spark_sim.live.viewer import Viewer

    if args.view:
        return Viewer()
    host, port = address(args.address or "localhost:8765")
    made = Viewer((host, port))
    console.say(f"http://{host}:{port}  (once a person is heard of)")
    return made


def _play(args: Namespace) -> int:
    from contextlib import suppress

    from spark.errors import ConventionError
    from spark_sim import console
    from spark_sim.live.sender import play
    from spark_sim.loading import load

    if args.to or args.record or args.view or args.serve or args.address or len(args.send) != 1:
        raise ConventionError(
            f"{args.source} is played to a listener: give --send vmc://HOST:PORT or "
            "xsens://HOST:PORT, and no more (what moves a robot is --from vmc:// or xsens://)"
        )
    clip = load(args.source)
    console.notes(args.source, clip.notes)
    with suppress(KeyboardInterrupt):
        play(clip, args.send[0], args.fps, console.note)
    return 0
