"""Stated ground as mesh files have it, in the unit and axes of a motion's file."""

from pathlib import Path

import numpy as np
import pytest

from spark.errors import FileFormatError
from spark.io.convention import Convention
from spark.io.terrain_file import read_terrain, write_obj
from tests.helpers.grounds import box

SI = Convention(1.0, "z")


def test_an_obj_is_read_as_it_was_written(tmp_path: Path) -> None:
    there = box((0.1, -0.5, 0.0), (1.4, 0.5, 0.47))
    write_obj(there, tmp_path / "a.obj")
    read = read_terrain(tmp_path / "a.obj", SI)
    np.testing.assert_allclose(read.corners, there.corners, atol=1e-8)


def test_a_mesh_has_the_unit_and_axes_of_the_motion(tmp_path: Path) -> None:
    """In centimetres, Y up: internal X, Y, Z are the file's Z, X, Y."""
    (tmp_path / "a.obj").write_text("v 0 30 0\nv 0 30 200\nv 100 30 0\nf 1 2 3\n")
    read = read_terrain(tmp_path / "a.obj", Convention(0.01, "y"))
    np.testing.assert_allclose(read.vertices, [[0, 0, 0.3], [2, 0, 0.3], [0, 1, 0.3]])


def test_polygons_textures_and_numbers_from_the_end(tmp_path: Path) -> None:
    rows = "v 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nvt 0 0\nf -4/1/1 2/1 3//1 4\n"
    (tmp_path / "a.obj").write_text(rows)
    assert read_terrain(tmp_path / "a.obj", SI).faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("kind", ["stl", "ply", "glb"])
def test_other_meshes_are_read_by_trimesh(tmp_path: Path, kind: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    there = box((0.0, -0.5, 0.0), (1.4, 0.5, 0.47))
    trimesh.Trimesh(there.vertices, there.faces).export(tmp_path / f"a.{kind}")
    read = read_terrain(tmp_path / f"a.{kind}", SI)
    assert read.closed.tolist() == [True]
    points = np.array([[0.7, 0.1, 3.0]])
    np.testing.assert_allclose(read.tops(points, 0.0), 0.47, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no faces"),
        ("v 0 0 0\n", "no faces"),
        ("v 0 0\n", r"a.obj:1: .*three numbers"),
        ("v 0 0 0\nf 1 2 9\n", "not there: 9"),
        ("v 0 0 0\nf 1 2\n", "three vertices or more"),
        ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "no number"),
        ("v 0 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", "upright"),
        ("v 0 0 0\nv 1e9 1 0\nv 0 0 1\nf 1 2 3\n", "check its unit"),
    ],
)
def test_what_is_broken_is_refused_by_its_place(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.obj").write_text(text)
    with pytest.raises(FileFormatError, match=said):
        read_terrain(tmp_path / "a.obj", SI)


def test_what_is_no_mesh_and_what_is_missing_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    (tmp_path / "a.ply").write_bytes(b"nonsense")
    with pytest.raises(FileFormatError, match="can't be read as a PLY mesh"):
        read_terrain(tmp_path / "a.ply", SI)
    with pytest.raises(FileFormatError, match=r"b\.obj"):
        read_terrain(tmp_path / "b.obj", SI)
