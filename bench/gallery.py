"""Pictures of the viewer's presets: ``python -m bench.gallery [PRESET ...]`` draws them in a browser without a window.

Each preset's first target is led round a loop, at the controller's own pace and not in real time, so that a slow
machine draws the same film.
"""

from __future__ import annotations

import io
import math
import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
from PIL import Image

from bench.pool import ROOT
from wbc.viewer import show
from wbc.viewer.chromium import Chromium, Page
from wbc.viewer.presets import PRESETS, playground

FOLDER = ROOT / "docs" / "images"
SIZE, PAGE, WINDOW = (480, 360), (1040, 620), (960, 810)
#: Pictures of a loop, its seconds, and colours
FRAMES, SECONDS, COLOURS = 16, 6.0, 128
#: Part of a page without viser's own bar [pixels]
CUT = (0, 30, 960, 720)
#: Radii of the loop [m], where they are not those of an arm
RADII = {"ssrms": 2.0, "walker": 0.15, "mobile": 0.5}


def film(browser: Chromium, name: str) -> Path:
    """One preset, its first task with a place led round."""
    chosen = playground(name)
    controller, q = chosen.stack.compile(), chosen.start
    controller.reset(q)
    task = next(e.name for e in chosen.stack.tasks if type(e.item).__name__ == "EndEffector")
    home, radius = controller[task].target, RADII.get(name, 0.12)
    dt, pictures = chosen.stack.dt, []
    with show(controller, open_browser=False, silence=60.0) as viewer:
        page = browser.open(f"{viewer.url}?bare&watch")
        number = 0
        for frame in range(FRAMES + 1):
            for _ in range(round(SECONDS / FRAMES / dt)):
                turn = 2 * math.pi * number * dt / SECONDS
                off = radius * np.array([0.0, math.sin(turn), 1.0 - math.cos(turn)])
                pose = isinstance(home, pin.SE3)
                controller[task].target = pin.SE3(home.rotation, home.translation + off) if pose else home + off
                step = controller.step(q)
                q = chosen.stack.robot.integrate(q, step.v, dt)
                number += 1
            viewer.update(step)
            if frame == 0:
                page.wait("wbc.state", 60.0)
                page.wait("!!document.getElementById('scene').contentDocument.querySelector('canvas')", 60.0)
                undisturbed(page)
            page.wait(f"wbc.state.number >= {frame + 1}", 60.0)
            time.sleep(0.6)
            pictures.append(Image.open(io.BytesIO(page.picture())).convert("RGB"))
    file = FOLDER / f"play_{name.replace('-', '_')}.gif"
    return save([picture.crop(CUT).resize(SIZE) for picture in pictures[1:]], file)


def held_back(browser: Chromium) -> Path:
    """The whole page, with a hand that was dragged into a ball."""
    chosen = playground("panda")
    controller, q = chosen.stack.compile(), chosen.start
    controller.reset(q)
    home = controller["hand"].target
    with show(controller, open_browser=False, silence=60.0) as viewer:
        page = browser.open(viewer.url)
        until = time.monotonic() + 12.0
        controller["hand"].target = pin.SE3(home.rotation, home.translation + [0.12, 0.42, -0.05])
        while time.monotonic() < until or not explained(page):
            step = controller.step(q)
            viewer.update(step)
            q = chosen.stack.robot.integrate(q, step.v, chosen.stack.dt)
            time.sleep(chosen.stack.dt)
        undisturbed(page)
        (FOLDER / "viewer.png").write_bytes(page.picture())
    return FOLDER / "viewer.png"


def undisturbed(page: Page) -> None:
    """Nothing is drawn any more, and viser has said what it says of software that draws."""
    page.evaluate(
        "document.getElementById('scene').contentDocument"
        ".querySelectorAll('.mantine-Notification-closeButton').forEach((b) => b.click())"
    )
    # A page fades in, which takes a minute where software draws on a busy machine
    before, until = 256.0, time.monotonic() + 150.0
    while time.monotonic() < until:
        time.sleep(4.0)
        shown = np.asarray(Image.open(io.BytesIO(page.picture())).convert("L"), dtype=float)
        scene = shown[: int(0.8 * shown.shape[0]), : int(0.6 * shown.shape[1])]
        if np.percentile(scene, 2) < 170.0 and abs(scene.mean() - before) < 0.2:
            return
        before = float(scene.mean())


def explained(page: Page) -> bool:
    """The page says what is in the way."""
    return bool(page.evaluate("!!wbc.state && (wbc.state.sentences || []).some((s) => s.includes('ball/'))"))


def save(frames: list[Image.Image], file: Path) -> Path:
    """Pictures of one palette."""
    palette = frames[len(frames) // 2].quantize(COLOURS, method=Image.Quantize.FASTOCTREE)
    reduced = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    between = round(1000 * SECONDS / FRAMES)
    reduced[0].save(file, save_all=True, append_images=reduced[1:], duration=between, loop=0)
    return file


def main() -> None:
    """Those that are named, or all."""
    wanted = sys.argv[1:] or ["page", *PRESETS]
    for name in wanted:
        with Chromium(PAGE if name == "page" else WINDOW) as browser:
            print(held_back(browser) if name == "page" else film(browser, name), flush=True)


if __name__ == "__main__":
    main()
