"""A loop in real time that is driven from the page: the controller, its viewer and a plant."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from wbc.api import Controller
from wbc.simulation import Connection, Plant
from wbc.viewer.beside import SILENT, Viewer, show


def run(
    controller: Controller,
    q: Any,
    seconds: float | None = None,
    *,
    plant: Plant | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    open_browser: bool = True,
    token: str | None = None,
    silence: float = SILENT,
    zeromq: str = "",
    announce: Any = None,
) -> None:
    """Step a controller every ``stack.dt`` seconds and let it be driven from a browser, until the page's process or the
    time ends, or Ctrl-C.

    Args:
        q: configuration to begin at. seconds: None: without end.
        plant: what moves; default: a :class:`wbc.simulation.KinematicPlant`.
        announce: called with the :class:`wbc.viewer.Viewer` before the first tick.
        host, port, open_browser, token, silence, zeromq: as of :func:`wbc.viewer.show`.

    Raises:
        ViewerError: as of :func:`wbc.viewer.show`. PlantError: as of :class:`wbc.simulation.Connection`.
    """
    dt = controller.stack.dt
    connection = Connection(plant, controller.stack.robot, dt)
    controller.reset(q)
    with (
        show(
            controller, host=host, port=port, open_browser=open_browser, token=token, silence=silence, zeromq=zeromq
        ) as viewer,
        connection,
    ):
        if announce is not None:
            announce(viewer)
        state = connection.reset(controller.stack.robot.configuration("q", q))
        for _ in ticks(viewer, dt, seconds):
            step = controller.step(state.q)
            viewer.update(step)
            state = connection.drive(step.v)


def ticks(viewer: Viewer, dt: float, seconds: float | None) -> Iterator[None]:
    """One every ``dt`` seconds, while the viewer's process runs and the time has not ended."""
    begin = due = time.monotonic()
    while viewer.running and (seconds is None or due - begin < seconds):
        yield
        due += dt
        wait = due - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        elif wait < -0.25:
            # Too late to catch up, as after the machine slept
            due = time.monotonic()
