"""Stated ground under the figures of a scene."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from sim.trajectory import Subject
from sim.view.figure import Figure
from sim.view.staging import build_scene
from spark.demo.sample import sample_motion, sample_rig
from spark.terrain import Terrain
from tests.helpers.grounds import box

STAND = box((-1.0, -2.0, 0.0), (1.0, 1.0, 0.4))
SHEET = Terrain(
    np.array([[-1.0, -1.0, 0.1], [1.0, -1.0, 0.1], [1.0, 1.0, 0.1], [-1.0, 1.0, 0.1]]),
    np.array([[0, 1, 2], [0, 2, 3]]),
)


def on(terrain: Terrain | None) -> Figure:
    rig = sample_rig("walker")
    return Figure(Subject(sample_motion("wave", rig, 30.0), rig, terrain=terrain), "a")


def test_grounds_stand_side_by_side() -> None:
    placements = build_scene([on(STAND), on(STAND), on(None)]).placements
    first, second, _ = (placement.to_scene(STAND.vertices)[:, 1] for placement in placements)
    assert first.max() < second.min()
    assert second.max() < placements[2].lane


def test_a_ghost_and_grounds_that_go_on_and_on_take_no_room() -> None:
    wide = replace(STAND, vertices=100 * STAND.vertices)
    ghost, alone, far = (
        build_scene([on(ground), other]).placements
        for ground, other in (
            (STAND, replace(on(STAND), ghost=True)),
            (None, on(None)),
            (wide, on(wide)),
        )
    )
    assert ghost[0].lane == ghost[1].lane
    apart = [abs(each[1].lane - each[0].lane) for each in (alone, far)]
    assert apart[1] == pytest.approx(apart[0] + 3 * far[0].height)


@pytest.mark.parametrize("ground", [SHEET, STAND])
@pytest.mark.parametrize("turned", [False, True])
def test_ground_is_seen_from_outside_whichever_way_its_triangles_turn(
    ground: Terrain, turned: bool
) -> None:
    """A box, and a sheet without volume."""
    faces = ground.faces[:, ::-1] if turned else ground.faces
    model = build_scene([on(replace(ground, faces=faces))]).model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    turn = data.geom_xmat[model.geom_dataid == 0][0].reshape(3, 3)
    corners = model.mesh_vert[model.mesh_face[model.mesh_faceadr[0] :]].astype(float) @ turn.T
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = corners.mean(axis=1) if ground is STAND else [0.0, 0.0, 1.0]
    assert (np.sum(normals * outward, axis=1) > 0).all()
