"""Errors that a user can act on: every one names the value, its place, and what to do."""


class SparkSimError(Exception):
    """Base of all errors raised on purpose; the CLI prints them without a traceback."""


class FileFormatError(SparkSimError):
    """A file breaks its format. Reads `path:line: what is wrong; expected ...`."""

    def __init__(self, path: object, line: int | None, message: str) -> None:
        self.path, self.line = path, line
        super().__init__(f"{path}{'' if line is None else f':{line}'}: {message}")


class ConventionError(SparkSimError):
    """Unit, up axis, or another convention can't be inferred, or a given one is not known."""


class SkeletonError(SparkSimError):
    """A skeleton lacks what the task needs (no legs, a cycle, mismatching joint counts)."""


class FrameError(SparkSimError):
    """A frame of a stream is broken; what came before it stays valid."""


class OutputError(SparkSimError):
    """A result can't be written where it was asked for."""


class DivergedError(SparkSimError):
    """A training came to numbers that are none; what it saved before is good."""


class DependencyError(SparkSimError):
    """An optional package or system library is missing; the message says how to install it."""


def unforeseen(error: Exception) -> str:
    """What is told of an error that was not raised on purpose."""
    if lacks_memory(error):
        return "needs more memory, or more threads, than there are"
    return f"{type(error).__name__}: {error}; this is a fault of spark-sim, please report it"


def lacks_memory(error: Exception) -> bool:
    """Whether Python, MuJoCo or torch say that there is no memory left, or no thread."""
    told = ("allocate memory", "can't start new thread")
    return isinstance(error, MemoryError) or any(words in str(error) for words in told)


def name_list(names: list[str]) -> str:
    """Names for a message: the first five in quotes, and how many more there are."""
    shown = ", ".join(map(repr, names[:5]))
    return shown + (f" and {len(names) - 5} more" if len(names) > 5 else "")
