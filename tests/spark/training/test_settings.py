"""What a training run can be told."""

from pathlib import Path

import pytest

from spark.errors import ConventionError
from spark.training.objective import Objective, network
from spark.training.settings import TrainConfig, read_settings, toml
from tests.helpers.training import TINY, fresh


def test_settings_survive_their_file(tmp_path: Path) -> None:
    config = TINY.changed("test", data=['a "b" \\ c', "d"], ablate=["fk"])
    path = tmp_path / "config.toml"
    path.write_text(toml(config))
    assert TrainConfig().changed(path, **read_settings(path)) == config


def test_whole_numbers_are_rates_and_minutes_too(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text("rate = 0\nsave_minutes = 3\n")
    config = TrainConfig().changed(path, **read_settings(path))
    assert (config.rate, config.save_minutes) == (0.0, 3.0)
    assert isinstance(config.rate, float)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"stepps": 1}, "'stepps' is no setting"),
        ({"steps": "many"}, "steps = 'many'"),
        ({"steps": 0}, "steps = 0"),
        ({"batch": 6, "per_body": 4}, "no multiple"),
        ({"ablate": ["feet"]}, "expected one of share, mask, pos, fk, mix"),
        ({"preset": "huge"}, "expected one of default, paper, tiny"),
        ({"seed": True}, "seed = True"),
        ({"rate": 10**400}, "rate = 1000"),
    ],
)
def test_wrong_settings_are_named(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConventionError, match=message):
        TrainConfig().changed("file", **values)


def test_each_ablation_is_one_switch() -> None:
    paper = network(TrainConfig.of("paper"), 128)
    changes = {}
    for switch in ("share", "mask", "pos"):
        other = network(TrainConfig.of("paper").changed("test", ablate=[switch]), 128)
        changes[switch] = {k: v for k, v in vars(other).items() if v != getattr(paper, k)}
    assert changes == {
        "share": {"share_joints": False},
        "mask": {"mask_joints": 0.0},
        "pos": {"positions_in": True},
    }
    config = TINY.changed("test", ablate=["fk"])
    assert "fk" not in Objective(fresh(config).model, config).weights
