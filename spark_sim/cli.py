"""The command line: one parser, one way to fail."""

import os
import re
import sys
from argparse import Action, ArgumentError, ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from itertools import takewhile
from typing import Any, NoReturn

from spark.errors import DivergedError, SparkSimError, lacks_memory, unforeseen
from spark_sim import console
from spark_sim.commands import (
    batch,
    evaluate,
    export,
    inspect,
    live,
    mjcf,
    play,
    prepare,
    report,
    retarget,
    robots,
    sample,
    train,
)

COMMANDS = (
    *(retarget, batch, robots, inspect, report, play, live, mjcf, sample),
    *(prepare, train, evaluate, export),
)

DESCRIPTION = "Put a human motion on another body and measure how believable the result is."

EXAMPLES = """\
examples:
  spark-sim sample                              # demo motions to play with
  spark-sim retarget walk.bvh --to mutant.bvh   # another body, any rig
  spark-sim retarget walk.bvh --to robot        # a humanoid robot
  spark-sim play walk.bvh walk_on_mutant.bvh    # watch both, side by side
  spark-sim report walk_on_mutant.bvh --source walk.bvh

FBX files, videos and most robots need extras:
  pip install 'spark-sim[fbx,video,robots]'

spark-sim COMMAND --help tells more of each command.
"""

DIVERGED = 1
FAILED, INTERNAL_ERROR, INTERRUPTED, BROKEN_PIPE = 2, 70, 130, 141


_MEANT = {"--jobs": "--workers", "-j": "--workers"}
"""Options as other programs call them, which the spelling alone would not find."""


class _Formatter(RawDescriptionHelpFormatter):
    """Help of one look on every Python, whatever the terminal."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=26, width=min(_width(), 100) - 2)

    def _format_action_invocation(self, action: Action) -> str:
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        value = self._format_args(action, self._get_default_metavar_for_optional(action))
        return f"{', '.join(action.option_strings)} {value}"


def _width() -> int:
    """The columns of the terminal, or what the environment says."""
    if re.fullmatch("[0-9]{1,9}", columns := os.environ.get("COLUMNS", "")):
        return int(columns) or 80
    try:
        return os.get_terminal_size(sys.stdout.fileno()).columns or 80
    except (OSError, ValueError):
        return 80


class _Once(Action):
    """Keeps an option's value, and refuses a second one: only the last would count."""

    def __call__(
        self, parser: ArgumentParser, args: Namespace, values: Any, option: str | None = None
    ) -> None:
        given = vars(args).setdefault("_given", set())
        if option is not None and self.dest in given:
            raise ArgumentError(self, "given twice; only one can count")
        given.add(self.dest)
        setattr(args, self.dest, values)


class _Parser(ArgumentParser):
    """Errors in two lines: what is wrong, and where help is."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=_Formatter, allow_abbrev=False, **settings)
        self.register("action", None, _Once)

    def error(self, message: str) -> NoReturn:
        self.exit(FAILED, f"spark-sim: error: {message}\nSee {self.prog} --help\n")


class _Version(Action):
    def __call__(self, parser: ArgumentParser, *_: Any) -> NoReturn:
        from spark_sim.version import own_version

        print(f"spark-sim {own_version()}")
        parser.exit()


def build_parser() -> tuple[ArgumentParser, Mapping[str, ArgumentParser]]:
    """The whole command line, and the parser of each command. Imports nothing heavy, so that help
    comes at once."""
    parser = _Parser(
        prog="spark-sim",
        usage="spark-sim COMMAND ...",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    subparsers = parser.add_subparsers(
        title="commands", metavar="COMMAND", dest="command", prog="spark-sim"
    )
    for command in COMMANDS:
        name = command.__name__.rpartition(".")[2]
        subparser = subparsers.add_parser(
            name,
            help=command.SUMMARY,
            usage=f"spark-sim {name} {command.USAGE}",
            description=command.DESCRIPTION,
            epilog=command.EXAMPLES,
        )
        command.configure(subparser)
        subparser.set_defaults(run=command.run)
    return parser, subparsers.choices


def parse(argv: Sequence[str]) -> Namespace:
    """The arguments of one command line. Names of commands and options that are not known are
    refused first, with the nearest that are; argparse would first ask for what is missing."""
    parser, commands = build_parser()
    name, *rest = argv or ("",)
    if name and not name.startswith("-") and name not in commands:
        parser.error(f"no command is called {name!r}{_nearest(name, commands)}")
    command, tokens = (commands[name], rest) if name in commands else (parser, argv)
    known = command._option_string_actions
    for token in takewhile("--".__ne__, tokens):
        option = token.partition("=")[0]
        short = len(option) > 1 and option[:2] in known and not option.startswith("--")
        if re.match(r"-[^\d.]", option) and option not in known and not short:
            command.error(f"no option is called {option}{_nearest(option, known)}")
    args, left = parser.parse_known_args(argv)
    if left:
        command.error(
            f"don't know what {' '.join(left)} is for; files stand side by side, and an option "
            "takes one value"
        )
    if args.command is not None:
        _refuse_empty(command, args)
    return args


def _refuse_empty(command: ArgumentParser, args: Namespace) -> None:
    """Refuse an empty text, which would stand for the current folder."""
    for argument in command._actions:
        value = getattr(args, argument.dest, None)
        if "" not in (value if isinstance(value, list) else [value]):
            continue
        name = (*argument.option_strings[-1:], argument.metavar)[0]
        or_not = "" if argument.required else ", or leave it out"
        command.error(
            f"{name} is an empty text: write a value there{or_not}; if a variable of the shell "
            "stands there, it is not set"
        )


def _nearest(name: str, known: Iterable[str]) -> str:
    meant = [option for option in known if option == _MEANT.get(name)]
    near = meant or get_close_matches(name, known, n=1)
    return f"; did you mean {near[0]}?" if near else ""


def run(argv: Sequence[str], ready: Callable[[], None] = lambda: None) -> int:
    """Parse and carry out one command line; every failure ends as one line on stderr. `ready` is
    called in between.

    Exit codes: 0 done; 1 `report --fail-over` found too much, or `train` diverged; 2 wrong input or
    usage; 70 a fault of spark-sim itself; 130 interrupted; 141 the reader of stdout went away.
    """
    args = parse(argv)
    if args.command is None:
        build_parser()[0].print_help(sys.stderr)
        return FAILED
    try:
        ready()
        code = _run(args)
        sys.stdout.flush()
    except BrokenPipeError:
        # What is still buffered has no reader: keep the interpreter from complaining at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except KeyboardInterrupt:
        return INTERRUPTED
    return code


def _run(args: Namespace) -> int:
    try:
        code: int = _carry_out(args)
    except BrokenPipeError:
        raise
    except DivergedError as error:
        return _fail(str(error), DIVERGED)
    except SparkSimError as error:
        return _fail(str(error), FAILED)
    except OSError as error:
        place = "" if error.filename is None else f"{error.filename}: "
        return _fail(f"{place or _lost_folder()}{error.strerror or error}", FAILED)
    except Exception as error:
        if lacks_memory(error):
            return _fail(f"this {unforeseen(error)}", FAILED)
        if "environment variable" in str(error):  # as MuJoCo says of a MUJOCO_GL that is none
            return _fail(str(error), FAILED)
        if os.environ.get("SPARK_SIM_TRACEBACK"):
            raise
        return _fail(
            f"{type(error).__name__}: {error}\nThis is a fault of spark-sim. Please report it with "
            "what it prints when SPARK_SIM_TRACEBACK=1 is set.",
            INTERNAL_ERROR,
        )
    return code


def _lost_folder() -> str:
    """What to say before an error without a place: whether the current folder was deleted."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return "the current folder, which was deleted: "
    return ""


def _carry_out(args: Namespace) -> int:
    """What the command returns. A library's `import` makes an ImportError of Ctrl-C."""
    try:
        code: int = args.run(args)
    except Exception as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, KeyboardInterrupt):
            cause = cause.__cause__ or cause.__context__
        if cause is not None:
            raise cause from None
        raise
    return code


def _fail(message: str, code: int) -> int:
    console.error(message)
    return code
