"""The picture of a run's losses."""

import io
import json
from pathlib import Path

import numpy as np
import pytest

from spark.training.loss_plot import LossPlot, picture, read_terms
from spark.training.run_log import open_log

pytest.importorskip("matplotlib")


def test_the_plot_has_the_terms_of_the_log_and_grows(tmp_path: Path) -> None:
    from PIL import Image

    log = tmp_path / "log.jsonl"
    plot = LossPlot(tmp_path)
    plot.update(now=True)
    assert not (tmp_path / "losses.png").exists()  # nothing to show yet
    lines = [{"step": n, "seconds": n, "loss": 1 / n, "fk": 0.1 / n} for n in range(1, 60)]
    log.write_text("".join(json.dumps(line) + "\n" for line in lines) + '{"step": 60, "lo')
    assert {k: len(v) for k, v in read_terms(log).items()} == {"loss": 59, "fk": 59}
    plot.update()
    assert not (tmp_path / "losses.png").exists()  # too soon after the last
    plot.update(now=True)
    first = (tmp_path / "losses.png").read_bytes()
    pixels = np.asarray(Image.open(io.BytesIO(first)).convert("RGB"), int)
    assert (pixels.max(-1) < 40).mean() > 0.005  # black: text and the loss
    assert (pixels.max(-1) - pixels.min(-1) > 80).mean() > 0.001  # a colour: the term
    log.write_text(log.read_text() + 'ss": 1}\n{"step": 61, "loss": 0.001}\n')
    plot.update(now=True)
    assert (tmp_path / "losses.png").read_bytes() != first


@pytest.mark.parametrize("line", ["[" * 100_000, '{"step": 1e999, "loss": 1}', "[1]", "1"])
def test_lines_of_others_are_passed_over(tmp_path: Path, line: str) -> None:
    log = tmp_path / "log.jsonl"
    log.write_text(f'{line}\n{{"step": 7, "loss": 0.5}}\n')
    assert read_terms(log) == {"loss": [(7, 0.5)]}
    open_log(tmp_path, 7, 0).close()
    assert read_terms(log) == {"loss": [(7, 0.5)]}


def test_settings_of_the_current_folder_have_no_say() -> None:
    """A matplotlibrc there may ask for LaTeX, which runs programs; a twin shows that it would."""
    import matplotlib
    from matplotlib.figure import Figure

    terms = {"loss": [(1, 1.0), (2, 0.5)]}
    plain = picture(terms)
    with matplotlib.rc_context({"figure.facecolor": "red", "lines.linewidth": 9}):
        assert Figure().get_facecolor() == (1, 0, 0, 1)
        assert picture(terms) == plain
