"""Pages in headless Chromium."""

import base64
import hashlib
import html
import json
import os
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

_QUIET = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-sync "
    "--disable-background-networking --disable-component-update --virtual-time-budget=1000"
)

# Of a page that draws all the time: eight seconds, in a window small enough for a CPU to fill.
LONG = ("--virtual-time-budget=8000", "--window-size=200,150")

# The replay in a page's frame stands still: it draws when asked to, and messages between the two
# arrive at once. No clock, no race.
STILL_REPLAY = """
  const replayed = document.getElementById("replay").contentWindow;
  const inside = code => replayed.eval(code);
  const deliver = (to, from) => data =>
    to.dispatchEvent(new to.MessageEvent("message", { data, source: from }));
  addEventListener("load", () => {
    inside("requestAnimationFrame = () => 0");
    replayed.postMessage = deliver(replayed, window);
    window.postMessage = deliver(window, replayed);
  });"""


def chromium() -> str:
    """The browser; skips the test without one."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if found is None:
        assert "CI" not in os.environ, "CI installs chromium"
        pytest.skip("chromium is not installed")
    return found


def opened(text: str, folder: Path, *flags: str) -> Any:
    """What a page leaves in `document.body.dataset.result`, as JSON, in its first second, in a
    browser with these flags."""
    path = folder / "probe.html"
    path.write_text(text, encoding="utf-8")
    ran = subprocess.run(
        [
            chromium(),
            *_QUIET.split(),
            *flags,
            f"--user-data-dir={folder}",
            "--dump-dom",
            path.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    found = re.search(r'data-result="([^"]*)"', ran.stdout)
    assert found, ran.stderr[-500:]
    return json.loads(html.unescape(found[1]))


def with_probe(text: str, script: str) -> str:
    """A page that runs one more script at its end; its policy, and that of its frame, let it."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    head, _, _ = text.rpartition("</html>")
    head = head.replace("script-src ", f"script-src 'unsafe-eval' 'sha256-{digest}' ")
    return f"{head}<script>{script}</script></html>"


def watched(text: str) -> str:
    """A page, its policy as it is, that tells what it came to: the errors and breaches of the
    policy, its title, and whether its replay told the time."""
    script = """
      const seen = [];
      addEventListener("error", e => seen.push(String(e.message)), true);
      addEventListener("securitypolicyviolation", e => seen.push(e.violatedDirective));
      const probe = tries => {
        const frame = document.getElementById("replay"), inner = frame && frame.contentDocument;
        const time = (inner || document).getElementById("time")?.textContent;
        // A busy machine draws late.
        if (time === "" && tries) return setTimeout(probe, 100, tries - 1);
        document.body.dataset.result = JSON.stringify({seen, title: document.title, time});
        // Nothing more is drawn: what is left of the time passes at once.
        for (const own of [window, frame && frame.contentWindow])
          if (own) own.requestAnimationFrame = () => 0;
      };
      addEventListener("load", () => setTimeout(probe, 300, 50));"""
    before, meta, after = text.partition('<meta http-equiv="Content-Security-Policy"')
    return f"{before}<script>{script}</script>{meta}{after}"


class Elements(HTMLParser):
    """The elements of a page with their attributes' names, and the texts between."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, tuple[str, ...]]] = []
        self.texts: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, tuple(name for name, _ in attrs)))

    def handle_data(self, data: str) -> None:
        self.texts.append(data)
