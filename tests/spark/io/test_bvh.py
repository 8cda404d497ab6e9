"""BVH files: what is read is what is there, what is written is what was read."""

import os
import stat
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from spark.errors import FileFormatError, OutputError, SkeletonError, SparkSimError
from spark.io.bvh import Bvh, read_bvh, write_bvh
from spark.io.bvh_hierarchy import CHANNELS, BvhJoint
from spark.io.charset import to_utf8
from spark.io.encoding import encode
from spark.io.recording import read_recording
from tests.helpers.recordings import recordings

SMALL = """\
HIERARCHY
ROOT Hips
{
	OFFSET 0.5 0.0 -0.25
	CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
	JOINT Head
	{
		OFFSET 0 60 0
		CHANNELS 3 Zrotation Xrotation Yrotation
		End Site
		{
			OFFSET 0 20 0
		}
		End Site
		{
			OFFSET 0 20 5
		}
	}
	JOINT LeftFoot
	{
		OFFSET 0 -90 0
		CHANNELS 3 Xrotation Zrotation Yrotation
	}
}
MOTION
Frames: 2
Frame Time: 0.0333
0 90 0 1 2 3 4 5 6 7 8 9
0 91 0 1 2 3 4 5 6 7 8 -9.5e-1
"""
SMALL_LINES = SMALL.splitlines()


def read_text(folder: Path, text: str | bytes) -> Bvh:
    path = folder / "a.bvh"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_bvh(path)


def assert_same(a: Bvh, b: Bvh) -> None:
    """Equal to the last bit."""
    assert a.joints == b.joints
    assert a.frame_time == b.frame_time
    assert a.values.shape == b.values.shape
    assert a.values.tobytes() == b.values.tobytes()


def swap(old: str, new: str) -> str:
    """SMALL with the first `old` replaced."""
    assert old in SMALL
    return SMALL.replace(old, new, 1)


# What is read


def test_reads_what_is_written_there(tmp_path: Path) -> None:
    bvh = read_text(tmp_path, SMALL)
    turns = ("Zrotation", "Xrotation", "Yrotation")
    assert bvh.joints == (
        BvhJoint("Hips", -1, (0.5, 0.0, -0.25), (*CHANNELS[:3], *turns)),
        BvhJoint("Head", 0, (0.0, 60.0, 0.0), turns, ((0.0, 20.0, 0.0), (0.0, 20.0, 5.0))),
        BvhJoint("LeftFoot", 0, (0.0, -90.0, 0.0), ("Xrotation", "Zrotation", "Yrotation")),
    )
    assert bvh.frame_time == 0.0333
    assert bvh.values.tolist() == [
        [0, 90, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
        [0, 91, 0, 1, 2, 3, 4, 5, 6, 7, 8, -0.95],
    ]
    assert [len(bvh.values[0, columns]) for columns in bvh.columns] == [6, 3, 3]


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(SMALL.replace("\n", "\r\n"), id="CRLF"),
        pytest.param(SMALL.replace("\n", "\r"), id="CR"),
        pytest.param(SMALL.replace("\n\t", "\n").replace("\t", "  "), id="no indent"),
        pytest.param("\ufeff" + SMALL, id="BOM"),
        pytest.param("\n \n" + SMALL.replace("\n", "\n\n") + "\n \n", id="blank lines"),
        pytest.param(SMALL.rstrip(), id="no last line end"),
        pytest.param(SMALL.replace(" ", "   ").replace("End   Site", "End Site"), id="spaces"),
        pytest.param(SMALL.replace("\n{", " {").replace("\n\t{", "{"), id="brace beside the name"),
        pytest.param(SMALL.replace("Frames: 2", "Frames:\t2"), id="tab after Frames:"),
        pytest.param(SMALL.replace("Frames: 2", "FRAMES 2"), id="no colon"),
        pytest.param(SMALL.replace("Frames: 2", "Frames: 2.0"), id="Frames as a decimal"),
        pytest.param(SMALL.replace("End Site", "EndSite"), id="EndSite"),
        pytest.param(SMALL + "\x1a\0\0", id="DOS' end of a file, padded"),
        pytest.param(
            SMALL.replace("End Site", "End_Site{").replace("{\n\t\t{", "{"), id="End_Site"
        ),
        pytest.param(SMALL.replace(" 3 4 ", " 3\n4 "), id="rows wrapped"),
        pytest.param(SMALL.replace(" 3 4 ", "\n3\n\n\t4\r\n"), id="rows wrapped unevenly"),
    ],
)
def test_layout_does_not_matter(tmp_path: Path, text: str) -> None:
    assert_same(read_text(tmp_path, text), read_text(tmp_path, SMALL))


@pytest.mark.parametrize("change", [str.lower, str.upper, str.title])
def test_keywords_come_in_any_case(tmp_path: Path, change: Any) -> None:
    bvh = read_text(tmp_path, change(SMALL))
    assert [joint.name for joint in bvh.joints] == [change(n) for n in ("Hips", "Head", "LeftFoot")]
    assert bvh.joints[0].channels[3:] == ("Zrotation", "Xrotation", "Yrotation")


@pytest.mark.parametrize(
    "name",
    [
        "mixamorig:Head",
        "DEF-spine.001",
        "Bip01 L  Toe0",
        "頭",
        "größe",
        "End",
        "JOINT",
        "MOTION",
        "3",
    ],
)
def test_names_are_kept(tmp_path: Path, name: str) -> None:
    bvh = read_text(tmp_path, swap("JOINT Head", f"JOINT {name} \t"))
    assert bvh.joints[1].name == name
    write_bvh(bvh, tmp_path / "b.bvh")
    assert_same(read_bvh(tmp_path / "b.bvh"), bvh)


@pytest.mark.parametrize(
    ("name", "encoding"),
    [
        ("größe", "latin-1"),
        ("Épaule_G", "latin-1"),
        ("TÊTE", "latin-1"),
        ("左ひじ", "cp932"),
        ("右足ＩＫ", "cp932"),
        ("ボーン1", "cp932"),  # its first letter's second byte is a brace
        ("L_ｾﾝﾀｰ親", "cp932"),
    ],
)
def test_names_that_are_not_utf_8_are_read_and_written_as_they_are(
    tmp_path: Path, name: str, encoding: str
) -> None:
    with pytest.raises(UnicodeDecodeError):
        name.encode(encoding).decode()
    bvh = read_text(tmp_path, swap("JOINT Head", f"JOINT {name}").encode(encoding))
    assert (bvh.joints[1].name, bvh.encoding) == (name, encoding)
    write_bvh(bvh, tmp_path / "b.bvh")
    assert_same(read_bvh(tmp_path / "b.bvh"), bvh)
    assert f"JOINT {name}\n".encode(encoding) in (tmp_path / "b.bvh").read_bytes()
    recording = read_recording(tmp_path / "b.bvh", unit="cm", up="y")
    said = {"cp932": "Shift-JIS", "latin-1": "Latin-1"}[encoding]
    assert f"joint names are not UTF-8: read as {said}" in recording.notes
    assert encode(recording.motion, recording)[0].encoding == encoding


@given(name=st.text(st.characters(codec="latin-1"), max_size=8))
def test_any_bytes_are_some_text_and_give_themselves_again(name: str) -> None:
    data = name.encode("latin-1")
    text, encoding = to_utf8(data)
    assert text.decode().encode(encoding) == data


def test_names_may_repeat(tmp_path: Path) -> None:
    bvh = read_text(tmp_path, swap("JOINT LeftFoot", "JOINT Head"))
    assert [joint.name for joint in bvh.joints] == ["Hips", "Head", "Head"]


def test_a_rig_may_have_no_frames(tmp_path: Path) -> None:
    bvh = read_text(tmp_path, "\n".join(SMALL_LINES[:-4]) + "\nFrames: 0\nFrame Time: 0.04\n")
    assert bvh.values.shape == (0, 12)
    write_bvh(bvh, tmp_path / "b.bvh")
    assert_same(read_bvh(tmp_path / "b.bvh"), bvh)


def test_decimal_commas_are_points(tmp_path: Path) -> None:
    """Where no number has a point: else it is no decimal comma, and refused (below)."""
    found = read_text(tmp_path, SMALL.replace(".", ",").replace("LeftFoot", "foot.01.L"))
    assert "decimal commas" in " ".join(found.repairs)
    assert_same(found, read_text(tmp_path, swap("LeftFoot", "foot.01.L")))


@pytest.mark.parametrize("mark", ["#", ";", "//"])
def test_lines_of_comments_are_left_out(tmp_path: Path, mark: str) -> None:
    """Of whole lines alone: joints may be called so. Lines keep their numbers in errors."""
    plain = swap("JOINT Head", f"JOINT {mark}1 Head")
    lines = plain.splitlines()
    for at in (28, 27, 14, 6, 0):
        lines.insert(at, f" \t{mark} made by hand: {{ 1 2 3")
    for ending in ("\n", "\r\n", "\r"):
        found = read_text(tmp_path, ending.join([*lines, ""]))
        assert_same(found, read_text(tmp_path, plain))
        assert "5 lines of comments left out" in found.repairs
    with pytest.raises(FileFormatError, match=rf"a\.bvh:{len(lines)}: .*'nan'"):
        read_text(tmp_path, "\n".join([*lines[:-1], lines[-1].replace("91", "nan")]))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_utf_16_reads_as_utf_8(tmp_path: Path, encoding: str) -> None:
    text = SMALL.replace("Head", "頭")
    marked = text if encoding == "utf-16" else "\ufeff" + text
    assert_same(read_text(tmp_path, marked.encode(encoding)), read_text(tmp_path, text))


@pytest.mark.parametrize("frames", [0, 1])
def test_a_single_frame_needs_no_frame_time(tmp_path: Path, frames: int) -> None:
    lines = SMALL_LINES[: 27 + frames]
    lines[25:27] = [f"Frames: {frames}", "Frame Time: 0"]
    found = read_text(tmp_path, "\n".join(lines) + "\n")
    assert (len(found), found.frame_time) == (frames, 1 / 30)
    assert "Frame Time is 0" in " ".join(found.repairs)


@pytest.mark.parametrize("wrong", ["0", "-1", "30"])
def test_a_given_frame_time_replaces_a_wrong_one(tmp_path: Path, wrong: str) -> None:
    bvh = read_text(tmp_path, SMALL)
    (tmp_path / "a.bvh").write_text(swap("0.0333", wrong))
    assert_same(read_bvh(tmp_path / "a.bvh", frame_time=0.0333), bvh)


# What is refused, where, and with which words

MALFORMED: dict[str, tuple[str | bytes, int | None, str]] = {
    "empty": ("", None, "is empty"),
    "blank": (" \r\n\t", None, "is empty"),
    "binary": (b"\x00\xff\x01 \x02" * 9, 1, "starts with HIERARCHY"),
    "another format": ('{"a": 1}', 1, "starts with HIERARCHY"),
    "no ROOT": (swap("ROOT", "JOINT"), 2, "expected ROOT"),
    "two roots": (swap("MOTION", "ROOT b\n{\nOFFSET 0 0 0\n}\nMOTION"), 25, "a second ROOT"),
    "no name": (swap("JOINT Head", "JOINT"), 6, "the name of a joint"),
    "no brace": (swap("JOINT Head\n\t{", "JOINT Head\n"), 8, "expected {, found 'OFFSET'"),
    "brace not closed": (swap("\t\t}\n\t}\n", "\t\t}\n"), 24, "found 'MOTION'"),
    "brace too many": (swap("MOTION", "}\nMOTION"), 25, "expected MOTION, found '}'"),
    "no OFFSET": (swap("\t\tOFFSET 0 60 0\n", ""), 17, "'Head' has no OFFSET"),
    "short OFFSET": (swap("0 60 0", "0 60"), 9, "number for the OFFSET of 'Head'"),
    "long OFFSET": (swap("0 60 0", "0 60 0 0"), 9, "three, or six"),
    "longer OFFSET": (swap("0 60 0", "0 60 0 0 0 0 0"), 8, "found '0'"),
    "two OFFSETs": (swap("\tOFFSET 0 60 0", "OFFSET 0 60 0\nOFFSET 1 1 1"), 9, "once each"),
    "OFFSET nan": (swap("0 60 0", "0 nan 0"), 8, "found 'nan'"),
    "OFFSET huge": (swap("0 60 0", "0 1e300 0"), 8, "at most 1e12"),
    "empty End Site": (swap("\t\t\tOFFSET 0 20 0\n", ""), 12, "expected OFFSET, found '}'"),
    "unknown channel": (swap("Xposition", "Wposition"), 5, "found 'Wposition'"),
    "repeated channel": (swap("Xposition", "Yposition"), 5, "different CHANNELS for 'Hips'"),
    "channel missing": (swap("CHANNELS 3", "CHANNELS 4"), 10, "found 'End'"),
    "channel too many": (swap("CHANNELS 3", "CHANNELS 2"), 9, "found 'Yrotation'"),
    "seven channels": (swap("CHANNELS 6", "CHANNELS 7"), 5, "at most 6"),
    "channels not counted": (swap("CHANNELS 6 ", "CHANNELS "), 5, "found 'Xposition'"),
    "no MOTION": (SMALL[: SMALL.index("MOTION")], 25, "expected MOTION, found the end"),
    "no Frames": (swap("Frames: 2\n", ""), 26, "expected Frames:"),
    "no Frame Time": (swap("Frame Time: 0.0333\n", ""), 27, "expected Frame Time:"),
    "no rows": ("\n".join(SMALL_LINES[:27]), None, "not 0"),
    "Frames not whole": (swap("Frames: 2", "Frames: 2.5"), 26, "found '2.5'"),
    "Frames negative": (swap("Frames: 2", "Frames: -2"), 26, "found '-2'"),
    "Frames with 5000 digits": (swap("Frames: 2", "Frames: " + "9" * 5000), 26, "whole number"),
    "2 GB of Frames": (swap("Frames: 2", "Frames: 22000000"), 29, "set Frames: 2"),
    "Frame Time zero": (swap("0.0333", "0"), 27, "Frame Time is 0"),
    "Frame Time negative": (swap("0.0333", "-1"), 27, "Frame Time is -1"),
    "Frame Time with a comma": (swap("0.0333", "0,0333"), 27, "found '0,0333'"),
    "cut in a row": (SMALL[:-20], 29, "cut short"),
    "cut after two rows of five": (swap("Frames: 2", "Frames: 5"), 29, "set Frames: 2"),
    "a value too many": (swap("0 91 0", "0 91 0 0"), 29, "too long"),
    "a value moved to the next row": (
        swap("8 9\n0 91", "8\n9 0 91"),
        28,
        "11 values in this row; expected 12",
    ),
    "nan": (swap("0 91 0", "0 nan 0"), 29, "found 'nan'"),
    "inf": (swap("0 91 0", "0 -inf 0"), 29, "found '-inf'"),
    "overflow": (swap("0 91 0", "0 1e999 0"), 29, "found '1e999'"),
    "a word": (swap("0 91 0", "0 91cm 0"), 29, "found '91cm'"),
    "decimal commas": (swap("0 91 0", "0 9,1 0"), 29, "found '9,1'"),
    "two points": (swap("0 91 0", "0 9.1.5 0"), 29, "found '9.1.5'"),
    "numbers run together": (swap("0 91 0", "0 91-4 0"), 29, "found '91-4'"),
    "underscores": (swap("0 91 0", "0 9_1 0"), 29, "found '9_1'"),
    "NUL": (swap("0 91 0", "0 9\x001 0"), 29, "found '9"),
    "no channels at all": (
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\n}\nMOTION\nFrames: 9\nFrame Time: 1\n",
        6,
        "no joint has CHANNELS",
    ),
    "too many": (
        "HIERARCHY\nROOT a {\nOFFSET 0 0 0\n" + "JOINT b { OFFSET 0 1 0 }\n" * 20_000,
        10_003,
        "more than 10000 joints",
    ),
    "too deep": ("HIERARCHY\nROOT a {\n" + "JOINT b {\n" * 100_000, 514, "deeper than 512"),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_files_are_refused_with_the_line(tmp_path: Path, case: str) -> None:
    text, line, words = MALFORMED[case]
    for ending in ("\n", "\r\n", "\r"):
        content = text if isinstance(text, bytes) else text.replace("\n", ending)
        with pytest.raises(FileFormatError) as caught:
            read_text(tmp_path, content)
        assert words in str(caught.value)
        assert caught.value.line == line
        where = str(tmp_path / "a.bvh") + (f":{line}: " if line else ": ")
        assert str(caught.value).startswith(where)


def test_memory_goes_with_the_file_and_not_with_its_claim(tmp_path: Path) -> None:
    text = swap("Frames: 2", "Frames: 22000000")
    tracemalloc.start()
    with pytest.raises(FileFormatError):
        read_text(tmp_path, text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e6


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    places = [tmp_path, tmp_path / "missing.bvh", Path("/dev/zero"), tmp_path / "fifo"]
    for path in [*places, tmp_path / ("x" * 300)]:
        with pytest.raises(FileFormatError, match=str(path)):
            read_bvh(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_without_permission_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.bvh"
    path.write_text(SMALL)
    path.chmod(0)
    with pytest.raises(FileFormatError, match="Permission denied"):
        read_bvh(path)


# What is mended


@pytest.mark.parametrize(
    ("claim", "rows"), [(1, 2), (2, 1), (4, 2), (0, 2), (2, 7)], ids=lambda n: str(n)
)
def test_whole_rows_count_and_not_the_claim(tmp_path: Path, claim: int, rows: int) -> None:
    """The last row stands in for others; `Frames:` says `claim`, and `rows` of them follow."""
    head = [line.replace("Frames: 2", f"Frames: {claim}") for line in SMALL_LINES[:-2]]
    lines = [SMALL_LINES[-2], *SMALL_LINES[-1:] * (rows - 1)]
    bvh = read_text(tmp_path, "\n".join([*head, *lines, ""]))
    np.testing.assert_array_equal(bvh.values[:, 1], [90] + [91] * (rows - 1))
    assert [f"Frames: says {claim}, but {rows} row" in note for note in bvh.repairs] == [True]
    assert bvh.repairs[0] in read_recording(tmp_path / "a.bvh").notes
    write_bvh(bvh, tmp_path / "b.bvh")
    again = read_bvh(tmp_path / "b.bvh")
    assert_same(again, bvh)
    assert again.repairs == ()


def test_offsets_of_six_numbers(tmp_path: Path) -> None:
    """NVIDIA's SOMA: a position and a rest rotation, which the rows hold already."""
    bvh = read_text(
        tmp_path, SMALL.replace("0 60 0", "0 60 0 0 -90 1.5").replace("20 5", "20 5 1 2 3")
    )
    assert_same(bvh, read_text(tmp_path, SMALL))
    assert read_text(tmp_path, SMALL).repairs == ()
    assert "2 OFFSETs of six numbers" in bvh.repairs[0]


# What is written


@pytest.mark.parametrize(
    "path",
    recordings(
        *("zoo/*.bvh", "[amr]*/*.bvh", "cmu_asf/cmu_*_01.bvh"),
        *("cmu_expmap/test_walking_1.bvh", "cmu_dance/cmu_05_02.bvh"),
    ),
    ids=lambda path: None,
)
def test_recordings_survive_writing_exactly(tmp_path: Path, path: Path) -> None:
    bvh = read_bvh(path)
    assert len(bvh) > 0
    write_bvh(bvh, tmp_path / "b.bvh")
    assert_same(read_bvh(tmp_path / "b.bvh"), bvh)


def test_numbers_are_short_and_without_exponents(tmp_path: Path) -> None:
    bvh = read_text(tmp_path, swap("0 90 0", "1e-7 123456.1 3e11"))
    write_bvh(bvh, tmp_path / "b.bvh")
    row = (tmp_path / "b.bvh").read_text().splitlines()[-2]
    assert row == "0.0000001 123456.1 300000000000.0 1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0"


def test_a_written_file_replaces_the_old_and_leaves_nothing_else(tmp_path: Path) -> None:
    bvh = read_text(tmp_path, SMALL)
    (tmp_path / "link.bvh").symlink_to(tmp_path / "a.bvh")
    write_bvh(bvh, tmp_path / "link.bvh")
    assert (tmp_path / "link.bvh").is_symlink()
    assert {path.name for path in tmp_path.iterdir()} == {"a.bvh", "link.bvh"}
    assert not stat.S_IMODE((tmp_path / "a.bvh").stat().st_mode) & 0o111


def test_what_cannot_be_written_says_so(tmp_path: Path) -> None:
    bvh = read_text(tmp_path, SMALL)
    for path in [tmp_path, tmp_path / "no" / "b.bvh", tmp_path / "a.bvh" / "b", Path("/proc/b")]:
        with pytest.raises(OutputError, match=f"^{path}: can't be written"):
            write_bvh(bvh, path)
    assert {path.name for path in tmp_path.iterdir()} == {"a.bvh"}


@pytest.mark.parametrize(
    ("parents", "channels"),
    [((0,), 3), ((-1, -1), 6), ((-1, 2, 0), 9), ((-1, 0, 0, 1), 12), ((-1, 0), 7), ((-1, 1), 6)],
)
def test_joints_that_do_not_nest_are_refused(parents: tuple[int, ...], channels: int) -> None:
    joints = tuple(BvhJoint(f"j{p}", p, (0.0, 0.0, 0.0), CHANNELS[3:]) for p in parents)
    with pytest.raises(SkeletonError):
        Bvh(joints, 0.1, np.zeros((1, channels)))


@pytest.mark.parametrize("name", ["", " a", "a\t", "a\nb", "a{", "}"])
def test_names_that_bvh_cannot_hold_are_refused(name: str) -> None:
    with pytest.raises(SkeletonError, match="name"):
        Bvh((BvhJoint(name, -1, (0.0, 0.0, 0.0), ("Xrotation",)),), 0.1, np.zeros((1, 1)))


# Laws on files made up by hypothesis

numbers = st.floats(-1e12, 1e12, width=64)
vectors = st.tuples(numbers, numbers, numbers)
names = st.text(
    st.characters(exclude_categories=["Cs", "Zs", "Zl", "Zp", "Cc"], exclude_characters="{}"),
    min_size=1,
)


@st.composite
def trees(draw: st.DrawFn) -> list[dict[str, Any]]:
    """Joints of well-formed files: any tree, any channels in any order, any numbers."""
    joints: list[dict[str, Any]] = []
    open_joints = [-1]
    for j in range(draw(st.integers(1, 8))):
        while len(open_joints) > 2 and draw(st.booleans()):
            open_joints.pop()
        joint = {
            "name": draw(names),
            "parent": open_joints[-1],
            "offset": draw(vectors),
            "channels": tuple(
                draw(st.lists(st.sampled_from(CHANNELS), unique=True, min_size=not j))
            ),
            "ends": tuple(draw(st.lists(vectors, max_size=2))),
        }
        joints.append(joint)
        open_joints.append(j)
    return joints


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bvh")


@given(tree=trees(), frame_time=st.floats(1e-9, 1e12), frames=st.integers(0, 3), data=st.data())
@settings(deadline=None, max_examples=150)
def test_any_file_survives_writing_exactly(
    folder: Path, tree: list[dict[str, Any]], frame_time: float, frames: int, data: st.DataObject
) -> None:
    joints = tuple(BvhJoint(**joint) for joint in tree)
    width = sum(len(joint.channels) for joint in joints)
    values = data.draw(st.lists(numbers, min_size=frames * width, max_size=frames * width))
    bvh = Bvh(joints, frame_time, np.array(values, float).reshape(frames, width))
    write_bvh(bvh, folder / "b.bvh")
    assert_same(read_bvh(folder / "b.bvh"), bvh)


GARBAGE = [
    b"{",
    b"}",
    b"nan",
    b"1e308",
    b"-",
    b"\x00",
    b"\xff\xfe",
    b"9" * 30,
    b"JOINT",
    b"End Site",
]
GARBAGE += [
    b"ROOT x {",
    b"CHANNELS 0",
    b"OFFSET",
    b"MOTION",
    b"Frames: 1",
    b"\r",
    b"\n",
    b"0",
    b"1",
]
GARBAGE += [b"1e12", b"1e-300", b" 3 Xposition Yrotation Zposition"]

edits = st.lists(
    st.tuples(st.sampled_from("dsi"), st.integers(0, 999), st.integers(0, 999)), max_size=4
)


@given(edits=edits, by_words=st.booleans(), cut=st.integers(0, 4))
@settings(
    deadline=2000, max_examples=400, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_broken_files_give_a_recording_or_an_error_of_ours(
    folder: Path, edits: list[tuple[str, int, int]], by_words: bool, cut: int
) -> None:
    data = SMALL.encode()
    pieces = data.split(b" ") if by_words else data.splitlines(keepends=True)
    for kind, a, b in edits:
        i, k = a % max(len(pieces), 1), b % max(len(pieces), 1)
        if kind == "d":
            del pieces[i : i + 1 + b % 2]
        elif kind == "s" and pieces:
            pieces[i], pieces[k] = pieces[k], pieces[i]
        else:
            pieces.insert(i, GARBAGE[b % len(GARBAGE)])
    data = (b" " if by_words else b"").join(pieces)
    (folder / "c.bvh").write_bytes(data[: len(data) - cut * 7] if cut else data)
    try:
        recording = read_recording(folder / "c.bvh")
    except SparkSimError:
        return
    assert np.all(np.isfinite(recording.motion.root_pos))
    assert np.all(np.isfinite(recording.motion.rotations))
    assert np.all(np.isfinite(encode(recording.motion, recording)[0].values))
