"""Robots whose feet are wide don't stand in their own feet."""

from pathlib import Path

import numpy as np
import pytest

from robots.solver.footprints import FootPlan, plan_feet
from robots.solver.solve import retarget
from robots.solver.stance import apart
from robots.solver.targets import targets_of
from sim.report.derivatives import derivative
from spark.demo.sample import sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.transfer.canonical import CanonicalMotion
from tests.helpers.ember import changed_ember

FRAME_TIME = 1 / 30
WIDTH = 0.116  # [m] of a foot; the source's stand 9 cm from each other


@pytest.fixture(scope="module")
def narrow() -> CanonicalMotion:
    """Legs close to each other; the body sways by 7 mm."""
    rig = sample_rig("walker")
    still = np.zeros(120)
    sway = 0.01 * np.sin(np.pi * FRAME_TIME * np.arange(len(still)))
    rotations = np.tile([1.0, 0, 0, 0], (len(still), len(rig.skeleton), 1))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        leg, foot = (
            list(rig.skeleton.subtree(rig.roles.require(Role(f"{side}_{part}"))))
            for part in ("upper_leg", "foot")
        )
        inward = np.stack([sway - 0.05 * sign, still, still], axis=1)
        rotations[:, leg] = quat_from_rotvec(inward)[:, None]
        rotations[:, foot] = [1.0, 0, 0, 0]
    height = rig.hip_height * np.cos(sway) * np.cos(0.05)
    hips = np.stack([still, rig.hip_height * np.sin(sway), height], axis=1)
    return CanonicalMotion(rig, FRAME_TIME, rotations, hips, 0.0)


def corners(plan: FootPlan) -> np.ndarray:
    """[T P 2] of its footprints [m], as complex numbers turn and shift them."""
    flat, prints = plan.flat, plan.prints
    placed = np.exp(1j * prints[:, 2:]) * (flat[:, 0] + 1j * flat[:, 1])
    placed = placed + prints[:, :1] + 1j * prints[:, 1:2]
    return np.stack([placed.real, placed.imag], axis=-1)


def test_wide_feet_stand_apart_and_the_body_is_calm(
    narrow: CanonicalMotion, tmp_path: Path
) -> None:
    wide = changed_ember(tmp_path, 'size="0.1 0.038 0.011"', f'size="0.1 {WIDTH / 2} 0.011"')
    plans = plan_feet(wide, targets_of(narrow, wide))
    left, right = (corners(plan) for plan in plans)
    assert (left[..., 1].min(axis=1) < right[..., 1].max(axis=1)).all()
    middle = sum(plan.prints for plan in plans)
    parted = apart(plans)
    left, right = (corners(plan) for plan in parted)
    np.testing.assert_allclose(
        left[..., 1].min(axis=1) - right[..., 1].max(axis=1), 0.005, atol=2e-3
    )
    np.testing.assert_allclose(sum(plan.prints for plan in parted), middle, atol=1e-9)
    pelvis = retarget(narrow, wide).qpos[:, :3]
    thrown = np.linalg.norm(derivative(pelvis, FRAME_TIME, 2, 0.05), axis=1)
    assert np.percentile(thrown, 99) < 0.1  # [m/s²]: as the source's


def test_feet_that_are_apart_stay(narrow: CanonicalMotion, tmp_path: Path) -> None:
    ember = changed_ember(tmp_path, "<mujoco", "<mujoco")
    plans = plan_feet(ember, targets_of(narrow, ember))
    for plan, parted in zip(plans, apart(plans), strict=True):
        np.testing.assert_array_equal(parted.prints, plan.prints)
    assert apart(plans[:1])[0] is plans[0]
