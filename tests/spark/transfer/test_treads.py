"""Where feet stand above the floor: told from the push under them, and from nothing else."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import spark_sim
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.feet import lowest_points
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.transfer.analytic import transfer
from spark.transfer.canonical import (
    at_frame_time,
    canonical_positions,
    from_canonical,
    to_canonical,
)
from spark.transfer.foot_lock import lock_feet
from spark.transfer.treads import feet_by_side, treads_of
from tests.helpers.box import BOX, RIG, at, onto_box
from tests.helpers.recordings import recordings
from tests.helpers.stick import joint, stick_rig

FOOT = 0.12 * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])  # [m] around its middle


def test_who_stands_on_a_box_does_so_at_its_height() -> None:
    treads = treads_of(onto_box())
    assert treads.top == pytest.approx(BOX, abs=1e-9)
    for t, height in ((30, 0.0), (120, BOX), (230, 0.0)):
        assert treads.stands[t].all()
        np.testing.assert_allclose(treads.heights[t], height, atol=1e-9)
    # On the way, by as much of it as the feet have gone.
    half = 0.5 * (onto_box().hips[:, 0].max())
    t = np.abs(onto_box().hips[:120, 0] - half).argmin()
    np.testing.assert_allclose(treads.heights[t], BOX / 2, atol=0.05)


@pytest.mark.parametrize("turned", [False, True])
def test_a_clip_that_ends_on_the_way_down_has_the_floor_below(turned: bool) -> None:
    """Or begins on the way up: no foot steps there on the air."""
    down = onto_box().frames(0, 172)  # 0.13 s before it lands
    if turned:
        down = replace(down, hips=down.hips[::-1])
    treads = treads_of(down)
    end = 0 if turned else -1
    np.testing.assert_allclose(treads.heights[end], 0.0, atol=1e-9)
    np.testing.assert_allclose(treads.heights.max(), BOX, atol=1e-9)
    assert not treads.stands[end].any()


def test_what_is_no_higher_than_floors_are_off_is_no_step() -> None:
    assert treads_of(onto_box(0.08)).level
    assert not treads_of(onto_box(0.15)).level


def test_a_level_floor_is_level() -> None:
    for name in ("walk", "squat", "wave"):
        rig = sample_rig("dancer")
        assert treads_of(to_canonical(sample_motion(name, rig, 60.0), rig)).level, name


def test_a_foot_that_is_held_up_stands_nowhere() -> None:
    """Two seconds on the right leg, the left thigh raised by 60 degrees, its foot still."""
    clip = at(np.zeros(300), np.zeros(300))
    share = np.interp(np.arange(300) / 60, [1.0, 1.5, 3.5, 4.0], [0.0, 1.0, 1.0, 0.0])
    raised = quat_from_rotvec(np.column_stack([0 * share, -np.radians(60) * share, 0 * share]))
    rotations = clip.rotations.copy()
    hip = RIG.roles.require(Role.LEFT_UPPER_LEG)
    for j in RIG.skeleton.subtree(hip):
        rotations[:, j] = quat_mul(raised, rotations[:, j])
    hips = clip.hips - [[0.0, RIG.tpose_positions[RIG.hips, 1].max(), 0.0]]
    balanced = replace(clip, rotations=rotations, hips=hips)
    assert treads_of(balanced).level


def test_a_foot_that_is_held_beside_the_other_stands_nowhere() -> None:
    """Two seconds on the right leg, the left foot still beside its shank, and the trunk bent so far
    that, weighing as people do, the body would rather be over the left: robots weigh otherwise."""
    clip = at(np.zeros(300), np.zeros(300))
    share = np.interp(np.arange(300) / 60, [1.0, 1.5, 3.5, 4.0], [0.0, 1.0, 1.0, 0.0])
    rotations = clip.rotations.copy()
    turns = {
        Role.LEFT_UPPER_LEG: [0.0, -45, 0],
        Role.LEFT_LOWER_LEG: [0.0, 90, 0],
        Role.SPINE: [-27, 0.0, 0],
    }
    for role, degrees in turns.items():
        bent = quat_from_rotvec(np.outer(share, np.radians(degrees)))
        for j in RIG.skeleton.subtree(RIG.roles.require(role)):
            rotations[:, j] = quat_mul(bent, rotations[:, j])
    assert treads_of(replace(clip, rotations=rotations)).level


def test_a_floor_that_drifts_is_no_stair() -> None:
    """Ten steps, each 3 cm higher than the last, as of a camera that loses its height."""
    time = np.arange(1200) / 60
    step = np.floor(time / 2) + np.clip((time % 2 - 1) / 0.4, 0.0, 1.0)
    assert treads_of(at(0.03 * step, 0.3 * step)).level
    assert treads_of(at(0.17 * step, 0.3 * step)).top == pytest.approx(10 * 0.17, abs=0.02)


def test_nobody_is_carried_by_feet_above_the_head() -> None:
    """A handstand that comes and goes: feet are still, far up, and over the centre of mass."""
    clip = at(np.zeros(300), np.zeros(300))
    share = np.interp(np.arange(300) / 60, [1.0, 1.5, 3.5, 4.0], [0.0, 1.0, 1.0, 0.0])
    over = quat_from_rotvec(np.column_stack([0 * share, np.pi * share, 0 * share]))
    rotations = quat_mul(over[:, None], clip.rotations)
    assert treads_of(replace(clip, rotations=rotations)).level


def top_of_boxes(folder: Path, points: np.ndarray) -> np.ndarray:
    """How high [m] the highest box is under points, by MuJoCo's rays; 0 beside them."""
    spec = mujoco.MjSpec()
    for path in sorted(folder.glob("box_models/*.obj")):
        spec.add_mesh(name=path.stem, file=str(path.resolve()))
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=path.stem)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    heights, geom = np.zeros(len(points)), np.zeros(1, dtype=np.int32)
    for k, point in enumerate(points):
        start, down = np.array([*point, 5.0]), np.array([0.0, 0.0, -1.0])
        distance = mujoco.mj_ray(model, data, start, down, None, 1, -1, geom, None)
        heights[k] = max(5.0 - distance, 0.0) if distance >= 0 else 0.0
    return heights


@pytest.mark.parametrize("path", recordings("terrain/*/*.npy"))
def test_boxes_are_found_where_they_were(path: Path) -> None:
    """Climbs over boxes that were measured: in 95 % of the time what was told is within 5 cm of the
    box under the foot, which may stand on its edge."""
    source = spark_sim.load(path).resampled(60.0).canonical
    treads = treads_of(source)
    found, true = [], []
    for k in range(treads.stands.shape[1]):
        frames = np.flatnonzero(treads.stands[:, k])[::10]
        found.append(treads.heights[frames, k])
        under = [top_of_boxes(path.parent, treads.ways[frames, k] + away) for away in FOOT]
        true.append(np.max(under, axis=0))
    told, boxes = np.concatenate(found), np.concatenate(true)
    assert (boxes > 0.1).mean() > 0.3
    assert (np.abs(told - boxes) < 0.05).mean() > 0.95


def test_a_character_stands_still_on_the_box() -> None:
    """Who squats on a box with still feet, on legs with longer thighs and shorter shanks: copied
    feet slide there, held ones don't, and are as high, scaled."""
    still, rig = onto_box(), stick_rig()
    offsets = rig.skeleton.offsets.copy()
    for side in ("left", "right"):
        offsets[joint(Role(f"{side}_lower_leg"))] = [0.0, 0.0, -0.5]
        offsets[joint(Role(f"{side}_foot"))] = [0.0, 0.0, -0.3]
    rig = replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))
    bend = 0.8 * np.sin(np.pi * np.clip((np.arange(240) - 95) / 50, 0.0, 1.0)) ** 2
    rotations = still.rotations.copy()
    for role, sign in (("upper_leg", -1.0), ("lower_leg", 1.0)):
        turn = quat_from_rotvec(np.column_stack([0 * bend, sign * bend, 0 * bend]))
        for side in ("left", "right"):
            rotations[:, RIG.roles.require(Role(f"{side}_{role}"))] = turn
    ankle = [RIG.roles.require(Role.LEFT_FOOT)]
    bent = replace(still, rotations=rotations)
    sunk = canonical_positions(still, ankle)[:, 0] - canonical_positions(bent, ankle)[:, 0]
    source = replace(bent, hips=bent.hips + sunk)
    scale, held = rig.hip_height / RIG.hip_height, lock_feet(source, transfer(source, rig))
    toes = canonical_positions(held, rig.contact_joints)[95:145]
    assert np.ptp(toes[..., :2], axis=0).max() < 0.005
    copied = canonical_positions(transfer(source, rig), rig.contact_joints)[95:145]
    assert np.ptp(copied[..., :2], axis=0).max() > 0.01
    world = quat_mul(held.rotations, rig.tpose)
    low = lowest_points(rig.soles, canonical_positions(held), world)[95:145]
    np.testing.assert_allclose(low, scale * BOX, atol=0.006)


@pytest.mark.parametrize("fps", [24.0, 120.0])
def test_the_rate_does_not_matter(fps: float) -> None:
    clip = onto_box()
    times = np.arange(0, 3.9, 0.05)
    there = [
        treads.heights[np.round(times / treads.frame_time).astype(int)]
        for treads in (treads_of(clip), treads_of(at_frame_time(clip, 1 / fps)))
    ]
    np.testing.assert_allclose(there[1], there[0], atol=0.03)


def test_contacts_are_on_the_box_as_well() -> None:
    stands = feet_by_side(RIG, from_canonical(onto_box()))
    for side in ("left", "right"):
        assert stands[side][[*range(5, 55), *range(95, 145), *range(185, 235)]].all()
        assert not stands[side][[75, 165]].any()
