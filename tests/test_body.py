"""MuJoCo bodies: they are the rig, they stand on their soles, and MuJoCo steps them."""

import mujoco
import numpy as np
import pytest
from conftest import DATA, recordings
from humanoids import ONE_A_RIG

from sim.body import build_body
from sim.mjcf import write_mjcf
from sim.pose import qpos_from_motion
from spark.canonical import from_canonical, to_canonical
from spark.errors import SkeletonError
from spark.kinematics import forward
from spark.motion import Motion
from spark.recording import read_recording
from spark.rig import Rig, understand
from spark.sample import BUILDS, sample_motion, sample_rig


def rigid(path: object) -> tuple[Motion, Rig]:
    """A recording without what its file stretches."""
    motion = read_recording(str(path)).motion
    rig = understand(motion)
    return from_canonical(to_canonical(motion, rig)), rig


def worst_error(model: mujoco.MjModel, motion: Motion, rig: Rig) -> float:
    """The largest distance [m] between MuJoCo's bodies and our joints over the whole clip."""
    data = mujoco.MjData(model)
    joints = list(rig.skeleton.subtree(rig.carrier))
    bodies = [model.body(rig.skeleton.names[j]).id for j in joints]
    positions, _ = forward(motion)
    worst = 0.0
    for qpos, expected in zip(qpos_from_motion(model, motion, rig), positions, strict=True):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        worst = max(worst, float(np.abs(data.xpos[bodies] - expected[joints]).max()))
    return worst


@pytest.mark.parametrize("path", recordings(*ONE_A_RIG))
def test_mujoco_agrees_with_our_kinematics(path: object, tmp_path: object) -> None:
    motion, rig = rigid(path)
    written, _ = write_mjcf(rig, tmp_path / "body.xml")  # type: ignore[operator]
    model = mujoco.MjModel.from_xml_path(str(written))
    assert worst_error(model, motion, rig) < 1e-6


def test_the_comparison_sees_a_wrong_bone() -> None:
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 10.0)
    spec = build_body(rig)
    spec.body(rig.skeleton.names[3]).pos = rig.skeleton.offsets[3] + [0, 0, 1e-4]
    assert worst_error(spec.compile(), motion, rig) > 5e-5


@pytest.mark.parametrize("path", recordings(*ONE_A_RIG))
def test_bodies_stand_on_their_soles_and_step(path: object, tmp_path: object) -> None:
    _, rig = rigid(path)
    _, scene = write_mjcf(rig, tmp_path / "body.xml")  # type: ignore[operator]
    model = mujoco.MjModel.from_xml_path(str(scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("tpose").id)
    mujoco.mj_kinematics(model, data)
    boxes = np.flatnonzero(model.geom_type == int(mujoco.mjtGeom.mjGEOM_BOX))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    lowest = min(
        (data.geom_xpos[g] + (corners * model.geom_size[g]) @ data.geom_xmat[g].reshape(3, 3).T)[
            :, 2
        ].min()
        for g in boxes
    )
    assert abs(lowest) < 1e-6
    rng = np.random.default_rng(0)
    while data.time < 1.0:
        data.ctrl[:] = rng.uniform(-0.3, 0.3, model.nu)
        mujoco.mj_step(model, data)
    assert not [w.number for w in data.warning if w.number]
    assert np.isfinite(data.qpos).all()


@pytest.mark.parametrize("build", BUILDS)
def test_mass(build: str) -> None:
    rig = sample_rig(build)
    given = build_body(rig, mass=50.0).compile()
    assert given.body_mass.sum() == pytest.approx(50.0, rel=1e-3)
    free = build_body(rig).compile()
    assert free.body_mass.sum() == pytest.approx(22 * BUILDS[build].height ** 2, rel=0.1)
    with pytest.raises(SkeletonError, match="mass is -1"):
        build_body(rig, mass=-1.0)


def test_a_static_root_is_no_body() -> None:
    if not DATA.exists():
        pytest.skip("zoo/m2m_human.bvh: no recordings beside the checkout")
    _, rig = rigid(DATA / "zoo/m2m_human.bvh")
    model = build_body(rig).compile()
    names = {model.body(b).name for b in range(model.nbody)}
    assert "root" not in names
    assert "DEF-hips" in names
