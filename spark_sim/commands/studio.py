"""`spark-sim play --serve`: a page on which files are dropped, retargeted and judged.

The page is `studio.html`; what it shows are the pages that `--html` writes.
"""

import json
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import parse_qs, unquote

from robots import registry
from sim.report import assess
from sim.report.page import report_page
from sim.template import Template
from sim.view.page import page
from spark.errors import ConventionError, SparkSimError, unforeseen
from spark_sim import api
from spark_sim.clips import AnyClip, Clip
from spark_sim.loading import load
from spark_sim.web import LOCAL, host_name, origin_host

_PAGE = Template("spark_sim.commands", "studio.html", ("studio.js",), server=True)
MAX_UPLOAD = 64 * 1024 * 1024  # bytes
UPLOADS = (".bvh", ".fbx", ".glb", ".gltf", ".vrm", ".vrma", ".c3d", ".trc", ".npz", ".npy")
_KEPT = 8  # clips and pages; the oldest are forgotten


class Studio:
    """What the page asks for. One thing is worked out at a time; uploads lie in `folder`, no longer
    than it takes to read them."""

    def __init__(self, folder: Path, clips: Sequence[AnyClip] = ()) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._clips: OrderedDict[str, AnyClip] = OrderedDict()
        self._pages: OrderedDict[str, str] = OrderedDict()
        self._count = 0
        self._characters = {clip.name: clip for clip in clips if isinstance(clip, Clip)}
        self._first = self._show(list(clips)) if clips else None

    def start(self) -> dict[str, Any]:
        """What the page begins with: the targets to choose from, and what is shown."""
        robots = [entry.name for entry in registry.ENTRIES if entry.path is not None]
        return {
            "targets": [*self._characters, *robots],
            "page": self._first,
            "most": MAX_UPLOAD,
            "endings": UPLOADS,
        }

    def upload(self, name: str, content: bytes) -> dict[str, Any]:
        """Read a file, and show it. Raises what reading raises."""
        ending = Path(name).suffix.lower()
        if ending not in UPLOADS:
            raise ConventionError(f"{name}: expected a file that ends in {' or '.join(UPLOADS)}")
        safe = re.sub(r"[^\w. -]", "_", Path(name).name)[-80:]
        with self._lock, TemporaryDirectory(dir=self._folder) as folder:
            path = Path(folder) / safe
            path.write_bytes(content)
            clip = load(path)
            return {"clip": self._keep(self._clips, clip), **self._shown(clip)}

    def retarget(self, key: str, target: str) -> dict[str, Any]:
        """Retarget a clip that was uploaded, and show the report of the result."""
        with self._lock:
            source = self._clips.get(key)
            if source is None:
                raise ConventionError("this file is forgotten by now; drop it again")
            if target not in self.start()["targets"]:
                raise ConventionError(f"there is no target {target!r} in the list")
            made = api.retarget(source, self._characters.get(target, target))
            assessed = assess(made.subject, source=source.subject)
            names = (made.name, source.name)
            text = report_page(assessed, made.subject, source.subject, title=made.name, names=names)
            return {"page": self._keep(self._pages, text), "notes": list(made.notes)}

    def page(self, key: str) -> str | None:
        """A page that was made, as text."""
        return self._pages.get(key)

    def _shown(self, clip: AnyClip) -> dict[str, Any]:
        return {"page": self._show([clip]), "notes": list(clip.notes), "name": clip.name}

    def _show(self, clips: list[AnyClip]) -> str:
        figures = [figure for clip in clips for figure in clip.figures()]
        return self._keep(self._pages, page(figures, title=" · ".join(c.name for c in clips)))

    def _keep(self, kept: "OrderedDict[str, Any]", value: object) -> str:
        self._count += 1
        kept[str(self._count)] = value
        if len(kept) > _KEPT:
            kept.popitem(last=False)
        return str(self._count)


def serve(host: str, port: int, clips: Sequence[AnyClip], ready: Callable[[str], object]) -> None:
    """Serve the page until Ctrl-C; `ready` is called with its address. Raises `ConventionError`
    where the address can't be used."""
    with TemporaryDirectory(prefix="spark-sim-") as folder:
        studio = Studio(Path(folder), clips)

        class Handler(_Handler):
            pass

        Handler.studio = studio
        Handler.names = (*LOCAL, host) if host in LOCAL else None
        try:
            server = ThreadingHTTPServer((host, port), Handler)
        except OSError as error:
            raise ConventionError(
                f"{host}:{port}: can't be served on ({error.strerror or error}); give another "
                "--address HOST:PORT"
            ) from error
        with server:
            server.daemon_threads = False
            ready(f"http://{host}:{server.server_address[1]}")
            with suppress(KeyboardInterrupt):
                server.serve_forever(poll_interval=0.1)


class _Handler(BaseHTTPRequestHandler):
    studio: Studio
    names: tuple[str, ...] | None
    """The hosts that the page may be called by; None for any."""

    timeout = 60  # [s] without a byte

    def do_GET(self) -> None:
        """The page, what it begins with, and the pages that it shows."""
        path = self.path.partition("?")[0]
        if not self._from_here():
            return
        if path == "/":
            text = _PAGE.render(title="spark-sim")
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", text.encode())
        elif path == "/start":
            self._send_json(HTTPStatus.OK, self.studio.start())
        elif (text_or_none := self.studio.page(path.removeprefix("/page/"))) is not None:
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", text_or_none.encode())
        else:
            self._send_json(HTTPStatus.NOT_FOUND, {"error": "there is no such page"})

    def do_POST(self) -> None:
        """An upload, or an order to retarget one."""
        path, _, query = self.path.partition("?")
        if not self._from_here():
            return
        given = {key: values[0] for key, values in parse_qs(query).items()}
        try:
            if path == "/upload":
                content = self._content()
                if content is None:
                    return
                answer = self.studio.upload(unquote(given.get("name", "")), content)
            elif path == "/retarget":
                answer = self.studio.retarget(given.get("clip", ""), given.get("target", ""))
            else:
                self._send_json(HTTPStatus.NOT_FOUND, {"error": "there is no such thing"})
                return
        except SparkSimError as error:
            self._send_json(HTTPStatus.BAD_REQUEST, {"error": str(error)})
        except Exception as error:
            told = {"error": unforeseen(error)}
            self._send_json(HTTPStatus.INTERNAL_SERVER_ERROR, told)
        else:
            self._send_json(HTTPStatus.OK, answer)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the page tells what there is to know."""

    def _content(self) -> bytes | None:
        """The body; None where it is refused, before it is read."""
        length = self.headers.get("Content-Length", "")
        if not length.isdigit():
            self._send_json(HTTPStatus.LENGTH_REQUIRED, {"error": "how long is the file?"})
            return None
        if int(length) > MAX_UPLOAD:
            told = f"the file has {int(length) / 1e6:.0f} MB; at most {MAX_UPLOAD / 1e6:.0f} MB"
            self.close_connection = True
            self._send_json(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, {"error": told})
            return None
        return self.rfile.read(int(length))

    def _from_here(self) -> bool:
        """Whether it is the page itself that asks: no other site may, through the user's browser,
        nor under a name of its own that leads here."""
        host = self.headers.get("Host", "")
        origin = self.headers.get("Origin")
        known = self.names is None or host_name(host) in self.names
        if known and (origin is None or origin_host(origin) == host):
            return True
        self._send_json(HTTPStatus.FORBIDDEN, {"error": "only the page itself may ask"})
        return False

    def _send_json(self, status: HTTPStatus, value: object) -> None:
        self._send(status, "application/json", json.dumps(value).encode())

    def _send(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        try:
            self.wfile.write(body)
        except OSError:  # who asked has gone
            self.close_connection = True


def address(text: str) -> tuple[str, int]:
    """HOST:PORT in its parts."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or len(port) > 5 or int(port) > 65535:
        raise ConventionError(f"--address {text}: expected HOST:PORT, such as localhost:8765")
    return host.strip("[]"), int(port)
