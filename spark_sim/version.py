"""Which spark-sim this is."""

from importlib.metadata import PackageNotFoundError, version

DISTRIBUTION = "spark-sim"  # as it is installed


def own_version() -> str:
    """The version that is installed; or that a checkout is only on Python's path."""
    try:
        return version(DISTRIBUTION)
    except PackageNotFoundError:
        return "of a checkout that is not installed"
