"""The viewer of a controller in a loop of the user's own: a process beside it, and memory that both share."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import pickle
import subprocess
import sys
import webbrowser
from typing import IO

from wbc import extras, validation
from wbc.api import Controller
from wbc.controller import Step, core_of
from wbc.controller.step import state_of
from wbc.errors import WbcError
from wbc.viewer import messages
from wbc.viewer.errors import LOOPBACK, ViewerError, require_local
from wbc.viewer.link import STOPPED, UNHEARD, UNHEARD_TEXT, WAITS, LoopEnd
from wbc.viewer.operation import Operation
from wbc.viewer.pairing import Pairing
from wbc.viewer.scenery import Scenery

log = logging.getLogger("wbc")

#: A loop that somebody operates stops where viewer or page gave no sign of life for so long [s]
SILENT = 1.0
#: How long a viewer's process may take to end [s]
LEAVING = 3.0


class Viewer:
    """A page on which a controller is seen and driven; made by :func:`show`.

    Attributes:
        url: address of the page. operation: what was taken over from it, see :class:`Operation`.
    """

    def __init__(
        self,
        controller: Controller,
        *,
        host: str,
        port: int,
        token: str | None,
        silence: float,
        zeromq: str,
        operation: Operation | None = None,
        scenery: Scenery | None = None,
        pairing: Pairing | None = None,
    ) -> None:
        core = core_of(controller)
        self.operation = Operation(controller) if operation is None else operation
        self._dt, self._time = controller.stack.dt, 0.0
        size = 8 * core.context.memory.state
        self._link = LoopEnd(size)
        self._said, self._silence, self._noted = 0, silence, self.operation.note
        order = {
            "stack": _pickled(controller),
            "solver": controller.solver,
            "backend": controller.backend,
            "state": size,
            "file": self._link.file,
            "host": host,
            "port": port,
            "token": token,
            "silence": silence,
            "zeromq": zeromq,
            "scenery": scenery,
            "pairing": pairing,
        }
        command = [sys.executable, "-m", "wbc.viewer.process"]
        # Output of the process that is no answer goes where this one's errors go
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, pass_fds=[self._link.file], start_new_session=True
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._stdin: IO[bytes] = self._process.stdin
        try:
            pickle.dump(order, self._stdin)
            self._stdin.flush()
            answer = json.loads(self._process.stdout.readline() or b"{}")
        except (OSError, ValueError):
            answer = {}
        except BaseException:
            self.close()
            raise
        if "url" not in answer:
            self.close()
            raise ViewerError("viewer", None, answer.get("problem", "its process ended before it had an address"))
        self.url: str = answer["url"]

    def update(self, step: Step, time: float | None = None) -> None:
        """Show a tick, and take over what was dragged, set or stopped on the page, for the next one.

        Never waits. Values that do not fit are refused and logged; what the page checked does fit.

        Args:
            time: of the tick on the loop's own clock [s]; default: ticks times ``stack.dt``.
        """
        if self._link.file < 0:
            return
        self._time = self._time + self._dt if time is None else time
        self._link.write(state_of(step), self._time)
        operation = self.operation
        if self._link.waiting:
            for content in self._link.take():
                try:
                    operation.obey(messages.read(content))
                except WbcError as error:
                    log.warning("the viewer's message was refused: %s", error)
        if operation.operated and not operation.stopped and self._link.silence > self._silence:
            operation.stop(UNHEARD_TEXT)
        if operation.moving:
            operation.advance(self._dt)
        flags = (STOPPED | (UNHEARD if operation.stopped == UNHEARD_TEXT else 0)) if operation.stopped else 0
        if operation.waiting:
            flags |= WAITS
        if flags != self._said:
            self._said = flags
            self._link.put_flags(flags)
        if operation.note is not self._noted:
            self._noted = operation.note
            self._link.note(messages.write(operation.note).encode())

    @property
    def running(self) -> bool:
        """The page is there: neither closed here nor did its process end."""
        return self._link.file >= 0 and self._process.poll() is None

    @property
    def stopped(self) -> bool:
        """The robot brakes, or stands, because the page stopped it or was lost; the page resumes."""
        return bool(self.operation.stopped)

    @property
    def operated(self) -> bool:
        """Somebody at a page has control."""
        return self.operation.operated

    def close(self) -> None:
        """End the viewer's process and let the memory go; more calls do nothing."""
        with contextlib.suppress(OSError):
            self._stdin.close()
        try:
            self._process.wait(LEAVING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._link.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Viewer {self.url}{'' if self.running else ', closed'}>"


def show(
    controller: Controller,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    open_browser: bool = True,
    token: str | None = None,
    silence: float = SILENT,
    zeromq: str = "",
    operation: Operation | None = None,
    scenery: Scenery | None = None,
    pairing: Pairing | None = None,
) -> Viewer:
    """Show a controller that a loop steps, and let it be driven from a browser.

        viewer = wbc.viewer.show(controller)
        while viewer.running:
            step = controller.step(q)
            viewer.update(step)
            q = robot.integrate(q, step.v, stack.dt)

    The page has a process of its own; the loop copies each tick's state into shared memory and goes on. Targets,
    weights, switches and obstacles that are dragged are written to the controller by :meth:`Viewer.update`.

    Args:
        host: address to listen on; only this machine unless told otherwise.
        port: 0: any that is free.
        open_browser: open the page; False: ``viewer.url`` says where it is.
        token: what a client must know; made anew where ``host`` is not this machine alone and none is given.

        operation: what obeys the page, in place of an :class:`Operation` on the controller.
        scenery: what stands around the robot. pairing: the pairs of coordinates that an arm is driven by.
        zeromq: address to take the same messages at, such as ``tcp://127.0.0.1:5555``; "" for none.
        silence: while somebody has control, the robot stops where their page, or the viewer, is silent for so long [s].

    Raises:
        MissingPackageError: viser is not installed.
        ViewerError: the stack cannot be pickled, or the process did not start.
    """
    validation.instance("controller", controller, Controller, "a wbc Controller")
    extras.require("viewer", "a page in the browser")
    name = validation.name("host", host)
    longest = validation.scalar("silence", silence, low=0.1, unit="s")
    number = validation.integer("port", port, 0, 65535)
    if zeromq:
        require_local(zeromq)
    viewer = Viewer(
        controller, host=name, port=number, token=token or token_for(name), silence=longest, zeromq=zeromq,
        operation=operation, scenery=scenery, pairing=pairing,
    )  # fmt: skip
    if open_browser:
        webbrowser.open(viewer.url)
    return viewer


def token_for(host: str) -> str | None:
    """A new token where others than this machine can connect."""
    return None if host in LOOPBACK else os.urandom(16).hex()


def _pickled(controller: Controller) -> bytes:
    try:
        return pickle.dumps(controller.stack, protocol=4)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        reason = f"cannot be handed to the viewer's process: {error}; declare its items in a module"
        raise ViewerError("stack", controller.stack.robot.name, reason) from error
