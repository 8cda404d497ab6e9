"""What a table counts as unseen, and a network has met."""

from dataclasses import replace
from pathlib import Path

from spark.evaluation.cases import performances
from spark.evaluation.met import met_unseen
from spark.network.known_bodies import distinct_trunks


def test_characters_of_a_networks_training_are_not_unseen(tree: Path) -> None:
    """Another dataset's split, or one that more files changed, may hold out what it was trained
    on."""
    found = performances(tree)
    of = {p.character: p.clip.body for p in found}
    split = [replace(p, cell="sc+sm" if p.character == "walker" else "uc+sm") for p in found]
    assert met_unseen(split, distinct_trunks([of["walker"]])) == []
    assert met_unseen(split, distinct_trunks([of["walker"], of["dancer"]])) == ["dancer"]
    assert met_unseen(found, distinct_trunks(of.values())) == []  # a folder has no split
