"""A browser without a window, driven through its DevTools protocol: pictures of a page, and the tests of it.

Chromium draws by software here (SwiftShader), so that no graphics card is needed.
"""

from __future__ import annotations

import base64
import contextlib
import json
import pathlib
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from typing import Any

from wbc.viewer.errors import ViewerError

#: Names of the program
PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OPTIONS = (
    "--headless=new",
    "--no-first-run",
    "--no-default-browser-check",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-dev-shm-usage",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--mute-audio",
    "--remote-debugging-port=0",
)
STARTING = 60.0


def program() -> str | None:
    """The browser that is installed, or None."""
    return next((found for name in PROGRAMS if (found := shutil.which(name))), None)


class Chromium:
    """A browser process; a context manager.

    Raises:
        ViewerError: no Chromium is installed, or it did not start.
    """

    def __init__(self, size: tuple[int, int] = (1280, 760)) -> None:
        found = program()
        if found is None:
            raise ViewerError("chromium", None, "is not installed: apt-get install chromium", list(PROGRAMS))
        self._folder = tempfile.TemporaryDirectory(prefix="wbc-chromium-", ignore_cleanup_errors=True)
        folder = pathlib.Path(self._folder.name)
        # A container runs as root, where the sandbox of the browser cannot
        command = [found, *OPTIONS, "--no-sandbox", f"--user-data-dir={folder}", f"--window-size={size[0]},{size[1]}"]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        port_file, until = folder / "DevToolsActivePort", time.monotonic() + STARTING
        while not (port_file.is_file() and port_file.read_text().count("\n")):
            if self._process.poll() is not None or time.monotonic() > until:
                self.close()
                raise ViewerError("chromium", found, "did not start")
            time.sleep(0.05)
        self._port = int(port_file.read_text().split()[0])
        self._pages: list[Page] = []

    def open(self, url: str) -> Page:
        """A page of its own, as in another tab."""
        address = f"http://127.0.0.1:{self._port}/json/new?about:blank"
        with urllib.request.urlopen(urllib.request.Request(address, method="PUT"), timeout=STARTING) as answer:
            about = json.load(answer)
        page = Page(about["webSocketDebuggerUrl"])
        self._pages.append(page)
        page.call("Page.enable")
        page.call("Runtime.enable")
        page.call("Page.navigate", url=url)
        return page

    def close(self) -> None:
        """End the browser."""
        for page in getattr(self, "_pages", []):
            page.close()
        self._process.terminate()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._folder.cleanup()

    def __enter__(self) -> Chromium:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Page:
    """One tab."""

    def __init__(self, address: str) -> None:
        from websockets.sync.client import connect

        self._socket = connect(address, max_size=None, compression=None, ping_interval=None)
        self._number = 0
        #: errors and messages of the page's console
        self.console: list[str] = []

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A command of the protocol and its answer.

        Raises:
            ViewerError: the browser says that it failed.
        """
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            said = json.loads(self._socket.recv(timeout=STARTING))
            self._note(said)
            if said.get("id") == self._number:
                if "error" in said:
                    raise ViewerError(method, parameters, str(said["error"].get("message")))
                result: dict[str, Any] = said["result"]
                return result

    def evaluate(self, script: str) -> Any:
        """The value of an expression of JavaScript; a promise is waited for.

        Raises:
            ViewerError: it threw.
        """
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            details = result["exceptionDetails"]
            raise ViewerError("script", script[:80], str(details.get("exception", details).get("description", details)))
        return result["result"].get("value")

    def wait(self, condition: str, seconds: float = 30.0) -> Any:
        """Until an expression is true; its value.

        Raises:
            ViewerError: it did not become true.
        """
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            with contextlib.suppress(ViewerError):
                if value := self.evaluate(condition):
                    return value
            time.sleep(0.05)
        raise ViewerError("page", condition, f"did not become true in {seconds:g} s; console: {self.console[-3:]}")

    def mouse(self, kind: str, x: float, y: float, held: bool = False) -> None:
        """``mouseMoved``, ``mousePressed`` or ``mouseReleased`` at a place of the page [pixels]."""
        button = {"button": "left", "buttons": int(held), "clickCount": int(kind != "mouseMoved")}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, pointerType="mouse", **button)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 12, pause: float = 0.03) -> None:
        """Press, move in steps, and release."""
        self.mouse("mouseMoved", start[0], start[1])
        time.sleep(0.15)
        self.mouse("mousePressed", start[0], start[1], held=True)
        for k in range(1, steps + 1):
            share = k / steps
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self.mouse("mouseMoved", x, y, held=True)
            time.sleep(pause)
        self.mouse("mouseReleased", end[0], end[1])

    def click(self, selector: str) -> None:
        """In the middle of an element."""
        box = self.evaluate(
            f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            " return [b.x + b.width / 2, b.y + b.height / 2]; })()"
        )
        x, y = (float(number) for number in box)
        self.mouse("mousePressed", x, y, held=True)
        self.mouse("mouseReleased", x, y)

    def key(self, code: str, down: bool) -> None:
        """A key goes down or up."""
        self.call("Input.dispatchKeyEvent", type="keyDown" if down else "keyUp", code=code, key=code)

    def picture(self) -> bytes:
        """The page as a PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        """Let go of the tab."""
        self._socket.close()

    def _note(self, said: dict[str, Any]) -> None:
        if said.get("method") == "Runtime.exceptionThrown":
            self.console.append(str(said["params"]["exceptionDetails"].get("exception", {}).get("description")))
        elif said.get("method") == "Runtime.consoleAPICalled" and said["params"]["type"] in ("error", "warning"):
            self.console.append(" ".join(str(a.get("value", "")) for a in said["params"]["args"]))


@contextlib.contextmanager
def page(url: str, size: tuple[int, int] = (1280, 760)) -> Iterator[Page]:
    """A browser with one page."""
    with Chromium(size) as browser:
        yield browser.open(url)
