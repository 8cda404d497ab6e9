"""The root wrench: against answers worked out by hand, and against MuJoCo's inverse dynamics."""

import mujoco
import numpy as np
import pytest

from sim.body.build import build_body
from sim.body.qpos import qpos_from_motion
from sim.report.clip_poses import pose_clip
from sim.report.mass import Mass
from sim.report.support import Support
from sim.report.thresholds import PLAUSIBILITY
from sim.report.wrench import angular_momentum, required_wrench, unexplained_wrench
from sim.trajectory import Subject
from spark.motion import Motion
from spark.rotation import quat_about, quat_from_rotvec, quat_mul
from tests.helpers.stick import standing, stick_rig

G = 9.81


def rod(path: np.ndarray, rotations: np.ndarray) -> Mass:
    """One body of unit mass with moments 1, 2, 3 m²."""
    return Mass(np.ones(1), np.diag([1.0, 2.0, 3.0])[None], path[:, None], rotations[:, None])


def test_the_momentum_of_a_spinning_body_is_inertia_times_rate() -> None:
    times = np.arange(200) / 1000
    tilt = quat_about("y", np.array(np.pi / 2))  # the body's X axis points down, Z along world X
    spin = quat_mul(quat_about("z", 2.0 * times), tilt)
    momentum = angular_momentum(rod(np.zeros((200, 3)), spin), 1e-3)
    # About world Z turns the body's X axis: its moment is 1.
    np.testing.assert_allclose(momentum[50:-50], [[0, 0, 2.0]] * 100, atol=1e-4)


def test_two_masses_on_a_turning_arm() -> None:
    # 1/4 and 3/4 of the mass, 4 m apart, turning at 0.5 rad/s: reduced mass 3/16, L = 3/16·16·0.5.
    angle = 0.5 * np.arange(100) / 1000
    arm = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    places = np.stack([0 * arm, 4 * arm], axis=1) + np.array([3.0, 1.0, 2.0])
    still = np.tile([1.0, 0, 0, 0], (100, 2, 1))
    parts = Mass(np.array([0.25, 0.75]), np.zeros((2, 3, 3)), places, still)
    momentum = angular_momentum(parts, 1e-3)
    np.testing.assert_allclose(momentum[1:-1], [[0, 0, 1.5]] * 98, atol=1e-6)


def test_the_floor_carries_the_weight_and_what_accelerates_it() -> None:
    times = np.arange(200) / 1000
    path = np.stack([2 * times**2, 0 * times, 0.5 * times**2], axis=-1)
    wrench = required_wrench(rod(path, np.tile([1.0, 0, 0, 0], (200, 1))), 1e-3, 0.01)
    expected = [4 / G, 0, (G + 1) / G, 0, 0, 0]
    np.testing.assert_allclose(wrench, [expected] * 200, atol=1e-6)


def test_required_wrench_is_the_root_of_mujocos_inverse_dynamics() -> None:
    rig = stick_rig()
    rng = np.random.default_rng(5)
    dt, frames = 1e-3, 80
    times = np.arange(frames)[:, None] * dt
    still = standing(rig, frames, 1 / dt)

    def wave(count: int, size: float) -> np.ndarray:
        return size * np.sin(times * rng.uniform(3, 9, count) + rng.uniform(0, 6, count))

    rotvecs = np.stack([wave(len(rig.skeleton), 0.4) for _ in range(3)], axis=-1)
    motion = Motion(rig.skeleton, dt, still.root_pos + wave(3, 0.2), quat_from_rotvec(rotvecs))
    poses = pose_clip(Subject(motion, rig))
    ours = required_wrench(poses.mass, dt, 0.004)

    model = build_body(rig).compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.dof_armature[:] = model.dof_damping[:] = model.jnt_stiffness[:] = 0
    data = mujoco.MjData(model)
    qpos = qpos_from_motion(model, motion, rig)
    velocity = np.zeros((frames, model.nv))
    for t in range(frames - 1):
        mujoco.mj_differentiatePos(model, velocity[t], dt, qpos[t], qpos[t + 1])
    weight = model.body_mass.sum() * G
    for t in range(20, 60):
        data.qpos[:] = qpos[t]
        data.qvel[:] = 0.5 * (velocity[t - 1] + velocity[t])
        data.qacc[:] = (velocity[t] - velocity[t - 1]) / dt
        mujoco.mj_inverse(model, data)
        force, torque_root = data.qfrc_inverse[:3], data.qfrc_inverse[3:6]
        root = data.xmat[1].reshape(3, 3)
        arm = data.xpos[1] - data.subtree_com[0]
        torque = root @ torque_root + np.cross(arm, force)
        np.testing.assert_allclose(ours[t, :3], force / weight, atol=0.01)
        np.testing.assert_allclose(ours[t, 3:], torque / weight, atol=0.005)


def residual(wrench: list[float], points: list[list[float]], length: float = 1.0) -> np.ndarray:
    touching = np.ones((1, len(points)), dtype=bool)
    return unexplained_wrench(
        np.array([wrench], dtype=float), np.array([points]), touching, 1.0, length
    )[0]


def test_a_body_over_its_feet_is_explained() -> None:
    corners = [[0.1, 0.1, -1.0], [0.1, -0.1, -1.0], [-0.1, 0.1, -1.0], [-0.1, -0.1, -1.0]]
    np.testing.assert_allclose(residual([0, 0, 1, 0, 0, 0], corners), 0, atol=1e-9)
    # Pushing off sideways with half the weight needs friction, and a torque that the feet can give.
    np.testing.assert_allclose(residual([0.05, 0, 1, 0, 0, 0], corners), 0, atol=1e-9)


def test_the_floor_cannot_pull() -> None:
    force, torque = residual([0, 0, -0.5, 0, 0, 0], [[0.0, 0.0, -1.0]])
    assert (force, torque) == (pytest.approx(0.5), pytest.approx(0))


def test_without_contact_all_is_unexplained() -> None:
    wrench = np.array([[0.3, 0.4, 0.0, 0.0, 0.0, 0.2]])
    nothing = unexplained_wrench(
        wrench, np.zeros((1, 1, 3)), np.zeros((1, 1), dtype=bool), 1.0, 2.0
    )
    np.testing.assert_allclose(nothing, [[0.5, 0.2]])


def test_the_least_squares_compromise_of_one_point_beside_the_centre_of_mass() -> None:
    # The point lies 0.3 m behind and 1 m below. The minimum of |f - e|² + |r x f|² solves
    # (2.09 I - r rᵀ) f = e: f = (0.3, 0, 2) / 2.09, inside the cone.
    f = np.array([0.3, 0.0, 2.0]) / 2.09
    r = np.array([-0.3, 0.0, -1.0])
    force, torque = residual([0, 0, 1, 0, 0, 0], [r.tolist()])
    assert force == pytest.approx(np.linalg.norm(f - [0, 0, 1]))
    assert torque == pytest.approx(np.linalg.norm(np.cross(r, f)))


def test_friction_ends_at_the_cone() -> None:
    # A point straight below, and a push sideways of twice the weight; torque counts for nothing on
    # a body as long as this. On the cone's edge f = s (1, 0, 1): s = 1.5 leaves (0.5, 0, -0.5).
    force, _ = residual([2, 0, 1, 0, 0, 0], [[0.0, 0.0, -1e-6]], length=1e3)
    assert force == pytest.approx(np.sqrt(0.5))


def swinging(com_y: float, heel_height: float, toe_speed: float) -> np.ndarray:
    """Which feet skate: one rests flat at y = 0, the other passes 1.5 cm over the floor at y = 0.4.

    The centre of mass hangs 0.9 m high at `com_y`.
    """
    corners = np.array([[x, y, 0.0] for x in (-0.05, 0.13, 0.2) for y in (-0.04, 0.04)])
    feet = np.concatenate([corners, corners + np.array([0.0, 0.4, 0.0])])
    heights = np.zeros(12)
    heights[6:] = [heel_height, heel_height, 0.015, 0.015, 0.015, 0.015]
    speeds = np.repeat([0.0, toe_speed], 6)
    support = Support(
        thresholds=PLAUSIBILITY,
        feet=("right foot",) * 6 + ("left foot",) * 6,
        heights=heights[None],
        speeds=speeds[None],
        arms=(feet - np.array([0.1, com_y, 0.9]))[None],
        touching=np.ones((1, 12), dtype=bool),
        resting=(speeds < 0.2)[None],
        wrench=np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]),
        static=np.ones(1, dtype=bool),
        whole=np.zeros(1, dtype=np.int64),
        length=1.0,
    )
    return support.skating()[0].reshape(2, 6).any(axis=1)


def test_a_foot_that_swings_by_low_does_not_skate() -> None:
    assert swinging(com_y=0.0, heel_height=0.08, toe_speed=1.2).tolist() == [False, False]


def test_a_foot_skates_when_the_body_stands_on_it() -> None:
    assert swinging(com_y=0.4, heel_height=0.08, toe_speed=1.2).tolist() == [False, True]


def test_a_foot_that_lies_flat_skates_whatever_stands_on_it() -> None:
    assert swinging(com_y=0.0, heel_height=0.02, toe_speed=1.2).tolist() == [False, True]


def test_a_foot_slower_than_the_threshold_does_not_skate() -> None:
    assert swinging(com_y=0.4, heel_height=0.0, toe_speed=0.19).tolist() == [False, False]
