"""`spark-sim play --serve`, over HTTP as a browser speaks it."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest

from spark_sim.api import sample
from spark_sim.commands.studio import MAX_UPLOAD, address

CHECKOUT = Path(__file__).parents[2]


class Server:
    """A server of its own process, with a folder for temporary files of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-m", "spark_sim", "play", "--serve", "--address", "127.0.0.1:0"],
            cwd=CHECKOUT,
            env=os.environ | {"PYTHONPATH": str(CHECKOUT), "TMPDIR": str(folder)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )
        assert self.process.stdout is not None
        self.host = self.process.stdout.readline().split()[0].removeprefix("http://")

    def ask(
        self, method: str, path: str, body: bytes | None = None, **headers: str
    ) -> tuple[int, Any]:
        connection = HTTPConnection(self.host, timeout=120)
        connection.request(method, path, body, headers)
        reply = connection.getresponse()
        text = reply.read().decode()
        connection.close()
        kind = reply.getheader("Content-Type", "")
        return reply.status, json.loads(text) if "json" in kind else text


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    made = Server(tmp_path_factory.mktemp("tmp"))
    yield made
    made.process.send_signal(signal.SIGINT)
    _, told = made.process.communicate(timeout=60)
    assert made.process.returncode == 0, told
    assert told == ""
    assert list(made.folder.iterdir()) == []  # what was uploaded is gone


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    made = sample(tmp_path_factory.mktemp("samples"))
    return next(path for path in made if path.name == "walker_walk.bvh").read_bytes()


def test_a_file_is_shown_and_retargeted(server: Server, walk: bytes) -> None:
    status, shell = server.ask("GET", "/")
    assert status == 200
    assert "Drop a motion here" in shell
    _, start = server.ask("GET", "/start")
    assert "robot" in start["targets"]
    status, made = server.ask("POST", "/upload?name=..%2F..%2Fmy%20walk.bvh", walk)
    assert status == 200
    assert made["name"] == "my walk"
    status, page = server.ask("GET", f"/page/{made['page']}")
    assert status == 200
    assert "my walk" in page
    status, result = server.ask("POST", f"/retarget?clip={made['clip']}&target=robot", b"")
    assert status == 200
    _, report = server.ask("GET", f"/page/{result['page']}")
    assert "of the frames are implausible" in report
    left = [path for path in server.folder.rglob("*") if path.is_file()]
    assert left == []  # read, and removed


def test_what_is_refused(server: Server, walk: bytes) -> None:
    for name, body in (("walk.pkl", walk), ("walk", walk), ("broken.bvh", b"HIERARCHY\n nonsense")):
        status, told = server.ask("POST", f"/upload?name={name}", body)
        assert status == 400
        assert "expected" in told["error"]
    status, told = server.ask("POST", "/retarget?clip=77&target=robot", b"")
    assert (status, "drop it again" in told["error"]) == (400, True)
    status, made = server.ask("POST", "/upload?name=a.bvh", walk)
    status, told = server.ask("POST", f"/retarget?clip={made['clip']}&target=/etc/passwd", b"")
    assert (status, "no target" in told["error"]) == (400, True)
    assert server.ask("GET", "/page/../start")[0] == 404


def test_sizes_are_bounded_before_they_are_read(server: Server) -> None:
    headers = {"Content-Length": str(MAX_UPLOAD + 1)}
    status, told = server.ask("POST", "/upload?name=a.bvh", b"", **headers)
    assert (status, "at most" in told["error"]) == (413, True)


def test_no_other_site_may_ask(server: Server) -> None:
    for headers in (
        *({"Host": "evil.example"}, {"Origin": "http://evil.example"}),
        *({"Host": "["}, {"Host": "[::1"}, {"Origin": "http://["}),
    ):
        for method, path in (("GET", "/start"), ("POST", "/upload?name=a.bvh")):
            assert server.ask(method, path, b"", **headers)[0] == 403


@pytest.mark.parametrize(
    "text", ["localhost", ":80", "localhost:x", "localhost:99999", "h:²", "h:" + "9" * 5000]
)
def test_addresses_that_are_none(text: str) -> None:
    with pytest.raises(Exception, match="HOST:PORT"):
        address(text)
    assert address("0.0.0.0:80") == ("0.0.0.0", 80)
    assert address("[::1]:80") == ("::1", 80)
