"""The controls of the replay's page, in headless Chromium: what the help says is true."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim.report import Subject
from sim.report.watch import known_of
from sim.view.camera import distances
from sim.view.controls import CONTROLS, TOGGLES
from sim.view.figure import Figure
from sim.view.page import page
from sim.view.staging import build_scene
from spark.rig.roles import Role
from spark.rotation import quat_about
from tests.helpers.browser import opened, with_probe
from tests.helpers.stick import joint, standing, stick_rig

NAMES = {"space": " ", "left": "ArrowLeft", "right": "ArrowRight", "up": "ArrowUp"}
NAMES |= {"down": "ArrowDown", "home": "Home", "end": "End", "f1": "F1"}


@pytest.fixture(scope="module")
def text() -> str:
    """One who stands, and one who sinks for a moment, and then slides, a knee bent backwards."""
    rig = stick_rig()
    still = standing(rig, 180)
    moved = replace(still, root_pos=still.root_pos.copy(), rotations=still.rotations.copy())
    moved.root_pos[30:35, 2] -= 0.05
    moved.root_pos[120:, 0] += 0.5 * np.arange(60) / 60
    moved.rotations[120:, joint(Role.LEFT_LOWER_LEG)] = quat_about("y", np.radians(-60.0))
    figures = [Figure(Subject(m, rig), name) for m, name in ((still, "he"), (moved, "she"))]
    return page(figures, title="two", known=known_of(figures))


def asked(text: str, script: str, folder: Path, *flags: str) -> Any:
    """What a script works out on the page, whose time stands still."""
    probe = f"""
      const seen = []; onerror = m => seen.push(String(m)); requestAnimationFrame = () => 0;
      const picture = () => {{ draw(); let sum = 0;
        const d = ctx.getImageData(0, 0, canvas.width, canvas.height).data;
        for (let i = 0; i < d.length; i += 4) sum = (sum * 31 + d[i] + 7 * d[i + 2]) % 1000003;
        return sum; }};
      const keyed = key => document.body.dispatchEvent(
        new KeyboardEvent("keydown", {{ key, bubbles: true, cancelable: true }}));
      setTimeout(() => {{
        let out = null;
        try {{ out = (() => {{ {script} }})(); }} catch (e) {{ seen.push(String(e)); }}
        document.body.dataset.result = JSON.stringify({{ seen, out }}); }}, 200);"""
    result = opened(with_probe(text, probe), folder, *flags)
    assert result["seen"] == []
    return result["out"]


def test_every_key_of_the_help_does_something(text: str, tmp_path: Path) -> None:
    controls = [c for c in CONTROLS if c.keys and not {"tab", "escape"} & c.keys.keys()]
    keys = [NAMES.get(key, key) for control in controls for key in control.keys]
    assert len(keys) > 30
    state = """JSON.stringify([view.time, view.playing, view.yaw, shown, player.loop,
      player.followed, el("speed").value, el("help").open])"""
    script = f"""
      const idle = [], state = () => {state};
      for (const key of {keys}) {{
        view.time = 1.03; view.yaw = 2; view.playing = false;
        const before = state();
        keyed(key);
        if (state() === before) idle.push(key);
      }}
      return [idle, document.querySelectorAll("#help tr").length];"""
    idle, rows = asked(text, script, tmp_path)
    assert idle == []
    assert rows >= len(controls)
    for control in controls:
        assert control.words in text


def test_every_toggle_changes_the_picture(text: str, tmp_path: Path) -> None:
    script = f"""
      play(false); seekTo(2.5);
      return {[*TOGGLES]}.map(name => {{
        const before = picture();
        toggle(name);
        const after = picture();
        toggle(name);
        return [name, before !== after, before === picture()];
      }});"""
    assert asked(text, script, tmp_path) == [[name, True, True] for name in TOGGLES]


def test_who_flies_off_costs_the_others_neither_place_nor_precision(tmp_path: Path) -> None:
    rig = stick_rig()
    still = standing(rig, 60)
    away = replace(still, root_pos=still.root_pos.copy())
    away.root_pos[30:] += np.exp(np.arange(30))[:, None]
    figures = [Figure(Subject(m, rig), name) for m, name in ((still, "he"), (away, "it"))]
    script = """
      const at = t => {
        play(false); seekTo(t);
        const all = placedPoses();
        return [all.map(bodies => bodies[0].p), aim(all)];
      };
      return [at(0.4), at(end)];"""
    text = page(figures, title="two", known=known_of(figures))
    (before, middle), (after, later) = asked(text, script, tmp_path)
    np.testing.assert_allclose(after[0], before[0], atol=1e-6)
    np.testing.assert_allclose(later, middle, atol=0.01)
    assert before[1][2] == pytest.approx(before[0][2], abs=0.002)
    assert np.linalg.norm(after[1]) > 10.0


def test_all_are_seen_whatever_the_shape_of_the_window(tmp_path: Path) -> None:
    """On a phone from further away, and never further than they need."""
    rig = stick_rig()
    figures = [Figure(Subject(standing(rig, 30), rig), name) for name in ("he", "she", "it")]
    shapes = [0.3, 0.62, 0.7, 1.0, 1.55, 2.2, 2.8, 4.0]
    text = page(figures, title="three")
    found = asked(text, f"return {shapes}.map(fitting);", tmp_path)
    scene = build_scene(figures, max_fps=30.0)
    needed = distances(scene, [1 / tall for tall in shapes], 0.27)
    assert needed[-1] > 2 * needed[0]
    for got, least in zip(found[1:], needed[1:], strict=True):
        assert least - 1e-6 <= got <= 1.08 * least


def test_findings_are_gone_through_and_clicked(text: str, tmp_path: Path) -> None:
    script = """
      play(true); view.time = 0;
      const times = [];
      for (const key of ["n", "n", "n", "p", "p"]) { keyed(key); times.push(view.time); }
      tell();
      const strip = name => [...document.querySelectorAll(".flag")].find(row =>
        row.querySelector("span").textContent === name).querySelector("div");
      const click = (name, share) => { const on = strip(name), box = on.getBoundingClientRect();
        on.onclick({ clientX: box.left + share * box.width }); return view.time; };
      return { times, playing: view.playing, starts: events().map(e => e.start),
        names: [...document.querySelectorAll(".flag span")].map(e => e.textContent),
        found: click("penetration", 32 / 180), beside: click("penetration", 0.75),
        words: (tell(), click("penetration", 32 / 180), tell(), el("now").textContent) };"""
    out = asked(text, script, tmp_path)
    starts = sorted({*out["starts"]})
    assert out["playing"] is False
    distinct = [*starts, *starts]
    assert out["times"][:3] == pytest.approx(distinct[:3])
    assert out["times"][3] == pytest.approx(distinct[1] if len(starts) > 2 else starts[-1])
    assert {"penetration", "joint limits"} <= {*out["names"]}
    assert out["found"] == pytest.approx(0.5)
    assert out["beside"] == pytest.approx(0.75 * 3, abs=0.02)
    assert "sinks 5.0 cm" in out["words"]


def test_it_stops_at_the_end_where_it_does_not_loop(text: str, tmp_path: Path) -> None:
    script = """
      play(true); view.time = end - 0.1; advance(0.2);
      const looped = view.time;
      setLoop(false); view.time = end - 0.1; advance(0.2);
      const stopped = [view.time, view.playing];
      keyed(" ");
      return [looped, ...stopped, view.time, view.playing, end];"""
    looped, time, playing, again, on, end = asked(text, script, tmp_path)
    assert looped == pytest.approx(0.1, abs=1e-6)
    assert (time, playing, again, on) == (end, False, 0, True)


def test_the_ghost_is_as_tall_and_begins_in_the_same_place(text: str, tmp_path: Path) -> None:
    script = """
      view.time = 0; toggle("ghosts");
      const all = placedPoses(), [ghost] = ghosts(all);
      toggle("overlaid");
      const over = placedPoses();
      return [ghost[0].p, all[1][0].p, ghost[0].size, over[0][0].p, over[1][0].p];"""
    ghost, own, size, one, other = asked(text, script, tmp_path)
    np.testing.assert_allclose(ghost, own, atol=2e-3)
    assert size == pytest.approx(1)
    assert one[1] == pytest.approx(other[1], abs=2e-3)


@pytest.mark.parametrize("size", ["500,700", "1280,800"])
def test_the_bar_leaves_room_for_the_figures(text: str, size: str, tmp_path: Path) -> None:
    script = """
      view.below = innerHeight - el("bar").getBoundingClientRect().top;
      play(false); seekTo(0); draw();
      const feet = placedPoses().map(bodies => project([...bodies[0].p.slice(0, 2), 0])[1]);
      const controls = [...document.querySelectorAll("button, select, input, summary")];
      const named = e => e.textContent.trim() || e.ariaLabel || (e.labels && e.labels.length);
      const wide = document.documentElement.scrollWidth, without = controls.filter(e => !named(e));
      return [Math.max(...feet) / devicePixelRatio, el("bar").getBoundingClientRect().top,
        wide, innerWidth, without.length];"""
    feet, bar, wide, width, unnamed = asked(text, script, tmp_path, f"--window-size={size}")
    assert feet < bar
    assert wide <= width
    assert unnamed == 0


def test_a_replay_that_is_laid_out_late_begins_all_the_same(text: str, tmp_path: Path) -> None:
    """A phone opens the report's page with a frame that has no size yet."""
    script = """
      canvas.width = 0; drawn = ""; drawnAt = 0;
      let asks = 0; requestAnimationFrame = () => ++asks;
      tick(1000); const hidden = [asks, drawn];
      size(); tick(2000);
      return [...hidden, asks, drawn !== ""];"""
    assert asked(text, script, tmp_path) == [1, "", 2, True]
