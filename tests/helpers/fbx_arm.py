"""An arm of two bones in a box of skin, in an FBX file, and where our joints carry the skin."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from spark.io.fbx_skin import FbxSkin, HungMesh, read_fbx_skin
from spark.kinematics import forward
from spark.rotation import quat_rotate
from spark_sim import Clip
from tests.helpers.fbx_text import Fbx, Mesh, Node, Take

BOX = np.array([[x, y, z] for x in (-5.0, 5) for y in (0.0, 40) for z in (-5.0, 5)])
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def png(colour: tuple[int, int, int] = (200, 30, 30)) -> bytes:
    file = BytesIO()
    Image.new("RGB", (8, 8), colour).save(file, "PNG")
    return file.getvalue()


def moved(x: float, y: float, z: float, turn: float = 0.0) -> np.ndarray:
    """A 4x4 matrix that turns about z [degrees] and moves."""
    out = np.eye(4)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    out[:2, :2] = [[c, -s], [s, c]]
    out[:3, 3] = x, y, z
    return out


def arm(**changed: Any) -> Fbx:
    """Two bones of a bent arm and a box that was bound when it was straight: half of it hangs on
    each, the middle on both."""
    nodes = [
        Node("Hips", translation=(0, 90, 0)),
        Node("Arm", 0, (10, 0, 0), rotation=(0, 0, 30)),
        Node("Fore", 1, (0, 20, 0), rotation=(0, 0, 40)),
        Node("box", kind="Mesh"),
    ]
    low, high = {0: 1.0, 1: 1.0, 4: 1.0, 5: 0.5}, {2: 1.0, 3: 1.0, 6: 1.0, 7: 1.0, 5: 0.5}
    # When it was bound, the arm stood straight up from (10, 90, 0), and the box on its start.
    clusters = [(1, moved(0, 0, 0), low), (2, moved(0, -20, 0), high)]
    uv = (BOX[:, :2] - [-5, 0]) / [10, 40]
    mesh = Mesh(3, BOX, SIDES, clusters, uv=uv, **changed)
    turning = Take("turn", 2, "Z", times=(0.0, 0.5, 1.0), angles=(40.0, 80.0, 10.0))
    return Fbx(nodes, [turning], meshes=[mesh])


def skin_of(path: Path) -> FbxSkin:
    skin = read_fbx_skin(path)
    assert skin is not None
    return skin


def placed(skin: FbxSkin, mesh: HungMesh, clip: Clip) -> np.ndarray:
    """Where a mesh's vertices are over time [m], by linear blend skinning of our joints."""
    convention = clip.recording.convention
    positions, world = forward(clip.motion)
    out = np.zeros((len(positions), len(mesh.vertices), 3))
    for b, joint in enumerate(mesh.joints):
        j = clip.joint_names.index(joint)
        at_rest = mesh.vertices @ mesh.to_rest[b, :3, :3].T + mesh.to_rest[b, :3, 3]
        away = convention.from_file(at_rest - skin.rest[joint])
        there = positions[:, j, None] + quat_rotate(world[:, j, None], away[None])
        out += np.where(mesh.bones_of == b, mesh.weights, 0).sum(axis=1)[:, None] * there
    return out
