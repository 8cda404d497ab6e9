"""Left and right of a robot are told apart by where they are, and tinted."""

from dataclasses import replace

import numpy as np

import spark_sim
from sim.view.figure import Figure
from sim.view.sides import LEFT, RIGHT, tinted, tints
from sim.view.staging import build_scene


def test_limbs_are_tinted_by_their_side_and_the_trunk_is_not() -> None:
    body = spark_sim.load("ember").body
    assert body is not None
    model = body.model
    inside = range(body.root, model.nbody)
    found = tints(body, inside)
    for b in inside:
        name = model.body(b).name
        side = next((rgb for word, rgb in (("left", LEFT), ("right", RIGHT)) if word in name), None)
        tint = found.get(b)
        assert (None if tint is None else tuple(tint)) == side, name
    assert len(found) >= 20


def test_without_a_tpose_nothing_is_tinted() -> None:
    body = spark_sim.load("ember").body
    assert body is not None
    assert tints(replace(body, tpose=None), range(body.root, body.model.nbody)) == {}


def test_a_scene_shows_the_tints_and_a_ghost_keeps_its_colour() -> None:
    clip = spark_sim.load("ember")
    (figure,) = clip.figures()
    scene = build_scene([figure, Figure(figure.subject, "ghost", ghost=True)])
    solid, ghost = (
        scene.model.geom_rgba[np.isin(scene.model.geom_bodyid, placement.bodies)]
        for placement in scene.placements
    )
    warmth = solid[:, 0] - solid[:, 2]
    assert (warmth > 0.1).sum() > 5
    assert (warmth < -0.1).sum() > 5
    assert len(np.unique(ghost, axis=0)) == 1


def test_a_tint_keeps_light_and_dark() -> None:
    dark, light = (tinted(np.array([v, v, v, 0.5]), np.array(LEFT)) for v in (0.1, 0.9))
    assert (dark[:3] < light[:3]).all()
    assert dark[3] == light[3] == 0.5
    assert (tinted(dark, None) == dark).all()
