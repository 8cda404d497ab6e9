"""Evaluation: known answers get the score that they must, and what has no answer is refused."""

import csv
import json
import math
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import spark_sim
from spark.demo.sample import sample_rig
from spark.errors import FileFormatError, SkeletonError, SparkSimError
from spark.evaluation.cases import Case, made_cases, performances, recorded_cases
from spark.evaluation.evaluate import (
    CellScore,
    MethodScores,
    as_method,
    evaluate,
    results_in,
)
from spark.evaluation.metrics import Score
from spark.evaluation.tables import as_csv, as_json, markdown
from spark.io.bvh import read_bvh, write_bvh
from spark.network.features import body_features
from spark.network.known_bodies import distinct_trunks
from spark.rig.contacts import planted_feet, speeds
from spark.training.checkpoint import Checkpoint, save_checkpoint
from spark.training.cuts import TrainingClip
from spark.training.dataset import Performance
from spark.training.model import Spark
from spark.training.name_encoder import NameConfig, NameEncoder
from spark.training.objective import network
from spark.training.settings import TrainConfig
from spark.training.variants import same_body, split_body, split_joints
from spark.transfer.analytic import correspond, transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark_sim import cli, console
from tests.helpers import nets


@pytest.fixture(scope="module")
def found(tree: Path) -> list[Performance]:
    return performances(tree)


@pytest.fixture(scope="module")
def cases(found: list[Performance]) -> list[Case]:
    return recorded_cases(found)[0]


def test_a_characters_bodies_are_compared_each_with_itself(tree: Path, tmp_path: Path) -> None:
    """Results on other joints can't be subtracted: no two clips here are on one body."""
    for name, of in (
        ("A@walk", "walker"),
        ("A@wave", "dancer"),
        ("B@walk", "dancer"),
        ("B@wave", "walker"),
    ):
        shutil.copy(tree / of / f"{name[2:]}.bvh", tmp_path / f"{name}.bvh")
    scores = evaluate("copy", as_method(transfer), recorded_cases(performances(tmp_path))[0])
    assert len(scores.each) == 4
    assert all(math.isnan(value) for value in scores.sensitivity.values())


def test_every_motion_on_two_bodies_is_two_pairs(cases: list[Case]) -> None:
    pairs = {(c.motion, c.performer, c.target) for c in cases}
    assert len(pairs) == 3 * 2
    assert {(c.performer, c.target) for c in cases} == {("walker", "dancer"), ("dancer", "walker")}
    assert {c.cell for c in cases} == {""}
    # The two have other spines: no pair is intra-structural.
    assert {c.structure for c in cases} == {"cross"}


def test_no_pair_is_an_error_that_names_a_way_out(found: list[Performance]) -> None:
    alone = [one for one in found if one.character == "walker"]
    with pytest.raises(SkeletonError, match=r"no motion is on two characters.*--made"):
        recorded_cases(alone)


def shorter(clip: TrainingClip, as_method: int) -> TrainingClip:
    """A clip without its last frames."""
    arrays = (clip.rotations[:-as_method], clip.hips[:-as_method], clip.planted[:-as_method])
    return TrainingClip(clip.name, clip.body, *arrays, clip.frame_time)


def test_motions_of_other_lengths_are_no_pair(found: list[Performance]) -> None:
    cut = [
        replace(one, clip=shorter(one.clip, 9))
        if (one.character, one.clip.name) == ("walker", "walk")
        else one
        for one in found
    ]
    cases, notes = recorded_cases(cut)
    assert {c.motion for c in cases} == {"squat", "wave"}
    assert len(notes) == 1
    assert "walk: 2 pairs" in notes[0]
    assert "walk: " in notes[0]


def test_the_same_body_twice_is_both_structures_and_copy_is_right(
    tmp_path: Path, tree: Path
) -> None:
    """A motion on two bodies that are one: copy makes no error on it, nor on its split twin."""
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        bvh = read_bvh(tree / "walker" / "walk.bvh")
        # Other names, so that the files differ.
        joints = tuple(replace(j, name=f"{name}_{j.name}") for j in bvh.joints)
        write_bvh(replace(bvh, joints=joints), tmp_path / name / "walk.bvh")
    cases, _ = recorded_cases(performances(tmp_path))
    assert sorted(c.structure for c in cases) == ["cross", "cross", "intra", "intra"]
    row = evaluate("copy", as_method(transfer), [c for c in cases if c.structure == "intra"])
    assert row.mean("intra").mse < 1e-12
    # A tool's results know no split targets.
    assert math.isnan(row.mean("cross").mse)
    table = markdown([evaluate("copy", as_method(transfer), cases), replace(row, name="results")])
    assert re.search(r"^\| results \| \S+ \| - \|$", table, re.M)
    split = next(c for c in cases if c.structure == "cross")
    assert split.answer is None
    assert len(split.truth.rig.skeleton) > len(split.source.rig.skeleton)


def test_results_of_another_tool(tree: Path, found: list[Performance], tmp_path: Path) -> None:
    """The truth itself has no error; moved by a tenth of the height along one axis, 0.01 / 3."""
    cases = [c for c in recorded_cases(found)[0] if c.answer is not None]
    assert len(cases) == 6
    few = [c for c in recorded_cases(found, seed=1, limit=2)[0] if c.answer is not None]
    assert len(few) == 2, "of the one cell that a folder has"
    pairs = [{(c.motion, c.performer, c.target) for c in some} for some in (few, cases)]
    assert pairs[0] < pairs[1]
    right, moved = tmp_path / "right", tmp_path / "moved"
    for case in cases:
        truth = tree / case.target / f"{case.motion}.bvh"
        for folder in (right, moved):
            place = folder / case.target / case.performer / f"{case.motion}.bvh"
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(truth, place)
    perfect = evaluate("right", results_in(right), cases).mean("cross")
    assert perfect.mse < 1e-9
    assert perfect.foot_speed == pytest.approx(perfect.truth_foot_speed, abs=1e-4)

    case = cases[0]
    assert case.answer is not None
    path = moved / case.target / case.performer / f"{case.motion}.bvh"
    clip = spark_sim.load(path)
    assert clip.motion.skeleton.parents[0] == -1
    bvh = read_bvh(path)
    values = bvh.values.copy()
    unit = clip.recording.convention.unit_m
    values[:, 0] += 0.1 * case.height * case.answer.clip.body.rig.hip_height / unit
    write_bvh(replace(bvh, values=values), path)
    assert evaluate("moved", results_in(moved), [case]).mean("cross").mse == pytest.approx(
        0.01 / 3, rel=1e-4
    )

    path.unlink()
    with pytest.raises(FileFormatError, match="no such result"):
        results_in(moved)(case)
    other = next(p for p in tree.rglob("*.bvh") if p.parent.name != case.target)
    shutil.copy(other, path)
    with pytest.raises(FileFormatError, match=r"lacks the joints|frames at 30 fps"):
        results_in(moved)(case)


def test_made_answers_stand_where_copies_slide(found: list[Performance]) -> None:
    cases = made_cases(found, seed=3)
    assert [c.structure for c in cases] == ["intra", "cross", "missing"] * 6
    again = made_cases(found, seed=3)
    for one, other in zip(cases, again, strict=True):
        assert np.array_equal(one.truth.rotations, other.truth.rotations)
    assert {c.motion for c in made_cases(found, seed=3, limit=1)} <= {c.motion for c in cases}
    assert len(made_cases(found, seed=3, limit=1)) == 3
    walks = [c for c in cases if c.motion == "walk"]
    row = evaluate("copy", as_method(transfer), walks)
    for structure in ("intra", "cross", "missing"):
        mean = row.mean(structure)
        assert mean.mse > 0
        assert mean.truth_foot_speed < 0.7 * mean.foot_speed
    lacking = [c for c in cases if c.structure == "missing"]
    assert all((correspond(c.source.rig, c.truth.rig).unmatched >= 0).any() for c in lacking)
    # An intra-structural target has the same joints under the same names.
    for case in cases:
        same = case.truth.rig.skeleton.names == case.source.rig.skeleton.names
        assert same == (case.structure == "intra")
    feet = walks[0].truth.rig
    positions = canonical_positions(walks[0].truth)
    planted = planted_feet(feet, positions, 1 / 30)
    slow = speeds(positions[:, feet.contact_joints], 1 / 30)[planted]
    assert np.median(slow) < 0.02


def test_a_new_network_is_copy(found: list[Performance], tmp_path: Path) -> None:
    names = NameEncoder(NameConfig(width=16, heads=2, blocks=1))
    config = TrainConfig.of("tiny")
    torch.manual_seed(0)
    cases = made_cases(found, limit=2)
    bodies = distinct_trunks(body_features(case.truth.rig) for case in cases)
    checkpoint = Checkpoint(
        Spark(network(config, 16)), names, settings={"window": 32}, bodies=bodies
    )
    run = nets.learned(checkpoint, tmp_path)
    for held in (False, True):
        both = (as_method(method, feet_held=held) for method in (transfer, run))
        copy, new = (evaluate("", method, cases).mean("missing") for method in both)
        assert new.mse == pytest.approx(copy.mse, rel=1e-3)


def test_ignoring_the_source_is_seen(found: list[Performance]) -> None:
    """A method that always gives the T-pose has sensitivity 0; the truth has 1."""
    cases = made_cases(found)
    # All three motions of a body on one target.
    cases = [replace(c, target=c.performer, truth=_on(c, cases)) for c in cases]

    def still(case: Case) -> np.ndarray:
        rotations = np.zeros_like(case.truth.rotations)
        rotations[..., 0] = 1
        return canonical_positions(replace(case.truth, rotations=rotations))

    assert evaluate("still", still, cases).sensitivity["intra"] == pytest.approx(0, abs=1e-9)
    true = evaluate("true", lambda c: canonical_positions(c.truth), cases)
    assert true.sensitivity["intra"] == pytest.approx(1)


def _on(case: Case, cases: list[Case]) -> CanonicalMotion:
    """The case's motion on the first target that its performer and structure have."""
    same = (c for c in cases if (c.performer, c.structure) == (case.performer, case.structure))
    return transfer(case.source, next(same).truth.rig)


def test_sans_split_joints() -> None:
    body = body_features(sample_rig("dancer"))
    chosen = split_joints(body)
    assert chosen
    whole, split = same_body(body), split_body(body)
    names = split.body.skeleton.names
    assert len(names) == len(whole.body.skeleton.names) + len(chosen)
    rest, was = (v.body.skeleton.rest_positions for v in (split, whole))
    turned = split.rotations(np.random.default_rng(0).normal(size=(4, len(body.joints), 4)))
    for name in chosen:
        k, after = names.index(name), names.index(f"{name}_split")
        parent = split.body.skeleton.parents[k]
        before = whole.body.skeleton.names.index(name)
        np.testing.assert_allclose(rest[after], was[before], atol=1e-12)
        np.testing.assert_allclose(rest[k], (rest[parent] + rest[after]) / 2, atol=1e-12)
        np.testing.assert_array_equal(turned[:, k], turned[:, after])


SCORE = Score(1e-4, 5e-5, 2.0, 0.05, 0.01, 100.0, float("nan"))


def row(name: str, **settings: object) -> MethodScores:
    worse = replace(SCORE, mse=3e-4)
    cells = {("intra", "sc+sm"): CellScore(SCORE, 3), ("intra", "uc+um"): CellScore(worse, 1)}
    cells |= {("cross", "sc+sm"): CellScore(worse, 4)}
    nothing = float("nan")
    return MethodScores(name, cells, {"intra": 0.9, "cross": nothing, "missing": nothing}, settings)


def test_tables_by_hand() -> None:
    rows = [
        row("copy"),
        row("a", preset="paper", ablate=["mask"]),
        row("b", preset="paper", ablate=[]),
        row("c", preset="paper", ablate=["mix"]),
        row("d", preset="default", ablate=["mask"]),
    ]
    lines = markdown(rows).splitlines()
    assert lines[0] == "| MSE | intra sc+sm | intra uc+um | intra mean | cross sc+sm |"
    assert lines[2] == "| copy | 0.0001 | 0.0003 | 0.0002 | 0.0003 |"
    ablations = lines.index(next(line for line in lines if "preset" in line))
    assert lines[ablations + 2 : ablations + 4] == [
        "| w/o mask | 0.0002 | 0.0003 |  |  |",
        "| full | 0.0002 | 0.0003 | 0.0002 | 0.0003 |",
    ]
    assert "| 0.05 (0.01) | 100 (-) | 0.9 |" in markdown(rows)
    read = list(csv.DictReader(as_csv(rows).splitlines()))
    assert len(read) == 3 * len(rows)
    assert read[1]["method"] == "copy"
    assert float(read[1]["mse"]) == 3e-4
    assert read[1]["truth_jerk"] == ""
    records = json.loads(as_json(rows, {"data": "x"}))
    assert records["rows"][1]["training"] == {"preset": "paper", "ablate": ["mask"]}
    assert records["rows"][0]["cells"][0]["truth_jerk"] is None
    assert records["rows"][0]["sensitivity"] == {"intra": 0.9, "cross": None, "missing": None}


def test_command(tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = NameEncoder(NameConfig(width=16, heads=2, blocks=1))
    torch.manual_seed(0)
    new = Checkpoint(Spark(network(TrainConfig.of("tiny"), 16)), names, settings={"window": 32})
    old = replace(new, recorded={"trust": torch.ones(7)})
    for name, checkpoint in (("run", new), ("old", old)):
        (tmp_path / name).mkdir()
        save_checkpoint(checkpoint, tmp_path / name / "checkpoint.safetensors")
    outputs = [word for suffix in ("md", "json", "csv") for word in ("-o", f"t.{suffix}")]
    command = [sys.executable, "-m", "spark_sim", "evaluate", tree, "--checkpoint", "run", *outputs]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    rows = [line.split("|")[1].strip() for line in done.stdout.splitlines()[2:10]]
    of_run = ["run", "run, target prior", "run, as retarget"]
    fitted = ["copy, legs fitted", "copy, legs fitted, feet held"]
    assert rows == ["copy", "copy, feet held", "copy, target prior", *fitted, *of_run]
    assert (tmp_path / "t.md").read_text() == done.stdout
    assert json.loads((tmp_path / "t.json").read_text())["data"] == str(tree)
    assert (tmp_path / "t.csv").read_text().startswith("method,")
    monkeypatch.setattr(console, "note", lambda text: None)
    for args, reason in (
        ((tree, "-o", "t.md"), "exists"),
        ((tree, "-o", "t.txt"), "written as .md, .json or .csv"),
        ((tree / "walker",), "no motion is on two characters"),
        ((tree, "--result", "mine"), "expected NAME=DIR"),
        ((tree, "--result", f"mine={tmp_path}"), "no such result"),
        ((tree, "--result", f"mine={tree}", "--made"), "--result goes with"),
        ((tree, "--limit", "0", "--made"), "--limit 0"),
        ((tree, "--checkpoint", "t.csv"), "no safetensors"),
        ((tree, *("--checkpoint", "run") * 2), "two are called 'run'"),
        (("nowhere", "--checkpoint", "old"), "of an older spark-sim"),  # before anything is read
        (("nowhere",), "nowhere"),
    ):
        parsed = cli.parse(["evaluate", *map(str, args)])
        with pytest.raises(SparkSimError, match=re.escape(reason)):
            parsed.run(parsed)
