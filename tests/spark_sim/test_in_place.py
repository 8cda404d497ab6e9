"""Simulations of who walks in place: over the ground, as no floor goes backwards."""

from pathlib import Path

import numpy as np

import spark_sim
from spark.demo.sample import sample_motion, sample_rig
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new


def test_a_character_that_walks_in_place_goes_on_in_simulation(tmp_path: Path) -> None:
    walk = sample_motion("walk", sample_rig("walker"), 30.0)
    ahead = walk.root_pos[-1] - walk.root_pos[0]
    path = tmp_path / "in_place.bvh"
    write_bvh(encode_new(walk.moved(-np.linspace(0, 1, len(walk))[:, None] * ahead)), path)
    clip = spark_sim.load(path)
    seen = spark_sim.simulate(clip, assist=True)
    went = seen.tracked.target.qpos[-1, :2] - seen.tracked.target.qpos[0, :2]
    np.testing.assert_allclose(went, ahead[:2], atol=0.15)
    assert any("walks in place" in note for note in seen.notes)
