"""A session on a page in a browser: the replay's page, with coordinates as they come."""

import json
import os
import threading
import time
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from sim.view.live import LivePlayer
from spark_sim.web import LOCAL, host_name

_RATE = 30.0  # pictures a second


def server(address: tuple[str, int], text: str, player: LivePlayer) -> ThreadingHTTPServer:
    """What serves the page `text`, and what the player shows; `serve_forever` runs it."""
    lock = threading.Lock()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            """The page, or the coordinates, for as long as someone looks."""
            host = host_name(self.headers.get("Host", ""))
            if address[0] in LOCAL and host not in LOCAL:
                self.send_error(HTTPStatus.FORBIDDEN, "only the page itself may ask")
            elif self.path == "/":
                body = text.encode()
                self.send_response(HTTPStatus.OK)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(body)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(body)
            elif self.path == "/live":
                self.send_response(HTTPStatus.OK)
                self.send_header("Content-Type", "text/event-stream")
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                with suppress(OSError):  # who looked has gone
                    self._stream()
            else:
                self.send_error(HTTPStatus.NOT_FOUND)

        def _stream(self) -> None:
            self.wfile.write(b"retry: 500\n\n")
            while True:
                with lock:
                    row = player.qpos()
                    figures = [row[p.columns].round(5).tolist() for p in player.scene.placements]
                    now = {"session": os.getpid(), "figures": figures, "words": player.status}
                self.wfile.write(b"data: " + json.dumps(now).encode() + b"\n\n")
                time.sleep(1 / _RATE)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    made = ThreadingHTTPServer(address, Handler)
    made.daemon_threads = True
    return made
