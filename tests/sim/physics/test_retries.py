"""Falls that are taken back."""

import numpy as np
import pytest

from sim.interpolate import velocities
from sim.physics.balance import Balancer
from sim.physics.retries import BACK, Retries
from sim.physics.servos import servo_model, servo_spec
from sim.physics.simulation import Simulation
from sim.physics.summary import render, summarize
from sim.physics.tracking import track
from sim.trajectory import ModelTrajectory, model_trajectory
from spark.rotation import quat_from_rotvec, quat_mul
from tests.helpers.stick import standing, stick_rig

FPS, HEIGHT, STEPS = 50.0, 1.7, 10
UNIT = np.sqrt(HEIGHT / 9.81)  # [s] in which the body tips over


def stick(frames: int, lean: float = 0.0) -> ModelTrajectory:
    """The stick man, standing, and leaning forwards [rad]."""
    rig = stick_rig()
    body = model_trajectory(rig, standing(rig, frames, FPS))
    body.qpos[:, 3:7] = quat_mul(quat_from_rotvec(np.array([0.0, lean, 0.0])), body.qpos[:, 3:7])
    return body


def balanced(body: ModelTrajectory) -> Simulation:
    spec, _ = servo_spec(body, height=HEIGHT, floor_z=0.0, own=True)
    model = servo_model(spec)
    speeds = velocities(model, body.qpos, 1 / FPS)
    balancer = Balancer(spec, model, 1, body.qpos, speeds, {}, 1 / FPS, HEIGHT)
    return Simulation(model, 1, HEIGHT, body.qpos, speeds[0], None, balancer)


def advance(simulation: Simulation, body: ModelTrajectory, start: int, stop: int) -> None:
    for t in range(start, stop):
        wanted = np.tile(body.qpos[t], (STEPS, 1))
        simulation.advance(t, wanted, np.zeros((STEPS, simulation.model.nv)))


def test_a_try_goes_on_from_the_very_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same seed leads where it led before, to the bit; another does not."""
    monkeypatch.setattr("sim.physics.balance.SAMPLES", 4)
    body = stick(40, lean=0.1)
    simulation = balanced(body)
    advance(simulation, body, 1, 7)
    moment = simulation.moment()
    found = []
    for seed in (1, 1, 2):
        simulation.go_back(moment, seed)
        advance(simulation, body, 7, 20)
        found.append(simulation.rollout.qpos[:20].copy())
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0][:7], found[2][:7])
    assert np.abs(found[0] - found[2]).max() > 1e-6


def test_tries_begin_earlier_and_earlier_and_end() -> None:
    body = stick(2)
    simulation = balanced(body)
    retries = Retries(1 / FPS, HEIGHT)
    for t in range(300):
        retries.keep(t, simulation)
    begun = [retries.go_back(300, simulation) for _ in BACK]
    away = [(300 - frame) / FPS / UNIT for frame in begun if frame is not None]
    assert len(away) == len(BACK)
    assert away == sorted(away)
    np.testing.assert_allclose(away, BACK, atol=0.4)  # moments are kept now and then
    assert retries.go_back(301, simulation) is None
    assert retries.falls == [300] * len(BACK)
    later = 300 + round(3 * UNIT * FPS)
    retries.keep(later, simulation)  # it stays up until then
    assert retries.go_back(later + 1, simulation) is not None


def test_no_fall_is_taken_back_to_before_the_beginning() -> None:
    simulation, retries = balanced(stick(2)), Retries(1 / FPS, HEIGHT)
    retries.keep(0, simulation)
    assert retries.go_back(3, simulation) == 0


def test_what_no_try_keeps_up_falls_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing holds a body that leans as far as this."""
    monkeypatch.setattr("sim.physics.balance.SAMPLES", 4)
    monkeypatch.setattr("sim.physics.retries.BACK", (1.0, 2.0))
    tracked = track(stick(45, lean=0.9), 1 / FPS, height=HEIGHT, balance=True)
    found = summarize(tracked)
    assert found["verdict"] == "falls"
    assert len(found["taken_back_s"]) == 2
    assert tracked.rollout.fallen[-1]
    assert "2 falls were taken back" in render(found, "x")
    alone = summarize(track(stick(45, lean=0.9), 1 / FPS, height=HEIGHT))
    assert alone["taken_back_s"] == []
    assert "taken back" not in render(alone, "x")
