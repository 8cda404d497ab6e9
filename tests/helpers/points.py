"""The points that a file of positions alone holds of a person who moves."""

import numpy as np

from spark.io.position_layouts import Layout
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import understand
from spark.rotation import quat_rotate
from spark.transfer.analytic import transfer
from spark.transfer.canonical import from_canonical, to_canonical
from tests.helpers.smpl import model_rig


def as_person(motion: Motion) -> Motion:
    """The motion on a body with the mean proportions, 1.74 m tall."""
    return from_canonical(transfer(to_canonical(motion, understand(motion)), model_rig(52, 1.74)))


def points_of(layout: Layout, person: Motion) -> np.ndarray:
    """Where the points of a layout are (T J 3): each fixed to the nearest joint above it."""
    positions, world = forward(person)
    names = person.skeleton.names
    rest = model_rig(52, 1.74).tpose_positions
    found = []
    for name in layout.points:
        place = layout.tpose[name] - np.array([0, 0, 0.075])  # our pelvis lies above the hips
        near = int(np.argmin(np.linalg.norm(rest - place, axis=1)))
        if np.linalg.norm(rest[near] - place) > 1e-9 and place[2] > 0.55:
            near = names.index("head")
        elif np.linalg.norm(rest[near] - place) > 1e-9 and place[2] < -0.8:
            near = names.index("left_ankle" if place[1] > 0 else "right_ankle")
        offset = np.broadcast_to(place - rest[near], (len(person), 3))
        found.append(positions[:, near] + quat_rotate(world[:, near], offset))
    return np.stack(found, axis=1)
