"""The viewer in a real browser. Pictures of every step are left in build/viewer."""

from __future__ import annotations

import functools
import io
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.chromium import Chromium, Page
from tests.processes import descendants, left
from tests.viewer import arms
from wbc.controller.step import state_of
from wbc.viewer import Viewer, show
from wbc.viewer.drawing import FIELD, GIZMO, viewpoint
from wbc.viewer.link import SharedTick
from wbc.viewer.tick import Tick

PICTURES = Path(__file__).parents[2] / "build" / "viewer"
SIZE = (940, 560)


class Loop(threading.Thread):
    """A control loop with a viewer, as a user writes it."""

    def __init__(self) -> None:
        super().__init__()
        self.controller = arms.fresh()
        self.q = self.controller.stack.robot.neutral
        self.viewer: Viewer = show(self.controller, open_browser=False, silence=30.0)
        self.over = threading.Event()
        self.fastest: list[float] = []

    def run(self) -> None:
        robot = self.controller.stack.robot
        while not self.over.is_set():
            step = self.controller.step(self.q)
            self.viewer.update(step)
            self.fastest.append(float(np.abs(step.v).max()))
            self.q = robot.integrate(self.q, step.v, arms.DT)
            time.sleep(arms.DT)

    def hand(self) -> np.ndarray:
        robot = self.controller.stack.robot
        return np.array(robot.pose(self.q, robot.frames["tip"]).translation)


@pytest.fixture
def loop() -> Iterator[Loop]:
    before = descendants()
    running = Loop()
    running.start()
    yield running
    running.over.set()
    running.join()
    running.viewer.close()
    # What a way round in the viewer's process has begun to compile ends by itself, some seconds later than that
    left(before, 60.0)


@functools.cache
def view() -> tuple[np.ndarray, np.ndarray]:
    """Eye and target of that camera, from a tick at rest."""
    controller = arms.fresh()
    step = controller.step(controller.stack.robot.neutral)
    return viewpoint(controller, Tick(controller, SharedTick(1, arms.DT, state_of(step))))


def pixel(page: Page, point: np.ndarray) -> tuple[float, float]:
    """Where a point of the world is in the page, by the camera that a page begins with."""
    eye, target = view()
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], back))
    x, y, depth = np.array([right, np.cross(back, right), back]) @ (point - eye)
    left, top, width, height = page.evaluate(
        "(() => { const b = document.getElementById('scene').getBoundingClientRect();"
        " return [b.x, b.y, b.width, b.height]; })()"
    )
    focal = height / 2 / np.tan(FIELD / 2)
    return left + width / 2 + focal * x / -depth, top + height / 2 - focal * y / -depth


def picture(page: Page, name: str) -> np.ndarray:
    PICTURES.mkdir(parents=True, exist_ok=True)
    content = page.picture()
    (PICTURES / f"{name}.png").write_bytes(content)
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"), dtype=int)


def drag_arrow(page: Page, at: np.ndarray, arrow: np.ndarray, by: float) -> None:
    """Take a gizmo by one of its arrows and pull along it."""
    begin = at + 0.75 * arrow
    end = begin + by * arrow / np.linalg.norm(arrow)
    page.drag(pixel(page, begin), pixel(page, end), steps=14, pause=0.06)


def test_the_hand_is_dragged_stopped_and_looked_back_at(loop: Loop) -> None:
    robot = loop.controller.stack.robot
    with Chromium(SIZE) as browser:
        page = browser.open(loop.viewer.url)
        page.wait("wbc.state && wbc.operator === wbc.me", 60.0)
        # It draws by software, so pictures may take long however short the silence
        patience = "(() => { const was = wbc.hello.silence; wbc.hello.silence = 1.0; const found = wbc.patience();"
        patience += " wbc.hello.silence = was; return [wbc.software, found]; })()"
        assert page.evaluate(patience) == [True, 20000]
        page.wait("!!document.getElementById('scene').contentDocument.querySelector('canvas')", 60.0)
        # The robot is seen where it is: its links are not of the colour of what is behind them, as at the view's edge
        until, seen = time.monotonic() + 60.0, 0.0
        places = [robot.pose(loop.q, f"panda_link{k}").translation for k in (1, 3, 4, 5, 6, 7)]
        while seen < 0.6 and time.monotonic() < until:
            time.sleep(0.5)
            image = picture(page, "1 robot")
            spots = [tuple(int(x) for x in pixel(page, place)) for place in places]
            edge = page.evaluate("document.getElementById('scene').clientWidth") - 8
            seen = float(np.mean([np.ptp(image[y, [x, edge]], axis=0).max() > 20 for x, y in spots]))
        assert seen >= 0.6
        page.wait("!wbc.state.stopped", 10.0)

        # The gizmo moves the hand, and where the ball is in the way the page says so
        start, scale = loop.hand(), GIZMO * robot.characteristic_length
        # The hand looks down, so that the arrow of its y points along -y of the world
        drag_arrow(page, start, np.array([0.0, -scale, 0.0]), -0.4)
        page.wait("wbc.state.items.hand.values.target[1] > 0.25", 30.0)
        page.wait("wbc.state.sentences.some((s) => s.startsWith('hand') && s.includes('ball/'))", 60.0)
        page.wait("document.getElementById('why').textContent.includes('ball/')", 30.0)
        page.wait("wbc.state.items.ball.binds", 30.0)
        picture(page, "2 held back")
        assert loop.hand()[1] > start[1] + 0.05
        assert page.evaluate("wbc.state.items.hand.residual.m") > 0.01

        # Stop stops, within the limits, and resume goes on from there
        page.evaluate("document.querySelector('#item-posture input[type=checkbox]').checked")
        page.evaluate("wbc.send({type: 'rate', item: 'hand', rate: [0, -0.2, 0, 0, 0, 0]})")
        time.sleep(0.3)
        page.click("#stop")
        page.wait("wbc.state.stopped && wbc.state.speed < 1e-6", 30.0)
        assert loop.viewer.stopped
        picture(page, "3 stopped")
        place = loop.hand()
        page.wait("!document.getElementById('resume').hidden", 10.0)
        page.click("#resume")
        page.wait("!wbc.state.stopped && wbc.state.items.hand.on", 30.0)
        assert np.linalg.norm(loop.hand() - place) < 5e-3

        # A slider of the posture, then the slider of time
        target = "wbc.state.items.posture.values.target[6]"
        page.evaluate(
            "(() => { const s = document.querySelectorAll('#postures input')[6]; s.value = 1.5;"
            " s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')); })()"
        )
        page.wait(f"Math.abs({target} - 1.5) < 1e-3", 30.0)
        page.evaluate(
            "(() => { const s = document.getElementById('slider'); s.value = s.min; s.oninput(); s.onchange(); })()"
        )
        page.wait("!wbc.state.timeline.live", 30.0)
        page.wait("wbc.state.t < wbc.state.timeline.end - 1", 30.0)
        assert abs(page.evaluate("wbc.state.items.hand.values.target[1]") - start[1]) < 0.05
        picture(page, "4 the past")
        page.click("#live")
        page.wait("wbc.state.timeline.live", 30.0)

        # Keys move the target
        before = page.evaluate("wbc.state.items.hand.values.target[2]")
        page.evaluate("document.body.focus()")
        page.key("KeyR", True)
        page.wait(f"wbc.state.items.hand.values.target[2] > {before} + 0.01", 30.0)
        page.key("KeyR", False)

        # A second page watches; a lost connection stops, and the page comes back by itself
        other = browser.open(loop.viewer.url)
        other.wait("wbc.state && wbc.operator !== '' && wbc.operator !== wbc.me", 60.0)
        page.evaluate("wbc.drop()")
        other.wait("wbc.state.stopped && wbc.operator === ''", 30.0)
        assert loop.viewer.stopped
        picture(other, "5 watching")
        # What is hidden by another tab does not draw
        page.call("Page.bringToFront")
        page.wait("wbc.open && wbc.state && wbc.state.stopped", 30.0)
        page.wait("!document.getElementById('resume').hidden", 30.0)
        page.click("#resume")
        page.wait("wbc.operator === wbc.me && !wbc.state.stopped", 30.0)
        picture(page, "6 back")
        assert not [line for line in page.console if "Error" in line]
