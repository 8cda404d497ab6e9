"""What checks types and shapes in each call of the quick tests: each argument and result once."""

from collections.abc import Callable
from typing import Any

from beartype import beartype


def once(checks: Callable[..., Any]) -> Callable[..., Any]:
    """beartype, for jaxtyping's `typechecker`.

    jaxtyping asks for two functions of each of ours: one that checks the arguments, whose result is
    `Any`, and one that checks them again with the result. The second checks the result alone here:
    the lengths of axes that the first met are still known to it, and it takes half the time.
    """
    result = checks.__annotations__.get("return", Any)
    if result is not Any:
        checks.__annotations__ = {"return": result}
    return beartype(checks)
