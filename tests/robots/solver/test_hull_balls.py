"""Balls stand for a mesh: they cover it, and bulge out of it by no more than they may."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from robots.solver.hull_balls import balls_in, hull_of

WEDGE = [
    (x, y * (0.02 + 0.03 * (x > 0)), z * (0.015 + 0.02 * (x > 0)))
    for x in (-0.1, 0.1)
    for y in (-1, 1)
    for z in (-1, 1)
]
"""Eight corners: a limb that is twice as thick at one end."""


def model_of(vertices: list[tuple[float, float, float]], **turned: str) -> mujoco.MjModel:
    points = " ".join(f"{x}" for vertex in vertices for x in vertex)
    place = " ".join(f'{name}="{value}"' for name, value in turned.items())
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="it" vertex="{points}"/></asset>'
        f'<worldbody><geom type="mesh" mesh="it" {place}/></worldbody></mujoco>'
    )


@pytest.mark.parametrize("turned", [{}, {"pos": "0.3 -0.1 0.8", "euler": "40 20 70"}])
def test_balls_cover_a_limb_and_hardly_bulge(turned: dict[str, str]) -> None:
    model = model_of(WEDGE, **turned)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = hull_of(model, data, 0)
    assert found is not None
    centres, radii = balls_in(found)
    assert 3 < len(radii) <= 24
    corners = model.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
    hull = ConvexHull(corners)
    bulge = (hull.equations @ np.column_stack([centres, np.ones(len(centres))]).T).max(0) + radii
    assert bulge.max() < 0.007
    a, b, c = corners[hull.simplices].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rng = np.random.default_rng(5)
    side = rng.choice(len(area), 4000, p=area / area.sum())
    shares = rng.dirichlet(np.ones(3), 4000)
    surface = np.einsum("nk,nki->ni", shares, np.stack([a, b, c], axis=1)[side])
    away = np.linalg.norm(surface[:, None] - centres, axis=2) - radii
    uncovered = away.min(axis=1)
    assert np.percentile(uncovered, 90) < 0.012
    assert uncovered.max() < 0.03  # at the sharp corners


def test_what_is_no_mesh_has_no_hull() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="box" size="0.1 0.1 0.1"/></worldbody></mujoco>'
    )
    assert hull_of(model, mujoco.MjData(model), 0) is None
