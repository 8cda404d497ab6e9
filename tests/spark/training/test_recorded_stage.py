"""What a run says of the recorded pairs of its data before it begins."""

from dataclasses import replace
from pathlib import Path

import pytest

from spark.training.prepare import prepare
from spark.training.recorded_pairs import RecordedPairs, recorded_pairs
from spark.training.recorded_stage import recorded_stage
from spark_sim import sample
from tests.helpers.proportions import striding
from tests.helpers.recorded import answered, body, performance
from tests.helpers.training import TINY


@pytest.fixture(scope="module")
def known() -> RecordedPairs:
    """One motion on six bodies, two of each of three characters."""
    first = striding(body(0))
    found = [first, *(answered(first, body(seed)) for seed in range(1, 6))]
    return recorded_pairs([performance(f"body {k % 3}", one) for k, one in enumerate(found)])


def test_characters_count_and_not_their_bodies(known: RecordedPairs) -> None:
    assert len({pair.target for pair in known.pairs}) == 6
    assert known.sharing == ["body 0", "body 1", "body 2"]
    assert not known.enough


def test_pairs_are_of_two_characters(known: RecordedPairs) -> None:
    for pair in known.pairs:
        assert known.characters[pair.source] != known.characters[pair.target]


def test_it_says_why_nothing_is_learned(tmp_path: Path) -> None:
    walks = tmp_path / "walks"
    for path in sample(tmp_path / "samples"):
        who, motion = path.stem.split("_")
        (walks / who).mkdir(parents=True, exist_ok=True)
        path.rename(walks / who / f"{motion}.bvh")
    prepare([walks], tmp_path / "dataset")

    def about(data: Path, **changed: str) -> str | None:
        stage = recorded_stage(replace(TINY, data=(str(data),), **changed))
        assert stage is None or stage.known is None
        return stage.about if stage else None

    assert "spark-sim prepare" in str(about(walks))
    told = str(about(tmp_path / "dataset"))
    assert "characters: nothing is learned from them; at least 8" in told
    assert about(tmp_path / "dataset", preset="paper") is None
