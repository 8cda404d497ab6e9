"""How long `spark-sim play --serve` takes from the drop of a file until the figure moves.

    python scripts/time_drop.py dance.bvh

A server of its own and a headless Chromium: the file is dropped onto the page three times, by an
event as a mouse makes it, each after the report of the one before. The figure moves when the
replay's clock does, which is drawn with it.
"""

import base64
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import spark_sim

_DROP = """new Promise((done, failed) => {
  const bytes = Uint8Array.from(atob("CONTENT"), c => c.charCodeAt(0));
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([bytes], "NAME"));
  const frame = document.getElementById("view"), before = frame.src, start = performance.now();
  document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
  const look = () => {
    const told = document.getElementById("told");
    if (told.className === "bad") return failed(new Error(told.textContent));
    const clock = frame.src !== before && frame.contentDocument?.getElementById("time");
    if (clock && parseFloat(clock.textContent) > 0) done((performance.now() - start) / 1000);
    else setTimeout(look, 5);
  };
  look();
})"""

_REPORTED = """new Promise(done => {
  const look = () => / in [\\d.]+ s/.test(document.getElementById("told").textContent)
    ? done(null) : setTimeout(look, 20);
  look();
})"""


class Browser:
    """A page in headless Chromium, driven through a pipe (the DevTools protocol)."""

    def __init__(self, folder: Path) -> None:
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        if program is None:
            sys.exit("no chromium is installed")
        reads, self._out = os.pipe()
        self._in, writes = os.pipe()

        def pipes() -> None:
            os.dup2(reads, 3), os.dup2(writes, 4)

        flags = ("--headless", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run")
        self.process = subprocess.Popen(
            [program, *flags, "--enable-unsafe-swiftshader", f"--user-data-dir={folder}"],
            preexec_fn=pipes,
            close_fds=False,
            stderr=subprocess.DEVNULL,
        )
        self._buffer, self._count, self._session = b"", 0, None
        target = self._ask("Target.createTarget", url="about:blank")["targetId"]
        attached = self._ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]

    def open(self, url: str) -> None:
        """Go to an address, and wait until its list of targets is there."""
        self._ask("Page.navigate", url=url)
        while not self.run("document.getElementById('target')?.length || 0"):
            time.sleep(0.05)

    def run(self, script: str) -> Any:
        """The value of an expression, or of its promise."""
        reply = self._ask(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in reply:
            sys.exit(reply["exceptionDetails"]["exception"].get("description", "the page failed"))
        return reply["result"].get("value")

    def _ask(self, method: str, **params: object) -> Any:
        self._count += 1
        message = {"id": self._count, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        for reply in self._replies():
            if reply.get("id") == self._count:
                return reply["result"]
        sys.exit("chromium has gone")

    def _replies(self) -> Iterator[Any]:
        while chunk := os.read(self._in, 1 << 16):
            *whole, self._buffer = (self._buffer + chunk).split(b"\0")
            yield from map(json.loads, whole)


@contextmanager
def served() -> Iterator[str]:
    """A server on a free port, and its address."""
    command = (sys.executable, "-m", "spark_sim", "play", "--serve", "--address", "localhost:0")
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            yield server.stdout.readline().split()[0]
        finally:
            server.terminate()


def main() -> None:
    """Print the time of each of the drops."""
    parser = ArgumentParser(description=__doc__, usage="%(prog)s FILE")
    parser.add_argument("file", type=Path)
    file = parser.parse_args().file
    clip = spark_sim.load(file)
    content = base64.b64encode(file.read_bytes()).decode()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, served() as url:
        browser = Browser(Path(folder))
        try:
            browser.open(url)
            script = _DROP.replace("CONTENT", content).replace("NAME", file.name)
            times = []
            for _ in range(3):
                times.append(browser.run(script))
                browser.run(_REPORTED)
        finally:
            with suppress(ProcessLookupError):
                browser.process.terminate()
            browser.process.wait()
    told = ", ".join(f"{each:.2f}" for each in times)
    print(f"{file.name}: {clip.duration:.1f} s of motion move after {told} s")


if __name__ == "__main__":
    main()
