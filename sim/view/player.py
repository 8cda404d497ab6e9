"""A replay of a scene: its time, what is shown of it, and where one looks. Views draw it."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sim.view.annotations import Annotations
from sim.view.scene import Placement, Scene
from sim.view.timeline import Event, Timeline


class Player:
    """What the controls change. Without annotations, what they tell is not shown; they may come
    later (`annotate`)."""

    live = False
    """Whether it shows what happens now, so that there is no time to go to."""

    def __init__(self, scene: Scene, *, ghosts: bool = True) -> None:
        self.scene = scene
        self.timeline = Timeline(len(scene.qpos), scene.frame_time)
        self.shown: dict[str, bool] = {
            "overlaid": False,
            "ghosts": ghosts,
            "contacts": True,
            "mass": False,
            "path": False,
            "limits": False,
            "names": True,
            "help": False,
        }
        self.followed: int | None = -1
        """The place of the figure that the camera follows; -1 for all of them, None for none."""
        self.closing = False
        self.view_is_new = True
        self.message = ""
        self.status = ""
        """What is said below the picture instead of the time, where nothing is replayed."""
        self.annotations: tuple[Annotations | None, ...] = (None,) * len(self.figures)
        self.judged = len(self.figures) - 1
        """The place of the figure whose findings are shown."""

    @property
    def figures(self) -> list[Placement]:
        """Those that are no ghosts."""
        return [p for p in self.scene.placements if not p.ghost]

    def annotate(self, annotations: Sequence[Annotations | None]) -> None:
        """Say what is known of each figure, from left to right; ghosts are not counted."""
        self.annotations = tuple(annotations)

    @property
    def known(self) -> Annotations | None:
        """What is known of the figure whose findings are shown."""
        return self.annotations[self.judged]

    @property
    def events(self) -> tuple[Event, ...]:
        """The findings that N and P go through."""
        return () if self.known is None else self.known.events

    def toggle(self, name: str) -> None:
        """Show something, or hide it."""
        self.shown[name] = on = not self.shown[name]
        words = {"overlaid": ("side by side", "overlaid")}.get(name)
        if name == "ghosts" and not any(p.ghost for p in self.scene.placements):
            self.message = "there is no ghost: play a source and a target"
        elif name != "help":
            self.message = words[on] if words else f"{name} {'shown' if on else 'hidden'}"

    def toggle_loop(self) -> None:
        """Start again at the end, or stop there."""
        self.timeline.loop = not self.timeline.loop
        self.message = "loops" if self.timeline.loop else "stops at the end"

    def next(self) -> None:
        """Go to the next finding."""
        self._go_to(self.timeline.next(self.events))

    def previous(self) -> None:
        """Go to the previous finding."""
        self._go_to(self.timeline.previous(self.events))

    def _go_to(self, event: Event | None) -> None:
        if event is not None:
            self.timeline.go_to(event)
        else:
            self.message = "no findings" if self.known is not None else "no report yet"

    def judge_next(self) -> None:
        """Show the findings of the next figure."""
        self.judged = (self.judged + 1) % len(self.figures)
        self.message = f"findings of {self.figures[self.judged].label}"

    def follow_next(self) -> None:
        """Follow all figures, then each, then none."""
        count = len(self.figures)
        order = [-1, *(range(count) if count > 1 else ()), None]
        self.followed = order[(order.index(self.followed) + 1) % len(order)]
        if self.followed is None:
            self.message = "the camera stands still"
        else:
            name = "all" if self.followed == -1 else self.figures[self.followed].label
            self.message = f"follows {name}"

    def reset_view(self) -> None:
        """Look from where it began."""
        self.followed, self.view_is_new = -1, True

    def close(self) -> None:
        """Ask the view to end."""
        self.closing = True

    def shift(self, placement: Placement) -> Float[np.ndarray, "3"]:
        """How far [m] a figure is from its place of the scene, where it stands beside others."""
        return np.array([0.0, -placement.lane if self.shown["overlaid"] else 0.0, 0.0])

    def qpos(self) -> Float[np.ndarray, "nq"]:
        """The scene's coordinates as they are shown now."""
        qpos = self.scene.qpos[self.timeline.frame].copy()
        for placement in self.scene.placements:
            qpos[placement.columns][:3] += self.shift(placement)
        return qpos

    def target(self) -> Float[np.ndarray, "3"] | None:
        """What the camera looks at [m]; None where it stands still."""
        if self.followed is None:
            return None
        if self.followed == -1:
            middle = self.scene.centers[self.timeline.frame].copy()
            if self.shown["overlaid"]:
                middle[1] = self.place(self.figures[0])[1]
            return middle
        at = self.place(self.figures[self.followed])
        at[2] = 0.48 * self.figures[self.followed].height
        return at

    def place(self, placement: Placement) -> Float[np.ndarray, "3"]:
        """Where a figure's root is now."""
        return self.scene.path(placement)[self.timeline.frame] + self.shift(placement)
