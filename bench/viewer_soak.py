"""A live loop with its viewer for a long time: ``python -m bench.viewer_soak [--minutes 60] [--watchers 10]``.

A Panda among obstacles at 200 Hz is driven by one client, watched by others, and stopped again and again. Said is how
memory of both processes grows, whether every stop reached the loop and how long it took, and that a connection that is
cut stops the robot within its limits. What was found is written to ``bench/data/viewer_soak.json``.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import threading
import time
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

import numpy as np
from websockets.sync.client import ClientConnection, connect

from bench.figures import store
from bench.measured.viewer import watched
from bench.pool import ROOT
from bench.sheet import Sheet
from wbc.api import Controller
from wbc.viewer import Viewer, show
from wbc.viewer.presets import playground

#: Between two stops [s], of which every third is a connection that is cut; between two looks at memory [s]
EVERY, LOOK = 5.0, 2.0
#: Ticks of a loop that does not wait
FAST = 50_000
#: Part of the time that memory may take to be what it is: caches fill, the past of the page does
WARM = 0.3
FILE = ROOT / "bench" / "data" / "viewer_soak.json"


@dataclass
class Seen:
    """What the loop saw."""

    stopped: threading.Event = field(default_factory=threading.Event)
    over: threading.Event = field(default_factory=threading.Event)
    ticks: int = 0
    late: int = 0
    #: largest |dv| / (a dt) of any joint in any tick, 1 at its limit
    hardest: float = 0.0


def memory(process: int) -> float:
    """Resident memory [MiB]."""
    with open(f"/proc/{process}/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 2**20


def loop(viewer: Viewer, seen: Seen, controller: Controller, q: np.ndarray) -> None:
    """Ticks at the stack's own rate."""
    robot, dt = controller.stack.robot, controller.stack.dt
    before, due = np.zeros(robot.nv), time.monotonic()
    limit = np.maximum(robot.limits.acceleration, 1e-9) * dt
    while not seen.over.is_set():
        step = controller.step(q)
        viewer.update(step)
        (seen.stopped.set if viewer.stopped else seen.stopped.clear)()
        seen.hardest = max(seen.hardest, float((np.abs(step.v - before) / limit).max()))
        before, q = step.v, robot.integrate(q, step.v, dt)
        seen.ticks += 1
        due += dt
        wait = due - time.monotonic()
        seen.late += wait < -dt
        if wait > 0.0:
            time.sleep(wait)
        elif wait < -0.25:
            due = time.monotonic()


def growth(controller: Controller, q: np.ndarray) -> float:
    """Memory that ticks and updates alone take, as fast as they go [MiB]."""
    with show(controller, open_browser=False) as viewer:
        before = 0.0
        for tick in range(FAST):
            step = controller.step(q)
            viewer.update(step)
            q = controller.stack.robot.integrate(q, step.v, controller.stack.dt)
            if tick == FAST // 5:
                before = memory(os.getpid())
    return memory(os.getpid()) - before


def stopped_after(seen: Seen, began: float) -> float:
    """Seconds, infinite where the stop did not come."""
    return time.monotonic() - began if seen.stopped.wait(5.0) else np.inf


def client(address: str, orders: Connection) -> None:
    """A process that drives: of each order (drive for so long, then stop by button or not) when the stop was sent."""
    random = np.random.default_rng(0)
    while (order := orders.recv()) is not None:
        seconds, by_button = order
        with connect(address, max_size=None) as socket:
            drive(socket, seconds, random)
            at = time.monotonic()
            if by_button:
                socket.send('{"type": "stop"}')
                orders.send(at)
                # The connection stays until the loop has stopped, so that it is the button that stops it
                orders.recv()
                socket.send('{"type": "release"}')
        if not by_button:
            orders.send(at)


def drive(socket: ClientConnection, seconds: float, random: np.random.Generator) -> None:
    """Random rates of the hand."""
    until = time.monotonic() + seconds
    socket.send('{"type": "operate"}')
    socket.send('{"type": "resume"}')
    while time.monotonic() < until:
        rate = [float(x) for x in random.uniform(-0.25, 0.25, 6)]
        socket.send(json.dumps({"type": "rate", "item": "hand", "rate": rate}))
        with contextlib.suppress(TimeoutError):
            while True:
                socket.recv(timeout=0.0)
        time.sleep(0.1)


def main() -> None:
    """Run, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--watchers", type=int, default=10)
    given = parser.parse_args()
    about = store.stamp() | {"command": f"python -m bench.viewer_soak --minutes {given.minutes:g}"}
    chosen = playground("panda")
    controller = chosen.stack.compile()
    controller.reset(chosen.start)
    seen = Seen()
    delays: dict[str, list[float]] = {"button": [], "connection": []}
    grown: list[tuple[float, float, float]] = []
    alone = growth(controller, chosen.start)
    controller.reset(chosen.start)
    with show(controller, open_browser=False) as viewer, watched(viewer, given.watchers):
        runner = threading.Thread(target=loop, args=(viewer, seen, controller, chosen.start))
        runner.start()
        address, began, looked = viewer.url.replace("http", "ws") + "wbc", time.monotonic(), 0.0
        ours, theirs = multiprocessing.Pipe()
        driver = multiprocessing.get_context("spawn").Process(target=client, args=(address, theirs), daemon=True)
        driver.start()
        number = 0
        try:
            while time.monotonic() - began < 60.0 * given.minutes:
                number += 1
                by_button = bool(number % 3)
                ours.send((EVERY, by_button))
                at = ours.recv()
                delays["button" if by_button else "connection"].append(stopped_after(seen, at))
                if by_button:
                    ours.send("stopped")
                now = time.monotonic() - began
                if now - looked > LOOK:
                    looked = now
                    grown.append((now, memory(viewer._process.pid), memory(os.getpid())))
        finally:
            seen.over.set()
            runner.join()
            driver.kill()
    rows = np.array(grown)
    kept = rows[rows[:, 0] >= WARM * rows[-1, 0]]
    slopes = [float(np.polyfit(kept[:, 0] / 3600.0, kept[:, k], 1)[0]) for k in (1, 2)]
    table = Sheet(
        "",
        ("", ""),
        [
            ("minutes, watchers", f"{rows[-1, 0] / 60.0:.1f}, {given.watchers}"),
            ("ticks, of them later than a period", f"{seen.ticks}, {seen.late}"),
            ("viewer's memory at the first look, after the warm-up, at the end", memory_row(rows, kept, 1)),
            ("loop's memory, the same", memory_row(rows, kept, 2)),
            (f"loop's memory alone, growth in the last {FAST - FAST // 5} of {FAST} ticks", f"{alone:+.2f} MiB"),
            ("slopes after the warm-up", f"{slopes[0]:+.1f} and {slopes[1]:+.1f} MiB/h"),
            *((f"stops by {name}: sent, dropped, slowest", told(times)) for name, times in delays.items()),
            ("hardest braking of any joint", f"{100.0 * seen.hardest:.2f} % of its acceleration limit"),
        ],
    )
    store.write(FILE, about, {"soak": table})
    for name, value in table.rows:
        print(f"{name}: {value}")


def memory_row(rows: np.ndarray, kept: np.ndarray, column: int) -> str:
    """Three numbers."""
    return f"{rows[0, column]:.0f}, {kept[0, column]:.0f}, {rows[-1, column]:.0f} MiB"


def told(times: list[float]) -> str:
    """Count, dropped, slowest."""
    arrived = [x for x in times if np.isfinite(x)]
    return f"{len(times)}, {len(times) - len(arrived)}, {1e3 * max(arrived, default=np.nan):.0f} ms"


if __name__ == "__main__":
    main()
