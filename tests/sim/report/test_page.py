"""The report's page: one file, opens offline, and its replay, list and plots work together."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robots import registry
from robots.model.motion import RobotMotion
from robots.model.understand import understand_robot
from sim.report import Report, Subject, assess
from sim.report.page import report_page, write_report_page
from sim.report.plots import Plot, svg
from sim.view.annotations import Annotations
from sim.view.figure import Figure
from sim.view.page import page
from sim.view.timeline import Event
from spark.errors import OutputError
from spark.rig.feet import sole_positions
from tests.helpers.browser import STILL_REPLAY, opened, with_probe
from tests.helpers.stick import standing, stick_rig

# Stands for a second, sinks for one, slides for one.
PATH = np.zeros((180, 3))
PATH[60:120, 2] = -0.05
PATH[120:, 0] = 0.5 * np.arange(60) / 60
TITLE = "a & b __X__ </script>"


def stumbling() -> tuple[Report, Subject, Subject]:
    rig = stick_rig()
    still = standing(rig, 180)
    moved = replace(still, root_pos=still.root_pos + PATH)
    subject, source = Subject(moved, rig), Subject(still, rig)
    return assess(subject, source=source), subject, source


@pytest.fixture(scope="module")
def text() -> str:
    report, subject, source = stumbling()
    return report_page(report, subject, source, title=TITLE)


@pytest.fixture(scope="module")
def robot_text() -> str:
    """The same of a robot, beside the stick man."""
    robot = understand_robot(registry.find("robot"))
    qpos = np.tile(robot.to_qpos(robot.tpose)[0], (180, 1))
    rig = robot.rig
    lowest = min(
        sole_positions(sole, rig.tpose_positions, rig.tpose)[:, 2].min() for sole in rig.soles
    )
    pelvis = robot.motion(robot.from_qpos(qpos[:1]), 1.0).root_pos[0, 2]
    qpos[:, :3] += PATH - np.array([0.0, 0.0, lowest + pelvis])
    moved = RobotMotion(robot, robot.from_qpos(qpos), 1 / 60)
    source = Subject(standing(stick_rig(), 180), stick_rig())
    subject = Subject(moved.motion, robot.rig, moved.body)
    report = assess(subject, source=source)
    return report_page(report, subject, source, title=TITLE)


def test_it_is_one_file_that_asks_for_nothing(text: str) -> None:
    assert not re.search(r"(src|href)\s*=\s*[\"']?(https?:)?//", text)
    assert "a &amp; b __X__ &lt;/script&gt;" in text
    assert "of the frames are implausible" in text
    assert "left foot sinks 5.0 cm under the floor" in text


def test_it_holds_the_whole_record(text: str) -> None:
    found = re.search(r'<script id="report" type="application/json">(.*?)</script>', text, re.S)
    assert found
    assert json.loads(found[1]) == json.loads(json.dumps(stumbling()[0].json()))


def test_a_line_shows_the_worst_of_the_frames_that_share_a_pixel() -> None:
    values = np.zeros(20000)
    values[12345] = 1.0
    never = np.zeros(20000, dtype=bool)
    for lowest, spike in ((False, values), (True, -values)):
        drawn = svg(Plot("x", "m", spike, never, None, worst_is_low=lowest), 1.0, 1.0)
        points = re.search(r'class="clip" points="([^"]*)"', drawn)
        assert points
        y = [float(point.split(",")[1]) for point in points[1].split()]
        assert len(y) <= 501
        assert np.ptp(y) > 30


def test_the_scale_is_of_what_is_drawn() -> None:
    """A spike of one frame is on the scale, and what is nothing but rounding is flat."""
    never = np.zeros(100, dtype=bool)
    spike, noise = np.zeros(100), np.full(100, 1e-8)
    spike[50] = 30.0
    assert "0 to 36<" in svg(Plot("x", "m", spike, never, None), 1.0, 1.0)
    assert "0 to 1<" in svg(Plot("x", "m", noise, never, None), 1.0, 1.0)


def test_what_lasts_for_one_frame_outlasts_the_thinning() -> None:
    """60 frames a second, of which the page has every other one: one slides, one floats, and a
    joint is at its limit in one."""
    rig = stick_rig()
    still = standing(rig, 60)
    states, at_limit = np.zeros((60, 1), dtype=np.uint8), np.zeros((60, 1), dtype=bool)
    floats, points = np.zeros(60, dtype=bool), np.zeros((60, 1, 3))
    states[31], floats[41], at_limit[51] = 2, True, True
    event = Event(41 / 60, 41 / 60, "floating", "it floats")
    known = Annotations(
        frame_time=1 / 60,
        corners=points,
        states=states,
        corner_states=(("stands", "#0f0"), ("slides", "#f00")),
        com=points[:, 0],
        support_height=0.04,
        joints=points,
        joint_names=("knee",),
        at_limit=at_limit,
        flags={"floating": floats, "skating": ~floats & floats},
        events=(event,),
    )
    data = re.search(
        r'<script id="data" type="application/json">(.*?)</script>',
        page([Figure(Subject(still, rig), "x")], title="", known=[known]),
    )
    assert data
    shown = json.loads(data[1])["figures"][0]["marks"]
    seen = np.frombuffer(base64.b64decode(shown["states"]), dtype=np.uint8)
    assert len(seen) == 30
    assert np.flatnonzero(seen).tolist() in ([15], [16])
    (limit,) = shown["limits"]
    assert (limit["name"], limit["frames"]) in (("knee", [25]), ("knee", [26]))
    (flag,) = shown["flags"]
    np.testing.assert_allclose(flag["runs"], [[41 / 60, 42 / 60]], atol=1e-4)
    assert shown["events"] == [
        {"start": 41 / 60, "stop": 41 / 60, "measure": "floating", "sentence": "it floats"}
    ]


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    report, subject, source = stumbling()
    with pytest.raises(OutputError, match="nowhere"):
        write_report_page(report, tmp_path / "nowhere" / "r.html", subject, source, title="t")


@pytest.mark.parametrize("body", ["text", "robot_text"])
def test_it_works_in_a_browser(body: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """Headless Chromium: no error; a finding sets the replay's time; the replay looks different."""
    text: str = request.getfixturevalue(body)
    probe = """
      const seen = []; onerror = m => seen.push(String(m)); console.error = onerror;
      const out = { seen, times: [], pictures: [], labels: [] };
      const note = () => { inside("tell(); draw()"); out.times.push(inside("view.time"));
        out.labels.push(inside("el('time').textContent"));
        const c = replay.contentDocument.getElementById("view");
        const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
        let s = 0; for (let i = 0; i < d.length; i += 4) s = (s * 31 + d[i]) % 1000003;
        out.pictures.push(s); };
      addEventListener("load", () => { try {
        seek(0); note();
        document.querySelector("#findings button").click(); note();
        const box = plots.getBoundingClientRect();
        plots.onclick({ clientX: box.left + 0.75 * box.width }); note();
        out.cursor = now.style.left; now.style.left = "";
        inside("told = null; tick(0)"); out.told = now.style.left;
      } catch (e) { seen.push(String(e)); }
      document.body.dataset.result = JSON.stringify(out); });"""
    result = opened(with_probe(text, STILL_REPLAY + probe), tmp_path)
    assert result["seen"] == []
    np.testing.assert_allclose(result["times"], [0, 1, 0.75 * 179 / 60], atol=0.01)
    assert len(set(result["pictures"])) == 3
    assert result["labels"] == ["0.00 s · frame 0", "1.00 s · frame 60", "2.24 s · frame 134"]
    assert float(result["cursor"].removesuffix("%")) == pytest.approx(75, abs=1)
    assert result["told"] == pytest.approx(result["cursor"])
