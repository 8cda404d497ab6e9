"""What a window and a page show of a session."""

import http.client
import json
import multiprocessing
import socket
import threading

import numpy as np
import pytest

import spark_sim
from robots.stream.frame_targets import Frame
from sim.view.controls import help_rows, press
from sim.view.page import page
from spark.errors import ConventionError
from spark_sim.live import viewer as module
from spark_sim.live.page import server
from spark_sim.live.viewer import Board, Viewer, live_player


@pytest.fixture(scope="module")
def person(tmp_path_factory: pytest.TempPathFactory) -> spark_sim.AnyClip:
    paths = spark_sim.sample(tmp_path_factory.mktemp("sample"))
    return spark_sim.load(next(path for path in paths if path.stem == "walker_walk"))


@pytest.fixture
def board(person: spark_sim.AnyClip) -> Board:
    context = multiprocessing.get_context("spawn")
    robot = spark_sim.load("robot")
    pose = context.RawArray("d", 3 + 4 * len(person.motion.skeleton))
    qpos = context.RawArray("d", len(robot.qpos[0]))
    return Board(pose, qpos, context.RawArray("c", 200), context.RawValue("q", 0))


def show(board: Board, person: spark_sim.AnyClip, frame: int, at: tuple[float, float]) -> None:
    motion, qpos = person.motion, spark_sim.load("robot").qpos[0].copy()
    qpos[:2] += at
    root = motion.root_pos[frame] + np.array([*at, 0.0])
    board.write(Frame(root, motion.rotations[frame]), qpos, f"frame {frame}")


def test_figures_stand_side_by_side_and_walk_on(person: spark_sim.AnyClip, board: Board) -> None:
    player, figures = live_player(person.motion.frames(0, 1), "robot", board)
    assert [figure.label for figure in figures] == ["person", "robot"]
    player.qpos()
    assert "waits" in player.status
    show(board, person, 0, (50.0, -20.0))  # wherever they are, they are in the picture
    first = player.qpos().copy()
    assert player.status == "frame 0"
    lanes = [placement.lane for placement in player.scene.placements]
    roots = [first[placement.columns][:2] for placement in player.scene.placements]
    np.testing.assert_allclose(roots, [[0.0, lane] for lane in lanes], atol=1e-9)
    show(board, person, 0, (50.5, -20.0))
    on = player.qpos().copy()
    for placement in player.scene.placements:
        way = on[placement.columns][:2] - first[placement.columns][:2]
        np.testing.assert_allclose(np.hypot(*way), 0.5, atol=1e-9)
    assert np.isfinite(player.target()).all()
    board.write(Frame(np.full(3, np.nan), person.motion.rotations[0]), np.full(36, np.nan), "x")
    np.testing.assert_array_equal(player.qpos(), on)  # what is no number shows the last


def test_a_page_gets_coordinates_as_they_come(person: spark_sim.AnyClip, board: Board) -> None:
    player, figures = live_player(person.motion.frames(0, 1), "robot", board)
    text = page(figures, title="live", live=True)
    assert "connect-src" in text
    with server(("127.0.0.1", 0), text, player) as made:
        port = made.server_address[1]
        thread = threading.Thread(target=made.serve_forever, args=(0.05,))
        thread.start()
        try:
            asked = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
            asked.request("GET", "/")
            assert asked.getresponse().read().decode() == text
            show(board, person, 0, (0.0, 0.0))
            asked.request("GET", "/live")
            stream = asked.getresponse()
            lines = (stream.readline().decode() for _ in range(10_000))
            told = (json.loads(line[6:]) for line in lines if line.startswith("data: "))
            first = next(told)
            assert [len(q) for q in first["figures"]] == [
                placement.columns.stop - placement.columns.start
                for placement in player.scene.placements
            ]
            show(board, person, 30, (0.3, 0.0))
            assert any(now["words"] == "frame 30" for now in told)
            stream.close()
            asked.close()
            for host in ("evil.example", "["):
                other = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
                other.request("GET", "/live", headers={"Host": host})
                assert other.getresponse().status == 403
                other.close()
        finally:
            made.shutdown()
            thread.join(20)


def test_addresses_and_displays_that_are_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(ConventionError, match="--address HOST:PORT"),
    ):
        Viewer(("127.0.0.1", taken.getsockname()[1]))
    monkeypatch.setattr(module, "has_display", lambda: False)
    with pytest.raises(spark_sim.SparkSimError, match="--serve"):
        Viewer()


def test_the_help_of_a_session_has_no_keys_of_a_replay(
    person: spark_sim.AnyClip, board: Board
) -> None:
    player, figures = live_player(person.motion.frames(0, 1), "robot", board)
    words = [word for _, word in help_rows(live=True)]
    assert "close" in words
    assert "play, pause" not in words
    assert not press(player, "space")
    assert player.timeline.playing
    for key, name in (("t", "names"), ("o", "overlaid")):
        before = player.shown[name]
        assert press(player, key)
        assert player.shown[name] != before
    text = page(figures, title="live", live=True)
    assert words[0] in text
    assert "next, previous finding" not in text
