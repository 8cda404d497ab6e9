"""The report's colours: of its page and plots, light and dark, and of its text in a terminal."""

from typing import Literal

Grade = Literal["good", "fair", "bad"]

_LIGHT = {
    "bg": "#f6f7f9",
    "ink": "#1f2430",
    "soft": "#5b6472",
    "card": "#fff",
    "line": "#dde1e6",
    "good": "#15753a",
    "fair": "#945700",
    "bad": "#c9222d",
    "clip": "#2563c9",
    "source": "#667080",
    "flagged": "#d6303a",
    "limit": "#d6303a",
}
_DARK = {
    "bg": "#16181d",
    "ink": "#e8eaee",
    "soft": "#98a2b0",
    "card": "#1f2229",
    "line": "#343a44",
    "good": "#4cc38a",
    "fair": "#f0a33a",
    "bad": "#ff6b70",
    "clip": "#74a8ff",
    "source": "#98a2b0",
    "flagged": "#ff6b70",
    "limit": "#ff6b70",
}

# The dots of the soles' corners in the replay, which is light and dark too.
CORNER_COLORS = {"stands": "#1f9d55", "slides": "#f08c00", "sinks": "#e03131"}

# Of the tiles of a notebook, which is light or dark without our knowing: readable on both.
TILE_COLORS: dict[Grade, str] = {"good": "#2e9e5f", "fair": "#c07a10", "bad": "#e5484d"}

# ANSI codes of a terminal (ECMA-48, "select graphic rendition").
TERMINAL: dict[Grade, int] = {"good": 32, "fair": 33, "bad": 31}
BOLD, DIM = 1, 2


def css() -> str:
    """The page's colours as custom properties: `var(--clip)` is that of the motion's own lines."""
    light, dark = (
        " ".join(f"--{name}: {color};" for name, color in colors.items())
        for colors in (_LIGHT, _DARK)
    )
    return (
        f":root {{ color-scheme: light dark; {light} }}\n"
        f"  @media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}"
    )


GRADES = (1.0, 5.0)
"""[%] Up to which a share of frames looks good, and fair."""


def grade(percent: float) -> Grade:
    """How bad a share of frames looks: a hint for the eye. What makes a frame implausible stands in
    `sim.report.thresholds`."""
    good, fair = GRADES
    return "good" if percent <= good else "fair" if percent <= fair else "bad"
