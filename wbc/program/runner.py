"""A program that runs beside a control loop: it writes targets and weights of a controller, tick by tick."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from py_trees.common import Status
from py_trees.display import unicode_tree

from wbc import validation
from wbc.api import Controller
from wbc.program import leaves, steps
from wbc.program.hand import Gripper, ProgramHand
from wbc.program.steps import Guard, Program
from wbc.sealed import Sealed

State = Literal["running", "paused", "succeeded", "failed", "aborted"]


@dataclass(frozen=True)
class Report:
    """Where a program is.

    Attributes:
        state: how it is; ``failed`` and ``aborted`` once the recovery has ended, too.
        step: the step that runs, or ran last.
        reason: why a step ended as it did, "" if nothing is to be said.
    """

    state: State
    step: str
    reason: str


@dataclass(frozen=True)
class Event:
    """A line of the log: at ``time`` [s] of the program a step began, or ended with a status, for a reason."""

    time: float
    step: str
    status: str
    reason: str


class Runner(Sealed):
    """Runs a program on a controller.

        runner = Runner(Program.read("insert.yaml"), controller, grippers={"gripper": gripper})
        while runner.tick(q, {"force": wrench[2]}).state == "running":
            step = controller.step(q)

    Steps are behaviours of a py_trees tree, which is ticked once in each control period on the controller's clock. The
    program writes targets and feed-forward of its hands, and weights where a step says so; everything else stays the
    user's. A hand is at rest within its limits whenever no step moves it.

    Args:
        program: what is to be done. controller: a compiled stack with the hands. grippers: by name.

    Attributes:
        log: what happened. hands: by name. signals, q: of the last tick.

    Raises:
        UnknownNameError: a hand, task or gripper that there is not. ShapeError: a hand that is no ``EndEffector``.
    """

    _changing = ("q", "signals")

    def __init__(
        self, program: Program, controller: Controller, *, grippers: Mapping[str, Gripper] | None = None
    ) -> None:
        validation.instance("program", program, Program, "a Program")
        self.controller, self.grippers = controller, dict(grippers or {})
        self.log, self.signals, self.q = list[Event](), dict[str, float](), np.zeros(0)
        self._ticks = 0
        tasks = [entry.name for entry in controller.stack.tasks]
        flat = list(_flat((*program.steps, *program.recovery)))
        hands = {getattr(step, "hand", None): None for step in flat}
        for k, step in enumerate(flat):
            if hasattr(step, "gripper"):
                validation.one_of(f"steps[{k}].gripper", step.gripper, tuple(self.grippers))
            for name in getattr(step, "weights", ()):
                validation.one_of(f"steps[{k}].weights", name, tasks)
        hands.pop(None, None)
        for name in hands:
            validation.one_of("hand", name, tasks)
        dt = controller.stack.dt
        self.hands = {str(name): ProgramHand(controller, str(name), dt) for name in hands}
        self._dt, self._needed = dt, _signals(program, flat)
        self._abort = leaves.GuardWatch(program.abort, self, cautious=True)
        self._tree = leaves.in_order(program.steps, self, "steps")
        self._recovery = leaves.in_order(program.recovery, self, "recovery") if program.recovery else None
        self._state: State = "running"
        self._verdict: State | None = None
        self._current: leaves.Leaf | None = None
        self._reason, self._single = "", False

    @property
    def time(self) -> float:
        """Of the program [s]; it stands while the program is paused."""
        return self._ticks * self._dt

    @property
    def paused(self) -> bool:
        """Whether the program stands, see :meth:`pause`."""
        return self._state == "paused"

    @property
    def report(self) -> Report:
        """Where the program is."""
        return Report(self._state, self._current.name if self._current else "", self._reason)

    def tick(self, q: Any, signals: Mapping[str, float] | None = None) -> Report:
        """One control period; call it before :meth:`Controller.step`.

        Args:
            q: measured configuration. signals: a value for each signal that a guard names; one that is not finite is a
                sensor without reading: it holds for guards of ``unless`` and ``abort``, and not for those of ``until``.

        Raises:
            UnknownNameError: a signal is missing. ShapeError, NotFiniteError: no configuration. Nothing is changed.
        """
        q = self.controller.stack.robot.configuration("q", q)
        given = dict(signals or {})
        for name in self._needed:
            validation.one_of("signals", name, tuple(given))
        first = not self.q.size
        self.signals, self.q = {name: float(value) for name, value in given.items()}, q
        for hand in self.hands.values():
            hand.start(q) if first else hand.look(q)
        if self._state == "running":
            self._advance()
            self._ticks += 1
        for hand in self.hands.values():
            hand.write()
        return self.report

    def operate(self, hand: str, twist: Any) -> None:
        """An operator's twist of a hand (linear; angular) in its reference frame [m/s, rad/s], for ``operate`` steps.

        Raises:
            UnknownNameError: no such hand. ShapeError, NotFiniteError: no twist.
        """
        one = self.hands[validation.one_of("hand", hand, tuple(self.hands))]
        one.order, one.ordered = validation.ordinary_array("twist", twist, (6,)), self.time

    def pause(self) -> None:
        """Every hand stops within its limits, and the program's clock stands."""
        if self._state == "running":
            self._state = "paused"
            for hand in self.hands.values():
                hand.reference.stop()

    def resume(self, *, single: bool = False) -> None:
        """Go on; with ``single`` to the end of one step, and then pause again."""
        self._single = single
        if self._state == "paused":
            self._state = "running"
            if self._current is not None and self._current.status is Status.RUNNING:
                self._current.aim()

    def picture(self) -> str:
        """The tree with the status of every step, as text."""
        roots = [self._tree] if self._recovery is None else [self._tree, self._recovery]
        return "\n".join(unicode_tree(root, show_status=True) for root in roots)

    def save(self, path: str | Path) -> None:
        """The log, one JSON object a line."""
        Path(path).write_text("".join(json.dumps(asdict(event)) + "\n" for event in self.log), encoding="utf-8")

    def began(self, leaf: leaves.Leaf) -> None:
        """A step begins."""
        self._current, self._reason = leaf, ""
        self.log.append(Event(self.time, leaf.name, "begins", ""))

    def ended(self, leaf: leaves.Leaf, status: Status) -> None:
        """A step has ended."""
        word = {Status.SUCCESS: "done", Status.FAILURE: "failed"}.get(status, "left")
        self._reason = leaf.feedback_message or self._reason
        self.log.append(Event(self.time, leaf.name, word, leaf.feedback_message))
        if self._single:
            self.pause()

    def _advance(self) -> None:
        tree = self._tree if self._verdict is None else self._recovery
        if self._verdict is None and (why := self._abort.met()):
            self._tree.stop(Status.INVALID)
            self._reason = why
            self.log.append(Event(self.time, "abort", "aborted", why))
            self._recover("aborted")
            return
        assert tree is not None
        tree.tick_once()
        if tree.status is Status.RUNNING:
            return
        if self._verdict is not None:
            self._state = self._verdict
        elif tree.status is Status.SUCCESS:
            self._state = "succeeded"
        else:
            self._recover("failed")

    def _recover(self, verdict: State) -> None:
        """What is left to do after a failure or an abort."""
        self._verdict = verdict
        for hand in self.hands.values():
            hand.reference.stop()
        if self._recovery is None:
            self._state = verdict


def _flat(some: Iterable[Any]) -> Iterable[Any]:
    """All steps, those in alternatives too."""
    for step in some:
        if isinstance(step, steps.Alternatives):
            for tried in step.tries:
                yield from _flat(tried)
        else:
            yield step


def _signals(program: Program, flat: Iterable[Any]) -> tuple[str, ...]:
    """Names of signals that guards need from outside."""
    guards: list[Guard] = [*program.abort]
    for step in flat:
        guards += [*step.unless, *getattr(step, "until", ())]
    return tuple(sorted({guard.signal for guard in guards} - {"elapsed"}))
