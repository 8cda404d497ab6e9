"""How far a pelvis bows in one frame, against what whole clips say of it."""

import numpy as np
import pytest

from robots.model.known import known
from robots.solver.trunk import THIGHS, bends, bowing
from robots.stream.bowing import Bowing
from spark.demo.sample import sample_rig
from spark.kinematics import world_positions
from spark.rig.directions import hips_to_shoulders
from spark.rotation import matrix_from_quat, quat_conj, quat_from_rotvec, quat_mul

RIG = sample_rig("walker")


@pytest.mark.parametrize("stiff", [False, True])
@pytest.mark.parametrize("most", [0.15, 2.0])
def test_one_frame_bows_as_a_clip_does(
    stiff: bool, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All joints turn by up to `most` [rad] from the T-pose: in small turns nothing gives way."""
    robot = known("robot")
    assert bends(robot)
    for module in ("robots.solver.trunk", "robots.stream.bowing"):
        monkeypatch.setattr(f"{module}.bends", lambda _: not stiff)
    rng = np.random.default_rng(5)
    local = quat_from_rotvec(rng.uniform(-most, most, (40, len(RIG.skeleton), 3)) / 2)
    world = quat_mul(local, RIG.tpose)
    positions = world_positions(RIG.skeleton, world, np.zeros((40, 3)))
    pelvis = quat_mul(world[:, RIG.pelvis], quat_conj(RIG.tpose[RIG.pelvis]))
    floor = float(positions[..., 2].min())
    wanted = matrix_from_quat(bowing(RIG, robot, pelvis, positions, floor))
    along, own = hips_to_shoulders(RIG, positions), Bowing(RIG, robot, floor)
    ends = [(RIG.roles.require(a), RIG.roles.require(b)) for a, b in THIGHS.items()]
    for t, turned in enumerate(matrix_from_quat(pelvis)):
        thighs = np.array([positions[t, b] - positions[t, a] for a, b in ends])
        found = own.of(turned, along[t], thighs, positions[t])
        np.testing.assert_allclose(found, wanted[t], atol=1e-7)
    changed = np.abs(wanted - matrix_from_quat(pelvis)).max(axis=(1, 2)) > 1e-6
    assert changed.any() == (stiff or most > 1)
