"""Pictures of the viewer: ``python -m bench.gallery [page] [presets] [PRESET ...]``, in a browser without a window.

``page`` is the page with a hand that is held back, ``presets`` a sheet of the other presets, and the name of a preset a
film: the preset's first target is led round a loop, at the controller's own pace and not in real time, so that a slow
machine draws the same film.
"""

from __future__ import annotations

import io
import math
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from PIL import Image, ImageDraw, ImageFont

from bench.pool import ROOT
from tests.chromium import Chromium, Page
from wbc.viewer import Viewer, show
from wbc.viewer.presets import PRESETS, Playground, playground

FOLDER = ROOT / "docs" / "images"
SIZE, CELL, PAGE, WINDOW = (480, 360), (380, 285), (1280, 807), (960, 810)
#: Pictures of a loop, its seconds, and colours
FRAMES, SECONDS, COLOURS = 16, 6.0, 128
#: Colours of a picture, and of the sheet
SHADES, FEW = 256, 192
#: Part of a page without viser's own bar [pixels]
CUT = (0, 30, 960, 720)
#: The page says what is in the way
EXPLAINED = "!!wbc.state && (wbc.state.sentences || []).some((s) => s.includes('ball/'))"
#: Standard deviation of a drawn scene's grey values, at the least
BUSY = 8.0
#: Radii of the loop [m], where they are not those of an arm
RADII = {"ssrms": 2.0, "walker": 0.15, "mobile": 0.5}


def film(browser: Chromium, name: str) -> Path:
    """One preset, its first task with a place led round."""
    chosen = playground(name)
    controller, q = chosen.stack.compile(), chosen.start
    controller.reset(q)
    task = led(chosen)
    home, radius = controller[task].target, RADII.get(name, 0.12)
    dt, pictures = chosen.stack.dt, []
    with show(controller, open_browser=False, silence=60.0) as viewer:
        page = browser.open(f"{viewer.url}?bare&watch")
        number = 0
        for frame in range(FRAMES + 1):
            for _ in range(round(SECONDS / FRAMES / dt)):
                turn = 2 * math.pi * number * dt / SECONDS
                off = radius * np.array([0.0, math.sin(turn), 1.0 - math.cos(turn)])
                controller[task].target = beside(home, off)
                step = controller.step(q)
                q = chosen.stack.robot.integrate(q, step.v, dt)
                number += 1
            viewer.update(step)
            if frame == 0:
                page.wait("wbc.state", 60.0)
                undisturbed(page)
            page.wait(f"wbc.state.number >= {frame + 1}", 60.0)
            time.sleep(0.6)
            pictures.append(shot(page))
    file = FOLDER / f"play_{name.replace('-', '_')}.gif"
    return save([picture.crop(CUT).resize(SIZE) for picture in pictures[1:]], file)


def held_back(browser: Chromium) -> Path:
    """The whole page, with a hand that was dragged into a ball, while the loop runs."""
    chosen = playground("panda")
    controller = chosen.stack.compile()
    controller.reset(chosen.start)
    home, over = controller["hand"].target, threading.Event()

    def loop(viewer: Viewer) -> None:
        q = chosen.start
        while not over.is_set():
            step = controller.step(q)
            viewer.update(step)
            q = chosen.stack.robot.integrate(q, step.v, chosen.stack.dt)
            time.sleep(chosen.stack.dt)

    with show(controller, open_browser=False, silence=60.0) as viewer:
        page = browser.open(viewer.url)
        running = threading.Thread(target=loop, args=(viewer,))
        controller["hand"].target = pin.SE3(home.rotation, home.translation + [0.12, 0.42, -0.05])
        running.start()
        try:
            page.wait(EXPLAINED, 60.0)
            undisturbed(page)
            shown = shot(page)
        finally:
            over.set()
            running.join()
    shown.quantize(SHADES, method=Image.Quantize.MEDIANCUT).save(FOLDER / "viewer.png", optimize=True)
    return FOLDER / "viewer.png"


def strip() -> Path:
    """Every preset but the first, each a second after its target was moved."""
    pictures = []
    for name in [*PRESETS][1:]:
        chosen = playground(name)
        controller, q = chosen.stack.compile(), chosen.start
        controller.reset(q)
        moved, off = led(chosen), 0.8 * RADII.get(name, 0.12) * np.array([0.5, 1.0, 0.3])
        home = controller[moved].target
        controller[moved].target = beside(home, off)
        for _ in range(round(1.0 / chosen.stack.dt)):
            step = controller.step(q)
            q = chosen.stack.robot.integrate(q, step.v, chosen.stack.dt)
        with Chromium(WINDOW) as browser, show(controller, open_browser=False, silence=60.0) as viewer:
            viewer.update(step)
            page = browser.open(f"{viewer.url}?bare&watch")
            page.wait("wbc.state", 60.0)
            undisturbed(page)
            shown = shot(page).crop(CUT).resize(CELL, Image.Resampling.LANCZOS)
        ImageDraw.Draw(shown).text((10, 8), f"wbc view play {name}", fill=(29, 39, 51), font=ImageFont.load_default(15))
        pictures.append(shown)
    sheet = Image.new("RGB", (3 * CELL[0], 2 * CELL[1]))
    for k, shown in enumerate(pictures):
        sheet.paste(shown, (k % 3 * CELL[0], k // 3 * CELL[1]))
    sheet.quantize(FEW, method=Image.Quantize.MEDIANCUT).save(FOLDER / "presets.png", optimize=True)
    return FOLDER / "presets.png"


def led(chosen: Playground) -> str:
    """The first task with a place."""
    return next(e.name for e in chosen.stack.tasks if type(e.item).__name__ == "EndEffector")


def beside(home: Any, off: np.ndarray) -> Any:
    """A target, a pose or a place, that is shifted [m]."""
    return pin.SE3(home.rotation, home.translation + off) if isinstance(home, pin.SE3) else home + off


def shot(page: Page) -> Image.Image:
    """What the page shows."""
    return Image.open(io.BytesIO(page.picture())).convert("RGB")


def undisturbed(page: Page) -> None:
    """The scene is drawn, and viser has said what it says of software that draws."""
    scene = "document.getElementById('scene').contentDocument"
    page.wait(f"!!{scene}.querySelector('canvas')", 60.0)
    drawn, until = 0.0, time.monotonic() + 60.0
    while drawn < BUSY and time.monotonic() < until:
        time.sleep(3.0)
        page.evaluate(f"{scene}.querySelectorAll('.mantine-Notification-closeButton').forEach((b) => b.click())")
        shown = np.asarray(shot(page).convert("L"), dtype=float)
        drawn = float(shown[: int(0.8 * shown.shape[0]), : int(0.6 * shown.shape[1])].std())
    # Meshes come after the floor, and what viser says goes slowly
    time.sleep(4.0)


def save(frames: list[Image.Image], file: Path, between: float = SECONDS / FRAMES) -> Path:
    """Pictures of one palette, shown one after the other [s]."""
    palette = frames[len(frames) // 2].quantize(COLOURS, method=Image.Quantize.FASTOCTREE)
    reduced = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    reduced[0].save(file, save_all=True, append_images=reduced[1:], duration=round(1000 * between), loop=0)
    return file


def main() -> None:
    """Those that are named, or all."""
    wanted = sys.argv[1:] or ["page", "presets", "panda"]
    for name in wanted:
        if name == "presets":
            print(strip(), flush=True)
            continue
        with Chromium(PAGE if name == "page" else WINDOW) as browser:
            print(held_back(browser) if name == "page" else film(browser, name), flush=True)


if __name__ == "__main__":
    main()
