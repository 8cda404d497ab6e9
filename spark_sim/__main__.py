"""The `spark-sim` program: makes sure that the packages are its own, then runs the command line.

Only modules of Python's own are imported here: `sim` and `robots` are common names, and code of
another distribution must not run any further than its own `__init__`.
"""

import os
import signal
import sys

DISTRIBUTION = "spark-sim"
PACKAGES = ("spark", "sim", "robots")


def foreign_package() -> str | None:
    """What is wrong with the packages that Python finds under our names; None where all is well."""
    for name in PACKAGES:
        try:
            package = __import__(name)
        except Exception as error:  # a foreign package may fail in any way
            return f"the package {name!r} can't be imported ({type(error).__name__}: {error})"
        if getattr(package, "DISTRIBUTION", None) != DISTRIBUTION:
            place = package.__file__ or next(iter(package.__path__), "an unknown place")
            return f"the package {name!r} that Python finds isn't spark-sim's: {place}"
    return None


def main() -> int:
    """Run the command line; returns the exit code."""
    # Until the command runs, Ctrl-C ends the process as the system does it, without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _open_streams()
    _keep_folder_out()
    problem = foreign_package()
    if problem is not None:
        print(
            f"spark-sim: error: {problem}\n"
            "Something else of that name is installed or lies in the current folder. Give "
            "spark-sim an environment\nof its own: python3 -m venv ENV && "
            "ENV/bin/pip install spark-sim",
            file=sys.stderr,
        )
        return 2
    from spark_sim.cli import run

    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal without our letters shows their numbers
            stream.reconfigure(errors="backslashreplace")
    return run(sys.argv[1:], ready=_listen)


def _open_streams() -> None:
    """Put nothing where the shell closed stdin, stdout or stderr: a file of ours that took their
    number would get what libraries print."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115


def _keep_folder_out() -> None:
    """Python looks for modules in the current folder first where it is given a line of code, as
    the processes are that `multiprocessing` starts. A `json.py` beside somebody's motions must not
    run there."""
    os.environ["PYTHONSAFEPATH"] = "1"
    own = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if sys.path[0] == own:  # a checkout that is not installed
        known = os.environ.get("PYTHONPATH")
        os.environ["PYTHONPATH"] = os.pathsep.join([own, known] if known else [own])


def _listen() -> None:
    """From now on there may be work to undo, and processes to end."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _stop)


def _stop(number: int, frame: object) -> None:
    """End as after an error: what is half written is removed."""
    sys.exit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
