"""The rest pose of an FBX file: its skin's, where its nodes stand at some frame of a motion."""

from pathlib import Path

import numpy as np
import pytest

from spark.io.fbx import read_fbx
from spark.kinematics import forward
from tests.helpers.fbx_text import Fbx, Node, Take

# A limb of three bones of 40 cm that stands bent by a right angle, about the file's X.
BENT = [
    Node("Hips", translation=(0, 100, 0)),
    Node("Thigh", 0, translation=(0, -40, 0)),
    Node("Shank", 1, translation=(0, -40, 0), rotation=(90, 0, 0)),
    Node("Foot", 2, translation=(0, -40, 0)),
]
BENDS = Take("bends", node=2, axis="X", times=(0, 1), angles=(90, 20))


def written(path: Path, binds: list[tuple[float, float, float]]) -> Path:
    """The limb with a bind pose: where each node was then, with its axes as the world's."""
    rows = []
    for i, (x, y, z) in enumerate(binds):
        matrix = f"1,0,0,0, 0,1,0,0, 0,0,1,0, {x},{y},{z},1"
        rows.append(f"PoseNode: {{ Node: {100 + i}\nMatrix: *16 {{ a: {matrix} }} }}\n")
    pose = f'Pose: 9000, "Pose::B", "BindPose" {{ {"".join(rows)} }}\n'
    text = Fbx(BENT, [BENDS]).text()
    assert text.count("Objects: {") == 1
    path.write_text(text.replace("Objects: {", "Objects: {\n" + pose if binds else "Objects: {"))
    return path


STRAIGHT = [(0.0, 100.0 - 40 * i, 0.0) for i in range(4)]


def test_nodes_that_stand_bent_rest_as_the_skin_was_bound(tmp_path: Path) -> None:
    plain, bound = (read_fbx(written(tmp_path / "a.fbx", binds)).motion for binds in ([], STRAIGHT))
    np.testing.assert_allclose(forward(bound)[0], forward(plain)[0], atol=1e-9)
    np.testing.assert_allclose(bound.skeleton.rest_positions[:, 2], [1, 0.6, 0.2, -0.2], atol=1e-9)
    assert np.ptp(plain.skeleton.rest_positions[:, 0]) == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("binds", "taken"),
    [
        (STRAIGHT, True),
        ([], False),
        ([(0.0, 100.0, 0), (0, 60, 0), (0, 20, 0), (0, 20, -40)], False),  # as bent as the nodes
        ([(0.0, 100.0 - 80 * i, 0) for i in range(4)], False),  # of another body
        ([(0.0, 1e300, 0)] * 4, False),
    ],
)
def test_only_a_straighter_pose_of_the_same_body_is_taken(
    binds: list[tuple[float, float, float]], taken: bool, tmp_path: Path
) -> None:
    notes = read_fbx(written(tmp_path / "a.fbx", binds)).notes
    assert any("skin was bound in" in note for note in notes) is taken
