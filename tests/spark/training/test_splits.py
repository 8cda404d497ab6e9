"""Whose motion a file is, and which characters training sees."""

from pathlib import Path

import pytest

from spark.evaluation.cases import performances, recorded_cases
from spark.training.prepare import prepare
from spark.training.splits import (
    characters_and_motions,
    motions_of,
    seen_characters,
    seen_motions,
)
from spark_sim import sample


@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("flat/Mousey@Gangnam Style.bvh", ("Mousey", "Gangnam Style")),
        ("Mousey/Mousey@Gangnam Style.bvh", ("Mousey", "Gangnam Style")),
        ("downloads/Big Vegas@Idle.fbx", ("Big Vegas", "Idle")),
        ("flat/sk001@idle_59f.bvh", ("sk001", "idle_59f")),
        ("flat/Amyloid study.bvh", (None, "Amyloid study")),
        ("flat/Amy.bvh", (None, "Amy")),
        ("Mutant/Amy.bvh", (None, "Amy")),
        ("flat/walk@.bvh", (None, "walk@")),
        ("flat/@walk.bvh", (None, "@walk")),
    ],
)
def test_a_files_name_says_whose_motion_it_is(file: str, expected: tuple[str | None, str]) -> None:
    assert characters_and_motions([Path(file)]) == [expected]


def test_in_a_folder_of_several_the_papers_characters_in_front_say_it() -> None:
    flat = ["Castle Guard 01 - Zombie Run", "castle_guard_01_zombie_run", "Mousey-slash", "walk"]
    expected = [
        ("Castle Guard 01", "Zombie Run"),
        ("castle_guard_01", "zombie_run"),
        ("Mousey", "slash"),
        (None, "walk"),
    ]
    assert characters_and_motions([Path("flat") / name for name in flat]) == expected
    # A folder that is called after one of them holds that one's motions.
    named = [Path("Mutant 2") / name for name in flat]
    assert characters_and_motions(named) == [(None, file.name) for file in named]


@pytest.mark.parametrize(
    "names",
    [
        ["mutant_idle", "mutant_dying", "boxing", "goblin_walk", "idle", "samba", "twist"],
        ["Mutant Swiping"],
        ["Mutant Idle", "Mutant Run"],
    ],
)
def test_motions_that_are_called_after_a_character_are_of_the_folders(names: list[str]) -> None:
    """`Mutant Idle` is one of Mixamo's motions, for whichever character it was downloaded."""
    files = [Path("XBot") / f"{name}.fbx" for name in names]
    assert characters_and_motions(files) == [(None, name) for name in names]


def test_spellings_of_a_motion_are_one() -> None:
    silly = ["Silly Dancing", "Silly Dancing (1)", "silly_dancing", "SILLY-DANCING(12)"]
    motions = motions_of([*silly, "Silly Dancing 2", "Sillydancing", "(1)", "()"])
    assert {motions[name] for name in silly} == {min(silly)}
    assert len(set(motions.values())) == 5
    for seed in range(20):
        seen = seen_motions([*silly, "walk", "run", "jump"], seed)
        assert len({seen[name] for name in silly}) == 1


def test_numbers_of_downloads_are_no_motions_of_their_own(tmp_path: Path) -> None:
    """Two characters' files of one motion, as a browser named them, are a pair."""
    flat = tmp_path / "flat"
    flat.mkdir()
    for path in sample(tmp_path / "samples"):
        body, motion = path.stem.split("_", 1)
        name = {"walker": f"A@{motion.title()} (1)", "dancer": f"B@{motion}"}[body]
        path.rename(flat / f"{name}.bvh")
    cases, _ = recorded_cases(performances(flat))
    pairs = {(c.performer, c.target, c.motion) for c in cases}
    assert ("A", "B", "Walk (1)") in pairs  # the source's file, as results of other tools are named
    assert ("B", "A", "walk") in pairs
    index = prepare([flat], tmp_path / "dataset")
    for motion in ("walk", "wave"):
        cells = {c["cell"][3:] for c in index["clips"] if c["motion"].lower().startswith(motion)}
        assert len(cells) == 1


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


def test_a_folders_bodies_of_the_same_limbs_are_one_character(tmp_path: Path) -> None:
    """Downloads of one character from different years differ by a joint, or by a heel. Were they
    drawn one by one, training would see an unseen character."""
    walk, *_ = sample(tmp_path / "samples")
    text = walk.read_text()
    lines = text.splitlines(keepends=True)
    toe = next(i for i, line in enumerate(lines) if "JOINT" in line and "Toe" in line)
    offset = next(i for i in range(toe, len(lines)) if "OFFSET" in lines[i])
    head, *numbers = lines[offset].split("OFFSET")
    x, y, z = map(float, numbers[0].split())
    for name, scale in (("heel", 1.01), ("long", 1.5)):
        moved = f"{head}OFFSET {x * scale} {y * scale} {z * scale}\n"
        folder = tmp_path / name / "XBot"
        folder.mkdir(parents=True)
        (folder / "a.bvh").write_text(text)
        (folder / "b.bvh").write_text("".join([*lines[:offset], moved, *lines[offset + 1 :]]))
        index = prepare([tmp_path / name], tmp_path / f"{name}_dataset")
        characters = [body["character"] for body in index["bodies"]]
        assert characters == ["XBot", "XBot" if name == "heel" else "XBot 2"]
