"""What the viewer costs a control loop, and how long a drag takes to the loop and back."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
from websockets.sync.client import connect

from bench.pool import ROOT
from bench.sheet import Sheet
from wbc.api import Controller
from wbc.viewer import Viewer, show
from wbc.viewer.presets import playground

#: Ticks of a block at the preset's rate, and blocks of each kind, taken in turn
TICKS, BLOCKS = 400, 10
#: Messages that are timed
SENT = 150
WATCHERS = 10
#: A process without a viewer: a third of the time it works on 8 MB
STRANGER = """
import time, numpy
numbers = numpy.ones(1 << 20)
while True:
    begun = time.perf_counter()
    while time.perf_counter() - begun < 0.008:
        numbers *= 1.0
    time.sleep(0.016)
"""


def parts() -> dict[str, Sheet | str]:
    """Blocks without a viewer, with one that nobody watches, with one page's worth of clients, and with ten."""
    chosen = playground("panda")
    controller = chosen.stack.compile(wait=True)
    dt, q = chosen.stack.dt, chosen.start
    controller.reset(q)
    found: dict[str, list[np.ndarray]] = {}
    began = time.perf_counter()
    with show(controller, open_browser=False) as viewer:
        ready = time.perf_counter() - began
        for _ in range(BLOCKS):
            kinds = ("no viewer", -1), ("no viewer, a stranger", -2), ("viewer", 0)
            for name, count in (*kinds, ("one client", 1), ("ten clients", WATCHERS)):
                with watched(viewer, count):
                    found.setdefault(name, []).append(block(controller, q, dt, None if count < 0 else viewer))
        there, back = delays(controller, q, dt, viewer)
    worst = {}
    for name, blocks in found.items():
        # Whatever else the machine does only adds: of every block its percentiles, and of those the least
        worst[name] = [min(float(np.percentile(block[k], 99)) for block in blocks) for k in range(2)]
    changes = {
        name: [f"{100 * (of[k] / worst['no viewer'][k] - 1.0):+.0f} %" for k in (0, 1)] for name, of in worst.items()
    }
    with_one, with_ten, stranger = (changes[name] for name in ("one client", "ten clients", "no viewer, a stranger"))
    text = (
        f"The 99th percentile of how late a tick begins changes by {with_one[1]} with a viewer and one client and by "
        f"{with_ten[1]} with ten, that of how long it takes by {with_one[0]} and {with_ten[0]}. Beside a "
        f"process without a viewer, which works on 8 MB a third of the time, they change by {stranger[1]} and "
        f"{stranger[0]}. The address is there after {ready:.1f} s, with compiled code cached."
    )
    delay = Sheet(
        "",
        ("a target that is sent", "median", "p95"),
        [
            ("is in the controller after", *(f"{1e3 * np.percentile(there, p):.1f} ms" for p in (50, 95))),
            ("is back in a state after", *(f"{1e3 * np.percentile(back, p):.1f} ms" for p in (50, 95))),
        ],
    )
    return {"cost": text, "delay": delay}


def block(controller: Controller, q: np.ndarray, dt: float, viewer: Viewer | None) -> np.ndarray:
    """How long each tick took with its update, and how late it began [2 x TICKS] s."""
    took, late = np.zeros((2, TICKS))
    integrate = controller.stack.robot.integrate
    due = time.perf_counter() + dt
    for k in range(TICKS):
        wait = due - time.perf_counter()
        if wait > 0.0:
            time.sleep(wait)
        start = time.perf_counter()
        step = controller.step(q)
        if viewer is not None:
            viewer.update(step)
        took[k], late[k] = time.perf_counter() - start, start - due
        q = integrate(q, step.v, dt)
        due = max(due + dt, start)
    return np.array([took, late])


@contextlib.contextmanager
def watched(viewer: Viewer, count: int) -> Iterator[None]:
    """With clients in a process of their own; -2: with a stranger."""
    if count in (-1, 0):
        yield
        return
    address = viewer.url.replace("http", "ws") + "wbc"
    given = ["-c", STRANGER] if count < 0 else ["-m", "bench.watchers", address, str(count)]
    clients = subprocess.Popen([sys.executable, *given], cwd=ROOT)
    time.sleep(2.0)
    yield
    clients.terminate()
    clients.wait()


def delays(controller: Controller, q: np.ndarray, dt: float, viewer: Viewer) -> tuple[list[float], list[float]]:
    """Times from a message to the controller and back in a state [s]."""
    over = threading.Event()
    seen: dict[float, float] = {}

    def loop() -> None:
        here, last = q, 0.0
        while not over.is_set():
            step = controller.step(here)
            viewer.update(step)
            weight = float(controller["posture"].weight)
            if weight != last:
                seen[weight] = time.perf_counter()
                last = weight
            here = controller.stack.robot.integrate(here, step.v, dt)
            time.sleep(dt)

    thread = threading.Thread(target=loop)
    thread.start()
    there, back = [], []
    with connect(viewer.url.replace("http", "ws") + "wbc", max_size=None) as socket:
        pose = json.loads(socket.recv()) and None
        socket.send('{"type": "operate"}')
        while pose is None:
            message = json.loads(socket.recv())
            pose = message["items"]["hand"]["values"]["target"] if message["type"] == "state" else None
        # Into the ball, so that a row binds
        pose[1] += 0.5
        socket.send(json.dumps({"type": "set", "item": "hand", "values": {"target": pose}}))
        for k in range(SENT):
            weight = 1e-6 * (1.0 + 0.001 * (k + 1))
            sent = time.perf_counter()
            socket.send(json.dumps({"type": "set", "item": "posture", "values": {"weight": weight}}))
            while True:
                message = json.loads(socket.recv())
                if (
                    message["type"] == "state"
                    and abs(message["items"]["posture"]["values"]["weight"] / weight - 1) < 1e-5
                ):
                    break
            back.append(time.perf_counter() - sent)
            there.append(min(seen.values(), key=lambda when: abs(when - sent) if when >= sent else np.inf) - sent)
            time.sleep(0.01)
    over.set()
    thread.join()
    return there, back
