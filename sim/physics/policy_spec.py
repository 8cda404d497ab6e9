"""What a policy sees and how its actions move a robot: the spec that comes with it, as TOML.

docs/policies.md has the keys, and a whole spec as an example.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from sim.physics.policy_ports import Ports, read_ports
from sim.physics.policy_terms import TERMS
from sim.physics.toml_table import Table
from spark.errors import name_list
from spark.opening import parse_toml, read_text

_EXPECTED = "a policy's spec (docs/policies.md)"
_MOST_HISTORY = 1000  # steps


@dataclass(frozen=True)
class TermUse:
    """A term in an observation: `axes` of it [indices], times `scale`, within +-`clip`, with the
    entries of the joints `zero` at 0; of the reference `ahead` control steps from now. Terms of
    `bodies`, and of the way to the reference, are seen from the `anchor`, a body (None: the
    root); velocities are those of the point `at` of the root [m, in its axes]."""

    term: str
    axes: tuple[int, ...] | None
    scale: tuple[float, ...]
    clip: float
    zero: tuple[str, ...]
    ahead: tuple[int, ...]
    anchor: str | None
    bodies: tuple[str, ...]
    at: tuple[float, ...]


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
    `joints[k]`'s: a target of `default` [rad] + `scale` * action, cut off at +-`action_clip`; in
    place of the default, with `residual`, the reference's angle `ahead` control steps from now. The
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
    residual: bool
    ahead: int
    smoothing: float
    ports: Ports
    blocks: tuple[Block, ...]

    def __repr__(self) -> str:
        return f"PolicySpec({self.path.name!r}, {len(self.joints)} joints, {self.rate:g} Hz)"

    @property
    def steps(self) -> int:
        """Simulation steps for each action."""
        return round(1 / (self.rate * self.timestep))

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that terms name, each once."""
        uses = [use for block in self.blocks for use in block.terms]
        named = [name for use in uses for name in (*use.bodies, use.anchor) if name is not None]
        return tuple(dict.fromkeys(named))

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
        if use.bodies:
            width *= len(use.bodies)
        return (width if use.axes is None else len(use.axes)) * len(use.ahead)


def read_spec(path: Path) -> PolicySpec:
    """Read a spec. Raises `FileFormatError` with the key for what it lacks, doesn't know, or has in
    another number than that of the joints."""
    top = Table(
        path, "", parse_toml(path, read_text(path, expected=_EXPECTED), _EXPECTED), _EXPECTED
    )
    joints, action = top.table("joints"), top.table("action")
    reference, groups = top.table("reference", {}), top.table("groups")
    network = top.table("network", {})
    names = joints.names("names")
    if not names:
        raise joints.error("names", "is empty; expected the joints in the order of the actions")
    count = len(names)
    (ahead,) = _steps(reference, 1, 1)
    uses = {
        name: tuple(_term(each, count, names, ahead) for each in groups.tables(name))
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
        residual=action.choice("around", ("default", "reference")) == "reference",
        ahead=ahead,
        smoothing=reference.number("smooth_s", 0.0, least=0.0),
        ports=read_ports(network),
        blocks=tuple(_block(each, uses) for each in top.tables("observation")),
    )
    for table in (top, joints, action, reference, network):
        table.finish()
    ratio = 1 / (spec.rate * spec.timestep)
    if abs(ratio - round(ratio)) > 1e-3 or ratio < 0.5:
        raise top.error(
            "timestep", f"is {spec.timestep:g} s; expected 1 / rate_hz to be a multiple of it"
        )
    return spec


def _steps(table: Table, default: int, count: int | None = None) -> tuple[int, ...]:
    """Control steps ahead, `count` of them."""
    steps = table.numbers("ahead", count, float(default))
    if not (steps == np.round(steps)).all() or np.abs(steps).max() > _MOST_HISTORY:
        raise table.error("ahead", "is no whole number of control steps")
    return tuple(int(step) for step in steps)


def _term(table: Table, count: int, joints: tuple[str, ...], ahead: int) -> TermUse:
    name = table.word("term")
    if name not in TERMS:
        raise table.error("term", f"is {name!r}; available: {', '.join(sorted(TERMS))}")
    term = TERMS[name]
    axes = table.word("axes", "")
    if unknown := set(axes) - set(term.axes):
        has = f"has the axes {term.axes!r}" if term.axes else "has no axes"
        raise table.error("axes", f"names {sorted(unknown)}; {name} {has}")
    bodies = table.names("bodies") if term.of_bodies else ()
    if term.of_bodies and not bodies:
        raise table.error("bodies", "is empty; expected names of bodies")
    width = len(axes) or (term.width or count) * max(len(bodies), 1)
    zero = table.names("zero", ())
    if unknown := set(zero) - set(joints):
        raise table.error("zero", f"names {name_list(sorted(unknown))}, no joints of the spec")
    if zero and term.width:
        raise table.error("zero", f"names joints; {name} is no term of joints")
    steps = _steps(table, ahead)
    if not term.reference and "ahead" in table.content:
        raise table.error("ahead", f"is for terms of the reference; {name} is the robot's own")
    use = TermUse(
        term=name,
        axes=tuple(term.axes.index(axis) for axis in axes) if axes else None,
        scale=tuple(table.numbers("scale", width, 1.0).tolist()),
        clip=table.number("clip", float("inf"), least=0.0),
        zero=zero,
        ahead=steps if term.reference else (0,),
        anchor=(table.word("anchor", "") or None) if term.anchored else None,
        bodies=bodies,
        at=tuple(table.numbers("at", 3, 0.0).tolist()) if term.of_point else (0.0, 0.0, 0.0),
    )
    table.finish()
    return use


def _block(table: Table, groups: dict[str, tuple[TermUse, ...]]) -> Block:
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
    terms = tuple(use for name in names for use in groups[name])
    if "ahead" in table.content:
        if not all(TERMS[use.term].reference for use in terms):
            raise table.error("ahead", "is for terms of the reference; the block has others")
        steps = _steps(table, 1)
        terms = tuple(replace(use, ahead=(step,)) for step in steps for use in terms)
    table.asked.add("ahead")
    block = Block(
        terms=terms,
        history=int(history),
        present=table.choice("present", (False, True)),
        newest_first=table.choice("order", ("oldest_first", "newest_first")) == "newest_first",
        by_term=table.choice("layout", ("by_step", "by_term")) == "by_term",
        repeat=table.choice("start", ("zeros", "repeat")) == "repeat",
    )
    table.finish()
    return block
