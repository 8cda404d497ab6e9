"""Programs of others that judge what we write, from npm: Khronos' validator, three.js, three-vrm.

`make test` installs them where there is npm. Without them their tests are skipped, by name.
"""

import functools
import html
import http.server
import json
import re
import shutil
import subprocess
import threading
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest

from tests.helpers.browser import chromium

HERE = Path(__file__).parents[1] / "node"
_FLAGS = "--headless --no-sandbox --disable-gpu --virtual-time-budget=20000 --dump-dom"


def needs(*packages: str) -> None:
    """Skip the test where a package of `tests/node/package.json` is not there."""
    for package in packages:
        if shutil.which("node") is None or not (HERE / "node_modules" / package).exists():
            pytest.skip(f"{package} is not installed: npm install --prefix tests/node")


def validated(*paths: Path) -> list[list[dict[str, Any]]]:
    """What Khronos' validator has to say of each file; severity 0 is an error, 1 a warning."""
    needs("gltf-validator")
    done = subprocess.run(
        ["node", str(HERE / "validate.cjs"), *map(str, paths)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    found: list[list[dict[str, Any]]] = json.loads(done.stdout)
    return found


def in_three(page: str, folder: Path, **asked: str) -> Any:
    """What a page of `tests/node` says, in a browser, of files in `folder`."""
    needs("three", "@pixiv/three-vrm", "@pixiv/three-vrm-animation")

    class Handler(http.server.SimpleHTTPRequestHandler):
        def translate_path(self, path: str) -> str:
            name = path.partition("?")[0].lstrip("/")
            ours = name.startswith("node_modules/") or name == page
            return str((HERE if ours else folder) / name)

        def log_message(self, *args: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/{page}?{urlencode(asked)}"
        ran = subprocess.run(
            [chromium(), *_FLAGS.split(), f"--user-data-dir={folder / 'browser'}", address],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        server.shutdown()
    found = re.search(r'data-result="([^"]*)"', ran.stdout)
    assert found, ran.stderr[-500:]
    result = json.loads(html.unescape(found[1]))
    assert "error" not in result, result["error"]
    return result
