"""Which input and output of a policy's network is what."""

from collections.abc import Mapping
from dataclasses import dataclass

from sim.physics.toml_table import Table


@dataclass(frozen=True)
class Ports:
    """What a network's inputs and outputs are, by their names.

    With one input and one output, which these are need not be told ("").  `step` is an input that
    gets the number of the control step, and `state` maps inputs to the outputs that they get of
    the step before, 0 at first.
    """

    observation: str
    action: str
    step: str
    state: Mapping[str, str]


def read_ports(table: Table) -> Ports:
    """Those of a spec's table `[network]`."""
    state = table.table("state", {})
    ports = Ports(
        observation=table.word("observation", ""),
        action=table.word("action", ""),
        step=table.word("step", ""),
        state={name: state.word(name) for name in state.content},
    )
    inputs = [name for name in (ports.observation, ports.step, *ports.state) if name]
    outputs = [name for name in (ports.action, *ports.state.values()) if name]
    if len({*inputs}) < len(inputs) or len({*outputs}) < len(outputs):
        raise table.error("state", "names an input or an output that has another use, too")
    return ports
