"""A way round for a dragged target: where an obstacle holds the robot back, a path is planned beside the loop."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from wbc.api import Controller
from wbc.controller import core_of
from wbc.errors import WbcError
from wbc.plan import MotionPlanner
from wbc.tasks import Obstacle, SelfCollision
from wbc.validation import Array
from wbc.viewer.messages import LONGEST
from wbc.viewer.operation import posture_of
from wbc.viewer.tick import Tick, se3

#: A robot is held back where its distance from the target has not fallen by this share
PROGRESS = 0.05
#: for so long [s]
PATIENCE = 0.5
#: A target is not reached where it is farther than this [m, rad]
MISSED = 0.01
#: After which a search is over [s]
SECONDS = 3.0
#: Between two configurations of a path that is sent, at least [s]
SAMPLE = 0.02
#: Bytes of a number in a message at most
NUMBER = 14


class WaysRound:
    """Watches the ticks of a loop after a target was dragged, and plans where a body holds the robot back.

    Tasks that weigh as much as the dragged one, or more, are kept on the path; lighter ones wait.

    Args:
        send: of a message to the loop; WbcError: it is refused. tell: why there is no way.
    """

    def __init__(
        self, controller: Controller, send: Callable[[dict[str, Any]], None], tell: Callable[[str], None]
    ) -> None:
        self._controller, self._send, self._tell = controller, send, tell
        core = core_of(controller)
        self._blocks, self._costs = core.layout.blocks, core.row_costs
        posture = posture_of(self._blocks, controller.stack.robot.nq)
        self._possible = bool(posture) and core.layout.command == "velocity"
        self._item = ""
        #: the least distance from the target that counted as progress, and when [m or rad, s]
        self._nearest = np.inf, 0.0
        self._thread: threading.Thread | None = None
        self._planner: MotionPlanner | None = None

    def dragged(self, item: str) -> None:
        """The target of this task was moved by the operator: a plan that is under way is for nothing."""
        self._item, self._nearest = item if self._possible else "", (np.inf, 0.0)

    def look(self, tick: Tick) -> None:
        """A state of the loop; where it comes no nearer to the target, the search begins."""
        item, step = self._item, tick.step
        if not item or (self._thread is not None and self._thread.is_alive()):
            return
        residual = step.residuals.get(item)
        off = 0.0 if residual is None else max(residual.norm(unit) for unit in set(residual.units))
        if off <= MISSED or not tick.is_on(self._blocks[item]):
            # There, or the loop has not taken the target yet, or follows a path to it
            self._nearest = np.inf, 0.0
            return
        if off < (1.0 - PROGRESS) * self._nearest[0]:
            self._nearest = off, tick.time
        if tick.time - self._nearest[1] < PATIENCE:
            return
        bodies = [self._blocks[row.item].entry.item for row in step.binding if row.item in self._blocks]
        if not any(isinstance(body, Obstacle | SelfCollision) for body in bodies):
            return
        self._item = ""
        self._thread = threading.Thread(target=self._plan, args=(tick, item), name="way round", daemon=True)
        self._thread.start()

    def _plan(self, tick: Tick, item: str) -> None:
        try:
            message = self._message(tick, item)
            if not self._item:
                self._send(message)
                # A path that ends short of the target, as where an obstacle was moved, is not the last one
                self._item, self._nearest = item, (np.inf, 0.0)
        except WbcError as error:
            self._tell(f"no way round to {item}: {error}")

    def _message(self, tick: Tick, item: str) -> dict[str, Any]:
        keep = tuple(
            name for name in self._blocks if name != item and self._weight(tick, name) >= self._weight(tick, item)
        )
        planner = self._planner
        if planner is None or planner.kept != keep:
            planner = self._planner = MotionPlanner(self._controller.stack, keep)
        for name, block in self._blocks.items():
            handle = planner[name]
            if "pose" in block.slots:
                handle.set(pose=se3(tick.part("p")[block.slots["pose"].span]))
            if block.form != "task":
                handle.switch(tick.is_on(block))
            elif name in keep and "target" in block.slots:
                handle.set(target=self._target(tick, name))
        path = planner.plan(tick.q, {item: self._target(tick, item)}, seconds=SECONDS)
        law = path.law()
        most = LONGEST // (NUMBER * self._controller.stack.robot.nq) - 1
        parts = max(2, min(most, int(law.duration / SAMPLE)))
        q, _ = path.configurations(law, np.linspace(0.0, law.duration, parts + 1))
        return {"type": "follow", "item": item, "dt": law.duration / parts, "q": q}

    def _weight(self, tick: Tick, name: str) -> float:
        block = self._blocks[name]
        if block.form != "task" or not tick.is_on(block):
            return -np.inf
        return float((tick.part("weight")[block.span] / self._costs[block.span]).max(initial=0.0))

    def _target(self, tick: Tick, name: str) -> Any:
        slot = self._blocks[name].slots["target"]
        numbers: Array = tick.part("p")[slot.span].copy()
        if slot.input.kind == "pose":
            return se3(numbers)
        return numbers.reshape(3, 3, order="F") if slot.input.kind == "rotation" else numbers
