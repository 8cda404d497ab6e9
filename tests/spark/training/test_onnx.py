"""What is not written as a graph. `tests/spark/network/test_forward.py` has what is."""

from pathlib import Path

import pytest

from spark.errors import OutputError
from spark.training.onnx import export_onnx
from tests.helpers.training import TINY, fresh


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_network_that_is_not_finite_is_not_written(bad: float, tmp_path: Path) -> None:
    checkpoint = fresh(TINY)
    name, weight = next(iter(checkpoint.model.named_parameters()))
    weight.data.view(-1)[-1] = bad
    path = tmp_path / "network.onnx"
    path.write_text("mine")
    with pytest.raises(OutputError, match=f"network.onnx: not written: the network's '{name}'"):
        export_onnx(checkpoint, path)
    assert path.read_text() == "mine"
