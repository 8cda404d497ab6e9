"""What MuJoCo is given of a model: the same model, and nothing that a stranger's file asks for."""

import os
import random
import re
import struct
from contextlib import suppress
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots import registry
from robots.model.known import model_sha256
from robots.model.mjcf import read_mjcf
from robots.model.mjcf_source import read_source
from spark.errors import FileFormatError, SparkSimError

EMBER = registry.find("robot").read_text()
INSTALLED = [e.name for e in registry.ENTRIES if e.path and e.path.suffix == ".xml"]


@pytest.mark.parametrize("name", INSTALLED)
def test_the_model_is_the_one_that_mujoco_reads(name: str) -> None:
    """Of every robot at hand, two of them with includes: the same bodies, joints and meshes."""
    path = registry.find(name)
    source = read_source(path)
    ours = mujoco.MjSpec.from_string(source.text, include=source.models)
    ours.modelfiledir = str(path.parent)
    theirs = mujoco.MjSpec.from_file(str(path))
    uncommented = re.sub(r"\s*<!--.*?-->", "", theirs.to_xml(), flags=re.DOTALL)
    assert ours.to_xml() == uncommented


def robot(folder: Path, inside: str, name: str = "robot.xml") -> Path:
    """Our robot with something more in its file."""
    path = folder / name
    path.write_text(EMBER.replace("</mujoco>", f"{inside}</mujoco>"))
    return path


TOO_MUCH = {
    "replicas": '<worldbody><replicate count="100000" offset="0 0 1"><geom size="1"/></replicate>'
    "</worldbody>",
    "replicas of replicas": "<worldbody>"
    + '<replicate count="100" offset="0 0 1">' * 4
    + '<geom size="1"/>'
    + "</replicate>" * 4
    + "</worldbody>",
    "a texture": '<asset><texture name="t" type="2d" builtin="flat" width="30000" height="30000"/>'
    "</asset>",
    "a skybox": '<asset><texture type="skybox" builtin="flat" width="8000" height="8000"/></asset>',
    "textures of a class": '<default><texture width="4000" height="4000"/></default><asset>'
    + "".join(f'<texture name="t{k}" type="2d" builtin="flat"/>' for k in range(8))
    + "</asset>",
    "a height field": '<asset><hfield name="h" nrow="20000" ncol="20000" size="1 1 1 1"/></asset>',
    "numbers of users": '<size nuser_body="100000000"/>',
    "memory": '<size memory="100G"/>',
    "a numeric": '<custom><numeric name="n" size="300000000"/></custom>',
    "a history": '<actuator><motor joint="waist_yaw" nsample="100000000" delay="1"/></actuator>',
    "a sensor": '<sensor><user dim="1000000000"/></sensor>',
    "cloth": '<worldbody><flexcomp name="f" type="grid" count="900 900 1" spacing="1 1 1"/>'
    "</worldbody>",
    "joints": f"<worldbody><body>{'<joint/>' * 2500}<geom size='1'/></body></worldbody>",
    "keyframes": f"<keyframe>{'<key/>' * 19000}</keyframe>",
    "a fine ball": '<asset><mesh name="m" builtin="sphere" params="5000"/></asset>',
    "a built-in mesh": '<asset><mesh name="m" builtin="supersphere" params="1000 1 1"/></asset>',
    "built-in meshes": "<asset>"
    + "".join(f'<mesh name="m{k}" builtin="sphere" params="4"/>' for k in range(100))
    + "</asset>",
    "numbers of users of all": '<size nuser_geom="1000"/><worldbody>'
    + '<geom size="1"/>' * 10000
    + "</worldbody>",
    "histories": "<actuator>" + '<motor joint="waist_yaw" nsample="900"/>' * 9000 + "</actuator>",
    "contacts of a sensor": '<sensor><contact num="100000000" subtree1="pelvis"/></sensor>',
    "a picture of distances": '<worldbody><camera name="c" resolution="9000 9000"/></worldbody>'
    '<sensor><rangefinder camera="c"/></sensor>',
    "a grid of touch": '<worldbody><site name="s"/></worldbody><sensor><plugin objname="s" '
    'plugin="mujoco.sensor.touch_grid" objtype="site"><config key="size" value="3000 3000"/>'
    "</plugin></sensor>",
    "a flexible line": '<worldbody><flexcomp name="f" type="direct" dim="1" rigid="true" point="'
    + "0 0 0 " * 200_000
    + '" element="0 1"/></worldbody>',
    "attributes": "<worldbody><geom "
    + " ".join(f"a{k}=''" for k in range(9999))
    + "/></worldbody>",
    "depth": f"<worldbody>{'<body>' * 300}{'</body>' * 300}</worldbody>",
    "itself": '<include file="robot.xml"/>',
    "itself by another name": '<include file="./a/../robot.xml"/>',
    "a pipe": '<include file="pipe"/>',
    "a device": '<include file="/dev/zero"/>',
    "a folder": '<include file="a"/>',
    "nothing": '<include file="nowhere.xml"/>',
    "a long name": f'<include file="{"x" * 5000}"/>',
    "a mesh of a pipe": '<asset><mesh name="m" file="pipe"/></asset>',
    "a mesh of a device": '<asset><mesh name="m" file="/dev/zero"/></asset>',
    "a texture of a pipe": '<asset><texture name="t" type="2d" file="pipe"/></asset>',
    "a large picture": '<asset><texture name="t" type="2d" file="large.png"/></asset>',
    "itself, attached": '<asset><model name="m" file="robot.xml"/></asset>',
    "NaN": '<worldbody><geom size="nan"/></worldbody>',
}


@pytest.mark.parametrize("inside", TOO_MUCH.values(), ids=TOO_MUCH)
def test_what_no_robot_needs_is_refused(inside: str, tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    os.mkfifo(tmp_path / "pipe")
    header = struct.pack(">I4sII", 13, b"IHDR", 30000, 30000)
    (tmp_path / "large.png").write_bytes(b"\x89PNG\r\n\x1a\n" + header)
    with pytest.raises(FileFormatError):
        read_mjcf(robot(tmp_path, inside))


def test_what_robots_do_need_is_read(tmp_path: Path) -> None:
    """The cases above fail for their sizes: the same in small are read."""
    read_mjcf(
        robot(
            tmp_path,
            '<size nuser_body="3" memory="20M"/><worldbody><replicate count="9" offset="0 0 1">'
            '<geom size="1"/></replicate></worldbody><asset><texture name="t" type="2d" '
            'builtin="flat" width="30" height="30"/><hfield name="h" nrow="20" ncol="20" '
            'size="1 1 1 1"/><mesh name="m" builtin="sphere" params="3"/></asset><custom><numeric '
            'name="n" size="3"/></custom><worldbody><site name="s"/><camera name="c" '
            'resolution="20 20"/></worldbody><sensor><contact num="9" subtree1="pelvis"/>'
            '<rangefinder camera="c"/></sensor>',
        )
    )


def test_an_exponential_number_of_includes_is_not_followed(tmp_path: Path) -> None:
    for k in range(40):
        text = (
            f'<mujoco><include file="x/../{k + 1}.xml"/><include file="y/../{k + 1}.xml"/></mujoco>'
        )
        (tmp_path / f"{k}.xml").write_text(text)
    (tmp_path / "x").mkdir()
    (tmp_path / "y").mkdir()
    (tmp_path / "40.xml").write_text("<mujoco/>")
    with pytest.raises(FileFormatError, match=r"again|deep"):
        read_source(robot(tmp_path, '<include file="0.xml"/>'))


def test_a_long_chain_of_includes(tmp_path: Path) -> None:
    for k in range(1500):
        (tmp_path / f"{k}.xml").write_text(f'<mujoco><include file="{k + 1}.xml"/></mujoco>')
    with pytest.raises(FileFormatError, match="20 deep"):
        read_source(tmp_path / "0.xml")


def test_attached_models_that_multiply(tmp_path: Path) -> None:
    """Each attaches the next twice: 2^30 of the last."""
    for k in range(15):
        asset = f'<asset><model name="m" file="{k + 1}.xml"/></asset>'
        twice = '<attach model="m" prefix="a"/><attach model="m" prefix="b"/>' * 4
        (tmp_path / f"{k}.xml").write_text(
            f"<mujoco>{asset}<worldbody><body>{twice}</body></worldbody></mujoco>"
        )
    (tmp_path / "15.xml").write_text("<mujoco><worldbody><body name='b'/></worldbody></mujoco>")
    with pytest.raises(FileFormatError, match="elements; a robot has fewer"):
        read_source(tmp_path / "0.xml")


def test_includes_and_attached_models_are_found(tmp_path: Path) -> None:
    """Beside the model, and beside the file that names them; a hand finds its own meshes."""
    hand = tmp_path / "hand"
    (hand / "meshes").mkdir(parents=True)
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (hand / "meshes" / "palm.obj").write_text(corners)
    (hand / "hand.xml").write_text(
        '<mujoco><compiler meshdir="meshes"/><include file="more.xml"/><worldbody>'
        '<body name="palm"><joint/><geom type="mesh" mesh="palm"/></body></worldbody></mujoco>'
    )
    (hand / "more.xml").write_text('<mujoco><asset><mesh file="palm.obj"/></asset></mujoco>')
    (tmp_path / "lights.xml").write_text(
        '<mujoco><worldbody><light name="l"/></worldbody></mujoco>'
    )
    path = robot(
        tmp_path,
        '<include file="lights.xml"/><asset><model name="h" file="hand/hand.xml"/></asset>'
        '<worldbody><attach model="h" body="palm" prefix="left_"/></worldbody>',
    )
    source = read_source(path)
    spec = mujoco.MjSpec.from_string(source.text, include=source.models)
    spec.modelfiledir = str(tmp_path)
    model = spec.compile()
    assert model.body("left_palm").id > 0
    assert model.nlight >= 1
    assert model.nmesh == 1
    before = model_sha256(path)
    (hand / "more.xml").write_text('<mujoco><asset><mesh file="palm.obj"/></asset> </mujoco>')
    assert model_sha256(path) != before


def test_errors_name_the_line_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text("<mujoco>\n<!-- a -- b\n-->\n<worldbody>\n<wheel/>\n</worldbody></mujoco>")
    with pytest.raises(FileFormatError, match="line 5"):
        read_mjcf(path)
    path.write_text("<mujoco>\n<worldbody>\n</mujoco>")
    with pytest.raises(FileFormatError, match=r"robot\.xml:3: is no XML"):
        read_mjcf(path)
    path.write_text('<!DOCTYPE a [<!ENTITY b "c">]>\n<mujoco/>')
    with pytest.raises(FileFormatError, match="document type"):
        read_mjcf(path)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_mutated_models_end_in_a_model_or_an_error(
    seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Words of the file are swapped, repeated, left out, or made something else."""
    chance = random.Random(seed)
    words = EMBER.split(" ")
    others = ("nan", "1e308", "-1", "<include", '""', "99999999999", "&#0;", "\u00e9", "inf")
    for _ in range(chance.randint(1, 8)):
        at = chance.randrange(len(words))
        other = chance.choice((chance.choice(words), chance.choice(others), ""))
        words[at : at + chance.choice((0, 1, 1, 5))] = [other]
    path = tmp_path_factory.getbasetemp() / "mutated.xml"
    path.write_text(" ".join(words))
    with suppress(SparkSimError):
        model = read_mjcf(path).model
        assert np.isfinite(model.qpos0).all()
