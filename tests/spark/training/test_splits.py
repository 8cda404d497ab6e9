"""Whose motion a file is, and which characters training sees."""

from pathlib import Path

import pytest

from spark.evaluation.cases import performances, recorded_cases
from spark.training.prepare import prepare
from spark.training.splits import character_and_motion, seen_characters
from spark_sim import sample


@pytest.mark.parametrize(
    ("stem", "folder", "expected"),
    [
        ("Mousey@Gangnam Style", "flat", ("Mousey", "Gangnam Style")),
        ("Mousey@Gangnam Style", "Mousey", ("Mousey", "Gangnam Style")),
        ("Big Vegas@Idle", "downloads", ("Big Vegas", "Idle")),
        ("sk001@idle_59f", "flat", ("sk001", "idle_59f")),
        ("Castle Guard 01 - Zombie Run", "flat", ("Castle Guard 01", "Zombie Run")),
        ("castle_guard_01_zombie_run", "flat", ("castle_guard_01", "zombie_run")),
        ("paladin_j_nordstrom-slash", "flat", ("paladin_j_nordstrom", "slash")),
        ("Amyloid study", "flat", (None, "Amyloid study")),
        ("Amy", "flat", (None, "Amy")),
        ("Amy", "Mutant", (None, "Amy")),
        ("Amy dance", "Mutant", (None, "Amy dance")),  # the folder says whose it is
        ("Amy dance", "Mutant 2", (None, "Amy dance")),
        ("walk@", "flat", (None, "walk@")),
        ("@walk", "flat", (None, "@walk")),
    ],
)
def test_a_files_name_says_whose_motion_it_is(
    stem: str, folder: str, expected: tuple[str | None, str]
) -> None:
    assert character_and_motion(stem, folder) == expected


def test_a_second_body_of_a_character_is_that_character() -> None:
    seen = seen_characters(["Mousey", "Mousey 2", "AJ", "aj 3", "Castle Guard 01"], 0)
    assert seen == {
        "Mousey": True,
        "Mousey 2": True,
        "AJ": False,
        "aj 3": False,
        "Castle Guard 01": True,
    }


def test_a_flat_folder_splits_by_name(tmp_path: Path) -> None:
    """Both prepare and evaluate see whose motions they are, and which two characters share."""
    flat = tmp_path / "flat"
    for path in sample(tmp_path / "samples"):
        body, motion = path.stem.split("_", 1)
        name = {"walker": "Mousey", "dancer": "Kaya"}[body]
        flat.mkdir(exist_ok=True)
        path.rename(flat / f"{name}@{motion}.bvh")
    index = prepare([flat], tmp_path / "dataset")
    assert [body["character"] for body in index["bodies"]] == ["Kaya", "Mousey"]
    cells = {(clip["body"], clip["cell"][:2]) for clip in index["clips"]}
    assert cells == {(0, "uc"), (1, "sc")}
    for data in (flat, tmp_path / "dataset"):
        cases, notes = recorded_cases(performances(data))
        assert {(c.performer, c.target) for c in cases} == {("Mousey", "Kaya"), ("Kaya", "Mousey")}
        assert len({c.motion for c in cases}) == 3
        assert not notes


def test_characters_whom_files_name_are_not_each_other(tmp_path: Path) -> None:
    """Two of one skeleton stay two where files say so; folders of one skeleton are one body."""
    walk, *_ = sample(tmp_path / "samples")
    other = walk.read_text().replace("Frame Time: 0.0333333", "Frame Time: 0.0333334")
    assert other != walk.read_text()
    for places, expected in (
        (("flat/A@walk.bvh", "flat/B@walk.bvh"), ["A", "B"]),
        (("A/walk.bvh", "B/walk.bvh"), ["A"]),
        (("A/walk.bvh", "flat/A@turn.bvh"), ["A"]),
    ):
        tree = tmp_path / "".join(p[0] for p in expected) / str(len(places[1]))
        for place, text in zip(places, (walk.read_text(), other), strict=True):
            (tree / place).parent.mkdir(parents=True, exist_ok=True)
            (tree / place).write_text(text)
        index = prepare([tree], tmp_path / f"out{len(places[1])}{len(expected)}")
        assert [body["character"] for body in index["bodies"]] == expected


def test_a_character_whom_files_name_is_one_on_every_skeleton(tmp_path: Path) -> None:
    """Else training would see an unseen character, in files whose skeletons differ."""
    made = sample(tmp_path / "samples")
    (tmp_path / "flat").mkdir()
    for number, path in enumerate(made):
        who = ("Anna", "Bert", "Carl")[number % 3]
        path.rename(tmp_path / "flat" / f"{who}@{path.stem}.bvh")
    index = prepare([tmp_path / "flat"], tmp_path / "dataset")
    assert len(index["bodies"]) > len({body["character"] for body in index["bodies"]}) == 3
    cells = {(index["bodies"][c["body"]]["character"], c["cell"][:2]) for c in index["clips"]}
    assert len(cells) == 3
