"""XML as files of robots have it."""

from pathlib import Path

import pytest

from robots.model.xml import parse_xml
from spark.errors import FileFormatError

FILE = Path("robot.urdf")
ROBOT = b'<?xml version="1.0"?>\n<robot name="one">\n<link name="base"/>\n</robot>\n'


@pytest.mark.parametrize("content", [ROBOT, b"\n\n \t\r\n" + ROBOT, ROBOT + b"\0", ROBOT + b"\0\n"])
def test_blanks_before_and_zeros_after_are_passed_over(content: bytes) -> None:
    robot = parse_xml(FILE, content)
    assert [link.get("name") for link in robot.iter("link")] == ["base"]


@pytest.mark.parametrize("before", [b"", b"\n\n", b" \r\n"])
def test_the_line_is_that_of_the_file(before: bytes) -> None:
    with pytest.raises(FileFormatError) as refused:
        parse_xml(FILE, before + ROBOT.replace(b'"base"/', b'"base"'))
    assert f"robot.urdf:{4 + before.count(bytes([10]))}:" in str(refused.value)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_utf_16_keeps_its_zeros(encoding: str) -> None:
    text = ROBOT.decode().replace("?>", ' encoding="utf-16"?>')
    assert parse_xml(FILE, text.encode(encoding)).get("name") == "one"


@pytest.mark.parametrize("content", [b"", b"\n\0", b"robot"])
def test_what_is_no_xml_is_refused(content: bytes) -> None:
    with pytest.raises(FileFormatError, match="is no XML"):
        parse_xml(FILE, content)
