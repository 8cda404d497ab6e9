"""Meshes of strangers: read as they are meant, or refused for what they would grow to."""

from pathlib import Path

import numpy as np
import pytest

from robots.model.meshes import as_obj
from spark.errors import FileFormatError

_TRIANGLE = """<geometry id="g"><mesh><source id="s"><float_array>0 0 0 1 0 0 0 1 0 0 0 1
</float_array></source><vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<polylist><input semantic="VERTEX" source="#v" offset="0"/><vcount>{}</vcount><p>{}</p></polylist>
</mesh></geometry>"""


def dae(folder: Path, scene: str, library: str = "", counts: str = "3", corners: str = "") -> Path:
    path = folder / "hand.dae"
    corners = corners or "0 1 2"
    path.write_text(
        f"<COLLADA><asset/><library_geometries>{_TRIANGLE.format(counts, corners)}"
        f"</library_geometries><library_nodes>{library}</library_nodes><library_visual_scenes>"
        f"<visual_scene>{scene}</visual_scene></library_visual_scenes></COLLADA>"
    )
    return path


def doubling(times: int) -> str:
    """Nodes that each place the next one twice, one metre apart, and at last the triangle."""
    one = '<instance_node url="#{0}"/>'
    nodes = [
        f'<node id="n{k}"><node><translate>{2**k} 0 0</translate>{one.format(f"n{k + 1}")}</node>'
        f"{one.format(f'n{k + 1}')}</node>"
        for k in range(times)
    ]
    return "".join(nodes) + f'<node id="n{times}"><instance_geometry url="#g"/></node>'


def test_nodes_that_stand_for_others_are_placed(tmp_path: Path) -> None:
    """Three doublings are eight triangles in a row."""
    path = dae(tmp_path, '<node><instance_node url="#n0"/></node>', doubling(3))
    lines = (as_obj(path) or b"").decode().splitlines()
    assert sum(line.startswith("f ") for line in lines) == 8
    points = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    assert set(points[:, 0]) == set(range(9))


@pytest.mark.parametrize(
    "bomb",
    [
        {"scene": '<node><instance_node url="#n0"/></node>', "library": doubling(60)},
        {
            "scene": '<node><instance_node url="#a"/></node>',
            "library": '<node id="a"><instance_node url="#a"/></node>',
        },
        {"scene": "", "counts": "9000000000"},
        {"scene": "", "counts": "4611686018427387904 4611686018427387904 3"},
        {"scene": "", "counts": "-3 6"},
        {"scene": "<node>" * 5000 + "</node>" * 5000},
    ],
    ids=["doubling", "circle", "corners", "corners that overflow", "negative", "deep"],
)
def test_what_grows_without_end_is_refused(bomb: dict[str, str], tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"hand\.dae"):
        as_obj(dae(tmp_path, **bomb))


def test_a_document_type_is_refused(tmp_path: Path) -> None:
    """Its entities may stand for a thousand times the file."""
    path = dae(tmp_path, '<node><instance_geometry url="#g"/></node>')
    assert as_obj(path)
    path.write_text('<!DOCTYPE a [<!ENTITY b "c">]>' + path.read_text())
    with pytest.raises(FileFormatError, match="document type"):
        as_obj(path)
