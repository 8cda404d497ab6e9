"""A policy's observation, step by step: terms, scales, order and history as the spec has them."""

from collections import deque

import numpy as np
from jaxtyping import Float

from sim.physics.policy_spec import Block, PolicySpec, TermUse
from sim.physics.policy_terms import TERMS, Seen, State


class Observer:
    """Builds each step's observation, and remembers those before it.

    `reference` is the motion at the policy's rate; `step` counts in it.
    """

    def __init__(self, spec: PolicySpec, reference: list[State]) -> None:
        self._spec, self._reference = spec, reference
        self._joints = {name: k for k, name in enumerate(spec.joints)}
        self._bodies = {name: k for k, name in enumerate(spec.bodies)}
        self.forget()

    def forget(self) -> None:
        """Begin anew: the history is empty."""
        self._past: list[deque[list[Float[np.ndarray, W]]]] = [
            deque(maxlen=max(block.history, 1)) for block in self._spec.blocks
        ]

    def __call__(
        self, own: State, last: Float[np.ndarray, "A"], step: int
    ) -> Float[np.ndarray, "N"]:
        """What the policy sees in a step of the reference, after its `last` raw action."""
        parts = []
        for block, past in zip(self._spec.blocks, self._past, strict=True):
            now = [self._read(use, own, last, step) for use in block.terms]
            parts.append(_arranged(block, past, now))
            past.append(now)
        return np.concatenate(parts)

    def _read(
        self, use: TermUse, own: State, last: Float[np.ndarray, "A"], step: int
    ) -> Float[np.ndarray, "W"]:
        term, end = TERMS[use.term], len(self._reference) - 1
        anchor = None if use.anchor is None else self._bodies[use.anchor]
        bodies = tuple(self._bodies[name] for name in use.bodies)
        phase, parts = step / max(end, 1), []
        for ahead in use.ahead:
            reference = self._reference[min(max(step + ahead, 0), end)]
            seen = Seen(own, reference, self._spec.default, last, phase, anchor, bodies, use.at)
            values = np.array(term.read(seen), dtype=float)
            if use.zero:
                values[[self._joints[name] for name in use.zero]] = 0.0
            if use.axes is not None:
                values = values[list(use.axes)]
            parts.append(np.clip(values * use.scale, -use.clip, use.clip))
        return np.concatenate(parts)


def _arranged(
    block: Block,
    past: deque[list[Float[np.ndarray, "_"]]],
    now: list[Float[np.ndarray, "_"]],
) -> Float[np.ndarray, "M"]:
    if not block.history:
        return np.concatenate(now)
    before = now if block.repeat else [np.zeros_like(part) for part in now]
    if block.repeat and past:
        before = past[0]
    steps = [*[before] * (block.history - len(past)), *past, *([now] if block.present else [])]
    if block.newest_first:
        steps.reverse()
    ordered = zip(*steps, strict=True) if block.by_term else steps
    return np.concatenate([part for row in ordered for part in row])
