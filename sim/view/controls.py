"""What the keys of a replay do. The help shows this table, so it is true."""

from collections.abc import Callable
from dataclasses import dataclass

from sim.view.player import Player


@dataclass(frozen=True)
class Control:
    """Keys, as the help calls them, what they do in words, and what each of them does. Those that
    are not `live` need a recording."""

    label: str
    words: str
    keys: dict[str, Callable[[Player], object]]
    live: bool = False


def _toggle(name: str) -> Callable[[Player], object]:
    return lambda player: player.toggle(name)


def _seek_digit(digit: int) -> Callable[[Player], object]:
    return lambda player: player.timeline.seek_share(digit / 10)


TOGGLES = {
    "overlaid": ("O", "overlaid, or side by side"),
    "ghosts": ("G", "ghost of the source or target"),
    "contacts": ("C", "contacts: stands, slides, sinks"),
    "mass": ("M", "centre of mass and its support"),
    "path": ("R", "path of the root"),
    "limits": ("J", "joints at a limit"),
    "names": ("T", "names and where they face"),
}
"""What can be shown or hidden: by which key, and in words."""
LIVE_TOGGLES = ("overlaid", "names")

CONTROLS = (
    Control("Space", "play, pause", {"space": lambda p: p.timeline.toggle()}),
    Control(
        "Left Right",
        "back, on by a second",
        {
            "left": lambda p: p.timeline.seek(p.timeline.time - 1),
            "right": lambda p: p.timeline.seek(p.timeline.time + 1),
        },
    ),
    Control(
        ", .",
        "one frame back, on",
        {",": lambda p: p.timeline.step(-1), ".": lambda p: p.timeline.step(1)},
    ),
    Control(
        "Home End",
        "to the start, the end",
        {"home": lambda p: p.timeline.seek_share(0.0), "end": lambda p: p.timeline.seek_share(1.0)},
    ),
    Control("0 - 9", "to 0, 10 ... 90 %", {str(k): _seek_digit(k) for k in range(10)}),
    Control(
        "Down Up",
        "slower, faster",
        {
            "down": lambda p: p.timeline.change_speed(-1),
            "up": lambda p: p.timeline.change_speed(1),
        },
    ),
    Control("L", "loop, or stop at the end", {"l": lambda p: p.toggle_loop()}),
    Control(
        "N P", "next, previous finding", {"n": lambda p: p.next(), "p": lambda p: p.previous()}
    ),
    Control("Tab", "findings of the next figure", {"tab": lambda p: p.judge_next()}),
    Control("F", "follow all, one figure, none", {"f": lambda p: p.follow_next()}, live=True),
    *(
        Control(key, words, {key.lower(): _toggle(name)}, live=name in LIVE_TOGGLES)
        for name, (key, words) in TOGGLES.items()
    ),
    Control("V", "the view from the start", {"v": lambda p: p.reset_view()}, live=True),
    Control("H F1", "this help", {"h": _toggle("help"), "f1": _toggle("help")}, live=True),
    Control("Q Esc", "close", {"q": lambda p: p.close(), "escape": lambda p: p.close()}, live=True),
    Control("Drag", "turn; right button: move", {}, live=True),
    Control("Wheel", "nearer, further", {}, live=True),
    Control("Click below", "to that time, or finding", {}),
)

_BY_KEY = {key: control for control in CONTROLS for key in control.keys}


def press(player: Player, key: str) -> bool:
    """Do what a key does; whether it does anything."""
    control = _BY_KEY.get(key.lower())
    if control is None or (player.live and not control.live):
        return False
    control.keys[key.lower()](player)
    return True


def help_rows(*, live: bool = False) -> list[tuple[str, str]]:
    """The help: keys, and what they do."""
    return [(c.label, c.words) for c in CONTROLS if c.live or not live]
