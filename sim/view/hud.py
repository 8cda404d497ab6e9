"""What a window writes over its picture: the bar with time and flags, findings, the help."""

import mujoco

from sim.view.bar import Bar, Rect
from sim.view.controls import help_rows
from sim.view.marks import RGBA, rgba
from sim.view.player import Player
from sim.view.text import plain
from spark.summary import counted

_BACK: RGBA = (0.12, 0.13, 0.16, 1.0)
_TRACK: RGBA = (0.24, 0.26, 0.31, 1.0)
_DONE = rgba("#74a8ff")
_FLAG = rgba("#ff6b70")
_INK: RGBA = (0.93, 0.94, 0.96, 1.0)
_SOFT: RGBA = (0.65, 0.68, 0.74, 1.0)
_FINDINGS = 3  # sentences at once
_HELP_LINE = 1.32  # letters' heights: of an overlay's line


class Hud:
    """Draws into the current context; keeps the bar of the last picture, for clicks."""

    def __init__(self, context: mujoco.MjrContext) -> None:
        self._context = context
        self._line = int(1.25 * context.charHeight)
        self.bar: Bar | None = None

    def room(self, player: Player, width: int, height: int) -> mujoco.MjrRect:
        """What the bar leaves of a picture."""
        self.bar = Bar(player.timeline, player.known, width, self._line)
        return mujoco.MjrRect(0, self.bar.height, width, max(height - self.bar.height, 1))

    def draw(
        self, player: Player, viewport: mujoco.MjrRect, *, message: str, waiting: bool
    ) -> None:
        """Draw over the picture; `waiting` says that the report is still being worked out."""
        above = self.room(player, viewport.width, viewport.height)
        assert self.bar is not None
        self._bar(player, self.bar, viewport, waiting)
        lines = [e.sentence for e in player.timeline.current(player.events)][: _FINDINGS + 1]
        if len(lines) > _FINDINGS:
            lines[_FINDINGS:] = ["..."]
        if lines:
            self._overlay(mujoco.mjtGridPos.mjGRID_BOTTOMLEFT, above, "\n".join(lines))
        if message:
            self._overlay(mujoco.mjtGridPos.mjGRID_TOPRIGHT, above, message)
        if player.shown["help"]:
            rows = help_rows(live=player.live)
            line = _HELP_LINE * self._context.charHeight
            most = max(int(above.height / line) - len(lines), 1)
            # What is too long for the picture goes on at its right.
            for where, part in (
                (mujoco.mjtGridPos.mjGRID_TOPLEFT, rows[:most]),
                (mujoco.mjtGridPos.mjGRID_TOPRIGHT, rows[most:]),
            ):
                if part:
                    keys, words = zip(*part, strict=True)
                    self._overlay(where, above, "\n".join(keys), "\n".join(words))

    def _bar(self, player: Player, bar: Bar, viewport: mujoco.MjrRect, waiting: bool) -> None:
        timeline, line = player.timeline, self._line
        self._rect(bar.area, _BACK)
        for name in bar.rows:
            row = bar.row(name)
            self._rect(row, _TRACK)
            for shade in bar.shades(name):
                self._rect(shade, _FLAG)
            self._text(name, float(line), row.bottom, viewport, _SOFT)
        now = bar.x_of(timeline.time)
        strip = bar.strip
        top = bar.height - 0.4 * line
        if not player.live:
            self._rect(bar.strip, _TRACK)
            self._rect(Rect(strip.left, strip.bottom, now - strip.left, strip.height), _DONE)
            self._rect(Rect(now - 1, strip.bottom - 3, 2.0, top - strip.bottom), _INK)
        state = "" if timeline.playing else "   paused"
        speed = "" if timeline.speed == 1 else f"   speed {timeline.speed:g}"
        once = "" if timeline.loop else "   once"
        time = min(timeline.time, timeline.duration)  # it goes on until the last frame is over
        words = player.status or (
            f"{time:.2f} / {timeline.duration:.2f} s   frame {timeline.frame} of "
            f"{timeline.frames}{speed}{once}{state}"
        )
        self._text(words, float(line), 0.45 * line, viewport, _INK)
        right = "working out the report ..." if waiting else self._verdict(player)
        self._text(f"{right}   H: help", -float(line), 0.45 * line, viewport, _SOFT)

    def _verdict(self, player: Player) -> str:
        known = player.known
        if known is None:
            return ""
        found = counted(len(known.events), "finding") if known.events else "no findings"
        return f"{player.figures[player.judged].label}: {found}"

    def _overlay(
        self, where: mujoco.mjtGridPos, viewport: mujoco.MjrRect, text: str, other: str = ""
    ) -> None:
        font = int(mujoco.mjtFont.mjFONT_NORMAL)
        mujoco.mjr_overlay(font, int(where), viewport, plain(text), plain(other), self._context)

    def _rect(self, rect: Rect, color: RGBA) -> None:
        place = mujoco.MjrRect(
            round(rect.left), round(rect.bottom), max(round(rect.width), 0), round(rect.height)
        )
        mujoco.mjr_rectangle(place, *color)

    def _text(self, text: str, x: float, y: float, viewport: mujoco.MjrRect, color: RGBA) -> None:
        """A line from `x`, or, where it is negative, up to so far from the right end.

        Its place is a share of what was drawn into last, so that is made the whole picture.
        """
        text = plain(text)
        self._rect(
            Rect(0.0, 0.0, float(viewport.width), float(viewport.height)), (0.0, 0.0, 0.0, 0.0)
        )
        if x < 0:
            x += viewport.width - self._width(text)
        mujoco.mjr_text(
            int(mujoco.mjtFont.mjFONT_NORMAL),
            text,
            self._context,
            x / viewport.width,
            y / viewport.height,
            *color[:3],
        )

    def _width(self, text: str) -> int:
        return sum(int(self._context.charWidth[ord(c)]) for c in text)
