"""A policy's network: an ONNX file, run by onnxruntime on one core."""

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sim.physics.policy_spec import PolicySpec
from spark.errors import DependencyError, FileFormatError, SparkSimError, name_list
from spark.opening import check_regular

_STEP_TYPES = {"tensor(float)": np.float32, "tensor(int64)": np.int64, "tensor(int32)": np.int32}


class PolicyNetwork:
    """Observations to actions, of the widths that the spec says; what it keeps from step to step
    is its state.

    Raises `DependencyError` without onnxruntime, and `FileFormatError` where the file is no network
    with the inputs and outputs that the spec says, or made for other joints.
    """

    def __init__(self, path: Path, spec: PolicySpec) -> None:
        check_regular(path, expected="a policy, .onnx")
        runtime = _onnxruntime()
        options = runtime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4  # what is wrong is raised
        try:
            self._session = runtime.InferenceSession(
                str(path), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime raises classes of its own, one for each cause
            reason = str(error).splitlines()[0]
            raise FileFormatError(path, None, f"is no ONNX network that runs ({reason})") from error
        self._path, self._actions, self._ports = path, len(spec.joints), spec.ports
        self._inputs = {each.name: each for each in self._session.get_inputs()}
        self._outputs = {each.name: each for each in self._session.get_outputs()}
        state = spec.ports.state
        used = [name for name in (spec.ports.step, *state) if name]
        self._observation = self._named(self._inputs, "input", "observation", spec, used)
        self._action = self._named(self._outputs, "output", "action", spec, [*state.values()])
        self._check_width(
            self._inputs[self._observation],
            "input",
            spec.width,
            f"{spec.path.name} describes an observation of {spec.width} numbers",
        )
        self._check_width(
            self._outputs[self._action],
            "output",
            self._actions,
            f"{spec.path.name} has {self._actions} joints",
        )
        self._check_others(spec)
        self._check_joints(spec)
        self.forget()

    def forget(self) -> None:
        """Begin anew: the state is 0."""
        self._state = {
            name: np.zeros(_fixed(self._inputs[name].shape), np.float32)
            for name in self._ports.state
        }

    def __call__(
        self, observation: Float[np.ndarray, "N"], step: int = 0
    ) -> Float[np.ndarray, "A"]:
        """The raw action in a control step of the motion. Raises `SparkSimError` where it is no
        finite number."""
        fed = {self._observation: observation.astype(np.float32)[None], **self._state}
        if self._ports.step:
            port = self._inputs[self._ports.step]
            fed[port.name] = np.full(_fixed(port.shape), step, _STEP_TYPES[port.type])
        kept = self._ports.state.values()
        found, *after = self._session.run([self._action, *kept], fed)
        self._state = dict(zip(self._ports.state, after, strict=True))
        action = found.astype(float).reshape(-1)
        if action.shape != (self._actions,) or not np.isfinite(action).all():
            raise SparkSimError(
                f"{self._path}: gave {len(action)} numbers of which "
                f"{int(np.isfinite(action).sum())} are finite; expected {self._actions}"
            )
        return action

    def _named(
        self, found: Mapping[str, Any], what: str, key: str, spec: PolicySpec, used: list[str]
    ) -> str:
        """The input or output that the spec names, or else the only one, beside those in use."""
        named = getattr(spec.ports, key)
        for name in (*used, *([named] if named else [])):
            if name not in found:
                raise FileFormatError(
                    self._path,
                    None,
                    f"has no {what} {name!r}, which [network] of {spec.path.name} names; it has "
                    f"{name_list([*found])}",
                )
        left = [name for name in found if name not in used]
        if named or len(left) == 1:
            return named or left[0]
        raise FileFormatError(
            self._path,
            None,
            f"has {len(found)} {what}s ({', '.join(found)}); expected one, or [network] in "
            f"{spec.path.name} that says which is the {key}",
        )

    def _check_width(self, port: Any, what: str, width: int, why: str) -> None:
        """Raise unless it is of shape [1 or any, width] and float32."""
        shape = list(port.shape)
        one = len(shape) == 2 and (shape[0] == 1 or not isinstance(shape[0], int))
        if port.type != "tensor(float)" or not one:
            raise FileFormatError(
                self._path,
                None,
                f"{what} {port.name!r} is {port.type} of shape {shape}; expected tensor(float) of "
                f"shape [1, {width}]",
            )
        if shape[1] != width:
            said = shape[1] if isinstance(shape[1], int) else "any number"
            raise FileFormatError(
                self._path,
                None,
                f"{what} {port.name!r} is {said} wide, but {why}; not run: correct the spec, or "
                "export the network with its width",
            )

    def _check_others(self, spec: PolicySpec) -> None:
        """Raise where an input would get nothing, or what it can't be fed with."""
        ports = spec.ports
        known = [self._observation, ports.step, *ports.state]
        if unfed := [name for name in self._inputs if name not in known]:
            raise FileFormatError(
                self._path,
                None,
                f"has inputs that get nothing: {name_list(unfed)}; [network] in {spec.path.name} "
                "says which is the step, and which a state",
            )
        if ports.step and self._inputs[ports.step].type not in _STEP_TYPES:
            kind = self._inputs[ports.step].type
            raise FileFormatError(self._path, None, f"input {ports.step!r} is {kind}; no step")
        for name, source in ports.state.items():
            fed, kept = self._inputs[name], self._outputs[source]
            if {fed.type, kept.type} != {"tensor(float)"} or _fixed(fed.shape) != _fixed(
                kept.shape
            ):
                raise FileFormatError(
                    self._path,
                    None,
                    f"the state {name!r} is {fed.type} of shape {fed.shape}, and {source!r} "
                    f"{kept.type} of shape {kept.shape}; expected tensor(float), both the same",
                )

    def _check_joints(self, spec: PolicySpec) -> None:
        """Raise where the file, as those of mjlab and BeyondMimic, tells other joints than the
        spec, or in another order."""
        said = self._session.get_modelmeta().custom_metadata_map.get("joint_names", "")
        names = [name.strip() for name in said.split(",")]
        if not said or tuple(names) == spec.joints:
            return
        pairs = enumerate(zip_longest(names, spec.joints), start=1)
        at, theirs, ours = next((k, *pair) for k, pair in pairs if pair[0] != pair[1])
        raise FileFormatError(
            self._path,
            None,
            f"was exported for other joints than {spec.path.name} has, or in another order: its "
            f"joint {at} is {theirs!r}, that of the spec {ours!r}",
        )


def _fixed(shape: Sequence[Any]) -> list[int]:
    """A shape, with 1 where any number goes."""
    return [each if isinstance(each, int) else 1 for each in shape]


def _onnxruntime() -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise DependencyError(
            "running a policy needs onnxruntime: pip install 'spark-sim[policy]'"
        ) from error
    return onnxruntime
