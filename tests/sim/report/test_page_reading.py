"""The report's page read: by a screen reader, on a phone, on paper; and joint by joint."""

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from robots import registry
from robots.model.motion import RobotMotion
from robots.model.understand import understand_robot
from sim.report import Subject, assess
from sim.report.explanations import MEANINGS
from sim.report.joints import joint_rows
from sim.report.page import report_page
from sim.report.palette import css
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_about
from tests.helpers.browser import STILL_REPLAY, opened, with_probe
from tests.helpers.program import CHECKOUT
from tests.helpers.stick import joint, standing, stick_rig

FRAMES = 120


@pytest.fixture(scope="module")
def text() -> str:
    """A stick man who sinks, slides and bends his knee backwards, beside one who stands."""
    rig = stick_rig()
    moved = standing(rig, FRAMES)
    moved.rotations[80:, joint(Role.LEFT_LOWER_LEG)] = quat_about("y", np.radians(-60.0))
    path = np.zeros((FRAMES, 3))
    path[20:40, 2], path[60:, 0] = -0.05, np.arange(60) / 60
    subject = Subject(replace(moved, root_pos=moved.root_pos + path), rig)
    source = Subject(standing(rig, FRAMES), rig)
    report = assess(subject, source=source)
    return report_page(report, subject, source, title="two men", names=("he", "his source"))


class Outline(HTMLParser):
    """The page's elements with their attributes, and the text of some."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(re.sub(r"(?s)<(style|script)\b.*?</\1>", "", text))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def all(self, *tags: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes in self.found if tag in tags]


def test_a_screen_reader_finds_its_way(text: str) -> None:
    page = Outline(text)
    assert page.all("html")[0]["lang"] == "en"
    assert len(page.all("main")) == len(page.all("header")) == len(page.all("h1")) == 1
    levels = [tag for tag, _ in page.found if tag in ("h1", "h2", "h3", "h4")]
    assert levels == ["h1", *["h2"] * (len(levels) - 1)]
    assert page.all("iframe")[0]["title"]
    for picture in page.all("img"):
        assert re.fullmatch(r"he and his source at [\d.]+ s", picture["alt"] or "")
    for plot in page.all("svg"):
        assert plot["role"] == "img"
        assert plot["aria-label"]
    assert all(cell.get("scope") in ("col", "row") for cell in page.all("th"))
    ids = {str(found["id"]) for _, found in page.found if "id" in found}
    named = {str(found["aria-labelledby"]) for _, found in page.found if "aria-labelledby" in found}
    assert named <= ids


def test_colours_can_be_read() -> None:
    """WCAG 2: text has a contrast of 4.5 to what is behind it, in light and in dark."""

    def luminance(color: str) -> float:
        pairs = color if len(color) == 6 else "".join(2 * c for c in color)
        values = [int(pairs[i : i + 2], 16) / 255 for i in (0, 2, 4)]
        linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values]
        return float(np.dot([0.2126, 0.7152, 0.0722], linear))

    def contrast(one: str, other: str) -> float:
        low, high = sorted((luminance(one), luminance(other)))
        return (high + 0.05) / (low + 0.05)

    assert contrast("000000", "fff") == pytest.approx(21)  # the standard's own example
    for scheme in css().split("@media"):
        colors = dict(re.findall(r"--(\w+): #([0-9a-f]+);", scheme))
        for name in ("ink", "soft", "good", "fair", "bad"):
            for behind in ("bg", "card"):
                assert contrast(colors[name], colors[behind]) >= 4.5, (name, behind)


def test_every_measure_on_the_page_says_what_it_means(text: str) -> None:
    cards = re.findall(r'(?s)<details class="card">.*?<p>(.*?)</p></details>', text)
    assert len(cards) == len(Outline(text).all("details")) > 10
    meanings = {sentence.replace("'", "&#39;") for sentence in MEANINGS.values()}
    assert set(cards) <= meanings


PROBE = """
  addEventListener("load", () => {
    const wide = document.documentElement, boxes = name =>
      [...document.querySelectorAll(name)].map(e => e.getBoundingClientRect())
        .map(b => [b.left, b.top, b.right, b.bottom]);
    const before = [...document.querySelectorAll("details")].filter(d => d.open).length;
    dispatchEvent(new Event("beforeprint"));
    const printed = [...document.querySelectorAll("details")].filter(d => d.open).length;
    dispatchEvent(new Event("afterprint"));
    const after = [...document.querySelectorAll("details")].filter(d => d.open).length;
    document.body.dataset.result = JSON.stringify({
      seen: [], width: innerWidth, scrolls: wide.scrollWidth, open: [before, printed, after],
      cards: boxes(".card"), moments: boxes(".moments button"), plots: boxes("#plots svg"),
    });
  });"""


@pytest.mark.parametrize("width", [1280, 500])
def test_nothing_overlaps_or_sticks_out(text: str, width: int, tmp_path: Path) -> None:
    shown = opened(with_probe(text, STILL_REPLAY + PROBE), tmp_path, f"--window-size={width},900")
    assert shown["width"] == pytest.approx(width, abs=20)
    assert shown["scrolls"] <= shown["width"]
    cards = len(Outline(text).all("details"))
    assert shown["open"] == [0, cards, 0]  # on paper all are open
    for boxes in (shown["cards"], shown["moments"], shown["plots"]):
        for k, (left, top, right, bottom) in enumerate(boxes):
            assert 0 <= left < right <= shown["width"]
            for other in boxes[:k]:
                apart = left >= other[2] or other[0] >= right or top >= other[3]
                assert apart or other[1] >= bottom


def test_figures_in_a_picture_are_apart(text: str) -> None:
    """Each is in a frame of its own, and a white line between them is whole."""
    image = pytest.importorskip("PIL.Image")
    pictures = re.findall(r'src="data:image/jpeg;base64,([^"]*)"', text)
    if "no pictures" in text:
        pytest.skip("nothing can be drawn off screen here")
    assert len(pictures) >= 3
    for data in pictures:
        pixels = np.asarray(image.open(io.BytesIO(base64.b64decode(data))), dtype=int)
        middle = pixels.shape[1] // 2
        assert pixels[:, middle - 1 : middle + 1].min() > 240
        halves = pixels[:, : middle - 8], pixels[:, middle + 8 :]
        for half in halves:  # something stands in each, and is not cut off at its sides
            dark = (half.min(axis=2) < 150).any(axis=0)
            assert dark.any()
            assert not dark[:4].any()
            assert not dark[-4:].any()


def test_joints_of_a_rig_have_their_anatomical_limits(text: str) -> None:
    rig = stick_rig()
    bent = standing(rig, 60)
    bent.rotations[30:, joint(Role.LEFT_LOWER_LEG)] = quat_about("y", np.radians(-24.8))
    rows = {row.name: row for row in joint_rows(assess(Subject(bent, rig)).clip)}
    knee = rows["left lower leg"]  # it bends backwards by 25° at most
    assert knee.room == pytest.approx(np.radians(0.2), abs=1e-6)
    assert knee.at_limit == 0.5
    assert knee.torque is None
    assert rows["right lower leg"].at_limit == 0
    assert knee.speed > 0 == rows["right lower leg"].speed
    assert '<th scope="row">left lower leg</th>' in text
    assert "of its motor" not in text


def test_joints_of_one_name_are_numbered() -> None:
    """A spine of three: two turn against the next below."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 60.0)
    report = assess(Subject(motion, rig))
    rows = joint_rows(report.clip)
    names = [row.name for row in rows]
    assert len({*names}) == len(names) == len(report.clip.joint_names)
    spines = [row for row in rows if row.name.startswith("spine ")]
    assert [row.name for row in spines] == [f"spine {k + 1}" for k in range(len(spines))]
    assert len(spines) > 1
    assert [row.room is not None for row in spines] == [False] * (len(spines) - 1) + [True]
    assert {*report.json()["clip"]["joint_rates"]} == {*names}


def test_joints_of_a_robot_have_torques() -> None:
    robot = understand_robot(registry.find("robot"))
    qpos = np.tile(robot.to_qpos(robot.tpose)[0], (30, 1))
    still = RobotMotion(robot, robot.from_qpos(qpos), 1 / 60)
    clip = assess(Subject(still.motion, robot.rig, still.body)).clip
    rows = joint_rows(clip)
    assert [row.name for row in rows] == list(robot.joint_names)
    for row, each in zip(rows, clip.torques, strict=True):
        assert row.torque == pytest.approx(np.abs(each.torque).max())
        assert row.load == pytest.approx(row.torque / each.limit)
        assert row.speed == pytest.approx(0, abs=1e-9)


def test_paper_is_white_whatever_the_screen_is() -> None:
    """Dark colours are for screens alone: on paper they would be light words on white."""
    pages = [*(CHECKOUT / "sim").rglob("*.html"), *(CHECKOUT / "spark_sim").rglob("*.html")]
    texts = [css(), *(page.read_text() for page in pages)]
    rules = [rule for text in texts for rule in re.findall(r"@media [^{]*dark", text)]
    assert len(rules) >= 4
    assert set(rules) == {"@media screen and (prefers-color-scheme: dark"}
