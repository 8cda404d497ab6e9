"""A file that holds two bodies: each command that reads it says so."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.io.bvh import Bvh, read_bvh, write_bvh
from spark.io.bvh_hierarchy import BvhJoint
from tests.helpers.program import Program


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    folder: Path = tmp_path_factory.mktemp("two")
    spark_sim.sample(folder)
    write_bvh(twice(read_bvh(folder / "walker_walk.bvh")), folder / "two.bvh")
    with Program(folder) as running:
        yield running


def twice(one: Bvh) -> Bvh:
    """The body, and beside it another that does the same 2 m away, below one joint."""
    joints = [BvhJoint("World", -1, (0.0, 0.0, 0.0))]
    rows = []
    for name in "AB":
        start = len(joints)
        joints += [
            replace(joint, name=f"{name}:{joint.name}", parent=max(joint.parent + start, 0))
            for joint in one.joints
        ]
        joints[start] = replace(joints[start], parent=0)
        moved = one.values.copy()
        moved[:, one.joints[0].channels.index("Xposition")] += 200.0 * (name == "B")
        rows.append(moved)
    return Bvh(tuple(joints), one.frame_time, np.concatenate(rows, axis=1))


@pytest.mark.parametrize(
    "arguments",
    [
        ("inspect", "two.bvh"),
        ("retarget", "two.bvh", "--to", "dancer_wave.bvh", "--method", "copy", "-o", "a.bvh"),
        ("retarget", "dancer_wave.bvh", "--to", "two.bvh", "--method", "copy", "-o", "b.bvh"),
    ],
)
def test_it_is_said(program: Program, arguments: tuple[str, ...]) -> None:
    done = program(*arguments)
    assert done.code == 0, done.stderr
    said = " ".join(done.stderr.split())
    assert "the file holds several bodies: the one of 'A:" in said
    assert "and not 'B:" in said
