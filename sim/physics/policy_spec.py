"""What a policy sees and how its actions move a robot: the spec that comes with it, as TOML.

docs/policies.md has the keys, and a whole spec as an example.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sim.physics.policy_terms import TERMS
from spark.errors import FileFormatError, name_list
from spark.opening import parse_toml, read_text

_EXPECTED = "a policy's spec (docs/policies.md)"
_MOST_HISTORY = 1000  # steps


@dataclass(frozen=True)
class TermUse:
    """A term in an observation: `axes` of it [indices], times `scale`, within +-`clip`, with the
    entries of the joints `zero` at 0; of the reference `ahead` control steps from now."""

    term: str
    axes: tuple[int, ...] | None
    scale: tuple[float, ...]
    clip: float
    zero: tuple[str, ...]
    ahead: tuple[int, ...]


@dataclass(frozen=True)
class Block:
    """Terms one after the other; with `history`, of so many steps before the present one, and with
    `present` of this, too.

    By step the terms of one step stand together, by term the steps of one term. Before the first
    step stand zeros, or, with `repeat`, the first step itself.
    """

    terms: tuple[TermUse, ...]
    history: int
    present: bool
    newest_first: bool
    by_term: bool
    repeat: bool


@dataclass(frozen=True, eq=False)
class PolicySpec:
    """What a policy's file doesn't say.

    It acts `rate` times a second, in a simulation with steps of `timestep` [s]. Action k is joint
    `joints[k]`'s: a target of `default` [rad] + `scale` * action, cut off at +-`action_clip`. The
    joint's torque is `kp` (target - angle) - `kd` speed, at most `torque_limit` [N m] (nan: not
    told) and what the model says. Velocities of the reference are means over `smoothing` [s].
    """

    path: Path
    rate: float
    timestep: float
    joints: tuple[str, ...]
    default: Float[np.ndarray, "A"]
    kp: Float[np.ndarray, "A"]
    kd: Float[np.ndarray, "A"]
    torque_limit: Float[np.ndarray, "A"]
    scale: Float[np.ndarray, "A"]
    action_clip: float
    smoothing: float
    blocks: tuple[Block, ...]

    def __repr__(self) -> str:
        return f"PolicySpec({self.path.name!r}, {len(self.joints)} joints, {self.rate:g} Hz)"

    @property
    def steps(self) -> int:
        """Simulation steps for each action."""
        return round(1 / (self.rate * self.timestep))

    @property
    def width(self) -> int:
        """How many numbers the policy sees."""
        return sum(
            sum(self.width_of(use) for use in block.terms)
            * (block.history + block.present if block.history else 1)
            for block in self.blocks
        )

    def width_of(self, use: TermUse) -> int:
        """How many numbers one use of a term is."""
        width = TERMS[use.term].width or len(self.joints)
        return (width if use.axes is None else len(use.axes)) * len(use.ahead)


def read_spec(path: Path) -> PolicySpec:
    """Read a spec. Raises `FileFormatError` with the key for what it lacks, doesn't know, or has in
    another number than that of the joints."""
    top = _Table(path, "", parse_toml(path, read_text(path, expected=_EXPECTED), _EXPECTED))
    joints, action = top.table("joints"), top.table("action")
    reference, groups = top.table("reference", {}), top.table("groups")
    names = joints.names("names")
    if not names:
        raise joints.error("names", "is empty; expected the joints in the order of the actions")
    count = len(names)
    ahead = reference.number("ahead", 1.0)
    uses = {
        name: tuple(
            _term(_Table(path, f"groups.{name}[{k}].", item), count, names, ahead)
            for k, item in enumerate(groups.items(name))
        )
        for name in groups.content
    }
    spec = PolicySpec(
        path=path,
        rate=top.number("rate_hz", least=1.0),
        timestep=top.number("timestep", 0.002, least=1e-5),
        joints=names,
        default=joints.numbers("default", count),
        kp=joints.numbers("kp", count, least=0.0),
        kd=joints.numbers("kd", count, least=0.0),
        torque_limit=joints.numbers("torque_limit", count, float("nan"), least=0.0),
        scale=action.numbers("scale", count, 1.0),
        action_clip=action.number("clip", float("inf"), least=0.0),
        smoothing=reference.number("smooth_s", 0.0, least=0.0),
        blocks=tuple(
            _block(_Table(path, f"observation[{k}].", item), uses)
            for k, item in enumerate(top.items("observation"))
        ),
    )
    for table in (top, joints, action, reference):
        table.finish()
    ratio = 1 / (spec.rate * spec.timestep)
    if abs(ratio - round(ratio)) > 1e-3 or ratio < 0.5:
        raise top.error(
            "timestep", f"is {spec.timestep:g} s; expected 1 / rate_hz to be a multiple of it"
        )
    return spec


def _term(table: "_Table", count: int, joints: tuple[str, ...], ahead: float) -> TermUse:
    name = table.word("term")
    if name not in TERMS:
        raise table.error("term", f"is {name!r}; available: {', '.join(sorted(TERMS))}")
    term = TERMS[name]
    axes = table.word("axes", "")
    if unknown := set(axes) - set(term.axes):
        has = f"has the axes {term.axes!r}" if term.axes else "has no axes"
        raise table.error("axes", f"names {sorted(unknown)}; {name} {has}")
    width = len(axes) or term.width or count
    zero = table.names("zero", ())
    if unknown := set(zero) - set(joints):
        raise table.error("zero", f"names {name_list(sorted(unknown))}, no joints of the spec")
    if zero and term.width:
        raise table.error("zero", f"names joints; {name} is no term of joints")
    steps = table.numbers("ahead", None, ahead)
    if not (steps == np.round(steps)).all() or np.abs(steps).max() > _MOST_HISTORY:
        raise table.error("ahead", "is no whole number of control steps")
    if not term.reference and "ahead" in table.content:
        raise table.error("ahead", f"is for terms of the reference; {name} is the robot's own")
    use = TermUse(
        term=name,
        axes=tuple(term.axes.index(axis) for axis in axes) if axes else None,
        scale=tuple(table.numbers("scale", width, 1.0).tolist()),
        clip=table.number("clip", float("inf"), least=0.0),
        zero=zero,
        ahead=tuple(int(step) for step in steps) if term.reference else (0,),
    )
    table.finish()
    return use


def _block(table: "_Table", groups: dict[str, tuple[TermUse, ...]]) -> Block:
    names = table.names("groups")
    if unknown := [name for name in names if name not in groups]:
        raise table.error(
            "groups", f"names {name_list(unknown)}; [groups] has {name_list([*groups])}"
        )
    history = table.number("history", 0.0, least=0.0)
    if history != round(history) or history > _MOST_HISTORY:
        raise table.error(
            "history", f"is {history:g}; expected whole steps, {_MOST_HISTORY} at most"
        )
    block = Block(
        terms=tuple(use for name in names for use in groups[name]),
        history=int(history),
        present=table.choice("present", (False, True)),
        newest_first=table.choice("order", ("oldest_first", "newest_first")) == "newest_first",
        by_term=table.choice("layout", ("by_step", "by_term")) == "by_term",
        repeat=table.choice("start", ("zeros", "repeat")) == "repeat",
    )
    table.finish()
    return block


class _Table:
    """A TOML table that says where it is, and what in it nobody asked for."""

    def __init__(self, path: Path, place: str, content: Any) -> None:
        self.path, self.place, self.content = path, place, content
        self.asked: set[str] = set()
        if not isinstance(content, dict):
            raise FileFormatError(path, None, f"{place.rstrip('.')} is no table; {_EXPECTED}")

    def error(self, key: str, message: str) -> FileFormatError:
        return FileFormatError(self.path, None, f"{self.place}{key} {message}")

    def finish(self) -> None:
        """Raise where a key was given that isn't known: it would be thought to do something."""
        if unknown := sorted(set(self.content) - self.asked):
            known = ", ".join(sorted(self.asked))
            raise self.error(unknown[0], f"is not known here; available: {known}")

    def get(self, key: str, default: Any = None) -> Any:
        self.asked.add(key)
        value = self.content.get(key, default)
        if value is None:
            raise self.error(key, f"is missing; expected {_EXPECTED}")
        return value

    def table(self, key: str, default: Any = None) -> "_Table":
        return _Table(self.path, f"{self.place}{key}.", self.get(key, default))

    def items(self, key: str) -> list[Any]:
        value = self.get(key)
        if not isinstance(value, list) or not value:
            raise self.error(key, "is no list of tables, or an empty one")
        return value

    def word(self, key: str, default: str | None = None) -> str:
        value = self.get(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"is {value!r}; expected a word")
        return value

    def names(self, key: str, default: tuple[str, ...] | None = None) -> tuple[str, ...]:
        value = self.get(key, default)
        if not isinstance(value, list | tuple) or not all(isinstance(v, str) for v in value):
            raise self.error(key, "is no list of names")
        if len({*value}) < len(value):
            raise self.error(key, "has a name twice")
        return tuple(value)

    def choice(self, key: str, choices: tuple[Any, Any]) -> Any:
        """One of two, the first where it isn't given."""
        value = self.get(key, choices[0])
        if not any(value is each or (value == each and value not in (0, 1)) for each in choices):
            raise self.error(key, f"is {value!r}; expected {choices[0]!r} or {choices[1]!r}")
        return value

    def number(
        self, key: str, default: float | None = None, *, least: float | None = None
    ) -> float:
        return float(self.numbers(key, 1, default, least=least)[0])

    def numbers(
        self,
        key: str,
        count: int | None,
        default: float | None = None,
        *,
        least: float | None = None,
    ) -> Float[np.ndarray, "N"]:
        """`count` numbers (any number of them for None); a single one stands for all."""
        value = self.get(key, default)
        values = value if isinstance(value, list) else [value]
        if not values or not all(isinstance(v, int | float) and v is not True for v in values):
            raise self.error(key, f"is {value!r}; expected numbers")
        given = np.array(values, dtype=float)
        if key in self.content and not np.isfinite(given).all():
            raise self.error(key, "has a number that is not finite")
        if least is not None and (given < least).any():
            raise self.error(key, f"has {given.min():g}; expected {least:g} or more")
        if count is None or len(given) == count:
            return given
        if isinstance(value, list):
            raise self.error(key, f"has {len(given)} numbers; expected {count}, or a single one")
        return np.full(count, given[0])
