"""What a training run is: everything that `spark-sim train` can be told. No torch here."""

import sys
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from spark.errors import ConventionError
from spark.opening import parse_toml, read_text

PRESETS = ("default", "paper", "tiny")
COMPILE = ("auto", "on", "off")
ABLATIONS = ("share", "mask", "pos", "fk", "mix")


@dataclass(frozen=True)
class TrainConfig:
    """A training run. `tiny` is the default preset, small enough for minutes on a CPU.

    `ablate` names switches of the paper's table 2 to throw: share and mask are left out, pos gives
    the encoder joint positions too (or takes them away where the preset has them), fk drops the
    loss on positions, mix lets any two of the paper's characters share ten motions (table 2b).
    Encoder and decoder have `blocks` blocks each. `batch` windows a step are drawn `per_body` at a
    time from one pair of bodies, of which each recorded body has, in pairs that are made,
    `variants`. The rate rises over `warmup` steps and then falls along a cosine to a tenth at
    `steps`. Batches are made in `workers` processes (-1: 8 for a GPU, else none), and the network
    is compiled (auto: for a GPU, where the run is long). With `bf16`, matrix products are in
    bfloat16 where the processor has them. The encoder of joint names is the one that ships
    ("shipped"); `names` is a file with another, or one is learned first in `name_steps`, or `t5` is
    a T5. A checkpoint is written every `save_every` steps and every `save_minutes`.
    """

    preset: str = "default"
    ablate: tuple[str, ...] = ()
    data: tuple[str, ...] = ()
    width: int = 128
    heads: int = 4
    blocks: int = 4
    steps: int = 100_000
    batch: int = 16
    per_body: int = 4
    window: int = 64
    variants: int = 256
    rate: float = 1e-4
    warmup: int = 500
    weight_decay: float = 0.01
    seed: int = 0
    workers: int = -1
    compile: str = "auto"
    bf16: bool = True
    save_every: int = 1000
    save_minutes: float = 5.0
    log_every: int = 20
    name_steps: int = 0
    names: str = ""
    t5: str = ""

    def __post_init__(self) -> None:
        _one_of("preset", self.preset, PRESETS)
        _one_of("compile", self.compile, COMPILE)
        for switch in self.ablate:
            _one_of("ablate", switch, ABLATIONS)
        for name, lowest in _LOWEST.items():
            if not getattr(self, name) >= lowest:
                raise ConventionError(
                    f"{name} = {getattr(self, name)}: expected {lowest} or more in a training run"
                )
        for name, highest in _HIGHEST.items():
            if not getattr(self, name) <= highest:
                raise ConventionError(
                    f"{name} = {getattr(self, name)}: expected {highest:g} at most in a training "
                    "run"
                )
        if self.width % (2 * self.heads):
            raise ConventionError(
                f"width = {self.width}: expected a multiple of twice the heads ({self.heads})"
            )
        if self.names and self.t5:
            raise ConventionError(
                f"names = {self.names!r} and t5 = {self.t5!r}: expected one of them, or none"
            )
        if self.batch % self.per_body:
            raise ConventionError(
                f"batch = {self.batch} is no multiple of per_body = {self.per_body}; "
                "a step's windows are drawn that many at a time"
            )

    @classmethod
    def of(cls, preset: str) -> "TrainConfig":
        """The preset's own settings."""
        if preset == "tiny":
            return cls(
                preset,
                width=48,
                heads=2,
                blocks=2,
                steps=1000,
                window=32,
                variants=16,
                rate=1e-3,
                warmup=20,
            )
        return cls(preset, per_body=1) if preset == "paper" else cls(preset)

    def changed(self, where: object, **values: Any) -> "TrainConfig":
        """These settings with others in their place. Raises `ConventionError` for unknown ones."""
        known = {f.name: f.type for f in fields(self)}
        for name, value in values.items():
            if name not in known:
                raise ConventionError(
                    f"{where}: {name!r} is no setting; expected one of {', '.join(sorted(known))}"
                )
            if not _fits(value, getattr(self, name)):
                raise ConventionError(
                    f"{where}: {name} = {value!r}: expected a value such as {getattr(self, name)!r}"
                )
        # TOML's 1 is a float, too, and its lists are tuples.
        return replace(self, **{k: type(getattr(self, k))(v) for k, v in values.items()})

    @property
    def draws(self) -> int:
        """Draws that make up one step."""
        return self.batch // self.per_body


_LOWEST = {
    **dict.fromkeys(("width", "heads", "blocks", "steps", "batch", "per_body", "variants"), 1),
    **dict.fromkeys(("save_every", "log_every"), 1),
    **dict.fromkeys(("seed", "warmup", "weight_decay", "rate", "name_steps"), 0),
    "save_minutes": 0,
    "workers": -1,
    "window": 2,
}
_HIGHEST = {
    **dict.fromkeys(("width", "window"), 8192),
    **dict.fromkeys(("heads", "blocks", "workers"), 512),
    **dict.fromkeys(("batch", "per_body", "variants"), 65536),
    **dict.fromkeys(("steps", "save_every", "log_every", "warmup", "name_steps"), 10**9),
    "seed": 2**63 - 1,
    **dict.fromkeys(("rate", "weight_decay", "save_minutes"), sys.float_info.max),  # finite
}


def read_settings(path: Path) -> dict[str, Any]:
    """The settings in a TOML file. Raises `FileFormatError` where it isn't one."""
    text = read_text(path, expected="settings (TOML)")
    return parse_toml(path, text, "lines such as steps = 1000")


def toml(config: TrainConfig) -> str:
    """`config` as a file that `read_settings` reads."""
    return "".join(f"{name} = {_literal(value)}\n" for name, value in asdict(config).items())


def _literal(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_literal, value))}]"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)


def _fits(value: Any, example: Any) -> bool:
    if isinstance(value, bool) or isinstance(example, bool):
        return isinstance(value, bool) and isinstance(example, bool)
    if isinstance(example, tuple):
        return isinstance(value, list | tuple) and all(isinstance(v, str) for v in value)
    if isinstance(example, float):
        return isinstance(value, float) or (
            isinstance(value, int) and abs(value) <= sys.float_info.max
        )
    return isinstance(value, type(example))


def _one_of(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise ConventionError(f"{name} = {value!r}: expected one of {', '.join(allowed)}")
