"""The walker and arms that are driven by pairs, in a browser without a window: what is pressed moves them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.chromium import Chromium, Page
from wbc.climb.request import ClimberRequest, SceneRequest
from wbc.viewer import Viewer
from wbc.viewer.climbing import climb, standing
from wbc.viewer.operating import operate

PICTURES = Path(__file__).parents[2] / "build" / "viewer"
SIZE = (760, 520)
#: Longest that a loop runs that nobody ends [s]
LONGEST = 240.0


class Playing(threading.Thread):
    """One kind of play, as ``wbc view play`` starts it."""

    def __init__(self, begin: Callable[..., None], *given: Any) -> None:
        super().__init__()
        self._begin, self._given, self.ready = begin, given, threading.Event()
        self.viewer: Viewer | None = None
        self.start()
        assert self.ready.wait(120.0)

    def run(self) -> None:
        def announce(viewer: Viewer) -> None:
            self.viewer = viewer
            self.ready.set()

        self._begin(*self._given, LONGEST, open_browser=False, silence=30.0, announce=announce)

    def end(self) -> None:
        assert self.viewer is not None
        self.viewer._process.terminate()
        self.join()


@pytest.fixture
def browser() -> Iterator[Chromium]:
    with Chromium(SIZE) as running:
        yield running


def opened(browser: Chromium, playing: Playing) -> Page:
    assert playing.viewer is not None
    page = browser.open(playing.viewer.url)
    page.wait("wbc.state && wbc.operator === wbc.me", 60.0)
    page.wait("!!document.getElementById('scene').contentDocument.querySelector('canvas')", 60.0)
    return page


def picture(page: Page, name: str) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    (PICTURES / f"{name}.png").write_bytes(page.picture())


def middle(page: Page, selector: str) -> tuple[float, float]:
    x, y = page.evaluate(
        f"(() => {{ const b = document.querySelector('{selector}').getBoundingClientRect();"
        " return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    return x, y


def slide(page: Page, row: int, way: int) -> None:
    """The slider of a commanded row to one of its ends."""
    page.evaluate(
        f"(() => {{ const s = document.querySelectorAll('#rows input')[{row}]; s.value = {way}; s.oninput(); }})()"
    )


def test_the_stick_moves_the_walker_and_a_hand_is_moved_alone(browser: Chromium) -> None:
    playing = Playing(
        lambda seconds, **options: climb(*standing(ClimberRequest(), SceneRequest()), seconds, backend="vm", **options)
    )
    try:
        page = opened(browser, playing)
        # One hand alone, chosen in one step: a state that comes in between writes the list back
        page.evaluate("(() => { const a = document.getElementById('arm'); a.value = 'arm1'; a.onchange(); })()")
        page.wait("wbc.state.walk.arm === 'arm1'", 60.0)
        page.key("KeyR", True)
        page.wait("wbc.state.speed > 0.01", 60.0)
        time.sleep(2.0)
        page.key("KeyR", False)
        page.wait("wbc.state.speed < 1e-3", 60.0)
        picture(page, "7 one hand")
        page.evaluate("(() => { const a = document.getElementById('arm'); a.value = ''; a.onchange(); })()")
        page.wait("wbc.state.walk.arm === ''", 60.0)
        begin = page.evaluate("wbc.state.q.slice(0, 3)")
        off = f"Math.hypot(...wbc.state.q.slice(0, 3).map((x, k) => x - {begin}[k]))"
        x, y = middle(page, "#knob")
        page.mouse("mouseMoved", x, y)
        page.mouse("mousePressed", x, y, held=True)
        page.mouse("mouseMoved", x, y - 50.0, held=True)
        # Along the structure once the hand holds again, with the hold of the next hand told as reserved
        page.wait(f"{off} > 0.03", 60.0)
        page.wait("wbc.state.walk.reserved.length > 0", 60.0)
        time.sleep(1.0)
        picture(page, "8 walker")
        page.mouse("mouseReleased", x, y - 50.0)
        page.wait("wbc.state.speed < 1e-4", 60.0)
        assert not [line for line in page.console if "Error" in line]
    finally:
        playing.end()


#: An elbow nearly straight: the tip going up makes it straight in some seconds
NEARLY = [3.66, -2.58, -3.54, -0.35, 0.81, 0.51, 2.92]
#: The same of two arms on one: where nine seconds of the slider bring it from its usual start
BENT = [2.058, -1.369, 0.19, 0.548, 2.521, -3.747, -2.337, 2.559, 0.643, 3.769, -0.491, -0.88, -1.824, -2.532, 1.421]


@pytest.mark.parametrize(("robot", "start", "row", "way"), [("ssrms", NEARLY, 2, 1), ("spdm", BENT, 1, -1)])
def test_an_arm_is_driven_by_pairs_and_warned_in_the_page(
    browser: Chromium, robot: str, start: list[float], row: int, way: int
) -> None:
    playing = Playing(lambda seconds, **options: operate(robot, seconds, start=start, backend="vm", **options))
    try:
        page = opened(browser, playing)
        first = page.evaluate("wbc.state.pair")
        # A slider moves the arm, and what is let go comes to rest
        slide(page, 2, 1)
        page.wait("wbc.state.speed > 0.003", 60.0)
        page.evaluate("document.querySelectorAll('#rows input')[2].onchange()")
        page.wait("wbc.state.speed < 1e-4", 60.0)
        # Swapped, and back
        page.wait("!document.getElementById('swap').disabled", 10.0)
        page.click("#swap")
        page.wait(f"wbc.state.pair !== {first!r}", 30.0)
        assert page.evaluate("document.getElementById('pair').value") == page.evaluate("wbc.state.pair")
        page.click("#swap")
        page.wait(f"wbc.state.pair === {first!r}", 30.0)
        # Driven on and on the page warns, seen in it, before the task gives way
        slide(page, row, way)
        page.wait("!document.getElementById('warning').hidden && wbc.state.sigma > wbc.state.least", 90.0)
        text = page.evaluate("document.getElementById('warning').textContent")
        assert "is near a locus" in text
        picture(page, f"9 warned {robot}")
        page.click("#stop")
        page.wait("wbc.state.stopped && wbc.state.speed < 1e-5", 60.0)
        assert not [line for line in page.console if "Error" in line]
    finally:
        playing.end()
