"""A policy's network: an ONNX file, run by onnxruntime on one core."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sim.physics.policy_spec import PolicySpec
from spark.errors import DependencyError, FileFormatError, SparkSimError
from spark.opening import check_regular


class PolicyNetwork:
    """Observations to actions, of the widths that the spec says.

    Raises `DependencyError` without onnxruntime, and `FileFormatError` where the file is no network
    with one input and one output of the spec's widths.
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
        self._path, self._actions = path, len(spec.joints)
        self._input = self._checked(
            self._session.get_inputs(),
            "input",
            spec.width,
            f"{spec.path.name} describes an observation of {spec.width} numbers",
        )
        self._output = self._checked(
            self._session.get_outputs(),
            "output",
            self._actions,
            f"{spec.path.name} has {self._actions} joints",
        )

    def __call__(self, observation: Float[np.ndarray, "N"]) -> Float[np.ndarray, "A"]:
        """The raw action. Raises `SparkSimError` where it is no finite number."""
        fed = {self._input: observation.astype(np.float32)[None]}
        action = self._session.run([self._output], fed)[0].astype(float).reshape(-1)
        if action.shape != (self._actions,) or not np.isfinite(action).all():
            raise SparkSimError(
                f"{self._path}: gave {len(action)} numbers of which "
                f"{int(np.isfinite(action).sum())} are finite; expected {self._actions}"
            )
        return action

    def _checked(self, found: list[Any], what: str, width: int, why: str) -> str:
        """The name of the only input or output, of shape [1 or any, width] and float32."""
        if len(found) != 1:
            names = ", ".join(each.name for each in found)
            raise FileFormatError(
                self._path, None, f"has {len(found)} {what}s ({names}); expected one"
            )
        (only,) = found
        shape = list(only.shape)
        one = len(shape) == 2 and (shape[0] == 1 or not isinstance(shape[0], int))
        if only.type != "tensor(float)" or not one:
            raise FileFormatError(
                self._path,
                None,
                f"{what} {only.name!r} is {only.type} of shape {shape}; expected tensor(float) of "
                f"shape [1, {width}]",
            )
        if shape[1] != width:
            said = shape[1] if isinstance(shape[1], int) else "any number"
            raise FileFormatError(
                self._path,
                None,
                f"{what} {only.name!r} is {said} wide, but {why}; not run: correct the spec, or "
                "export the network with its width",
            )
        return str(only.name)


def _onnxruntime() -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise DependencyError(
            "running a policy needs onnxruntime: pip install 'spark-sim[policy]'"
        ) from error
    return onnxruntime
