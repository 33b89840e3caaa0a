"""Steps at work: one behaviour of a tree for each kind of step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence as InOrder

from wbc.api import Controller
from wbc.multibody import pin
from wbc.program import steps
from wbc.program.hand import Gripper, ProgramHand
from wbc.program.steps import AnyStep, Guard
from wbc.validation import Array


class Surroundings(Protocol):
    """What a step needs of the program that it belongs to, see :class:`wbc.program.runner.Runner`."""

    @property
    def controller(self) -> Controller: ...
    @property
    def hands(self) -> Mapping[str, ProgramHand]: ...
    @property
    def grippers(self) -> Mapping[str, Gripper]: ...
    @property
    def signals(self) -> Mapping[str, float]: ...
    @property
    def q(self) -> Array: ...
    @property
    def time(self) -> float: ...
    @property
    def paused(self) -> bool: ...

    def began(self, leaf: Leaf) -> None:
        """A step begins."""

    def ended(self, leaf: Leaf, status: Status) -> None:
        """A step has ended."""


class GuardWatch:
    """Guards over time: which of them holds, for as long as it has to."""

    def __init__(self, guards: Sequence[Guard], runner: Surroundings, cautious: bool) -> None:
        self._guards, self._runner, self._cautious = tuple(guards), runner, cautious
        self.start()

    def start(self) -> None:
        """Nothing has been seen."""
        self._begun = self._runner.time
        self._since = [math.inf] * len(self._guards)

    def met(self) -> str:
        """The first guard that holds, in words, "" for none.

        A signal without a finite value meets the guards that end a step badly (``cautious``), and none of the others.
        """
        now, found = self._runner.time, ""
        for k, guard in enumerate(self._guards):
            value = now - self._begun if guard.signal == "elapsed" else self._runner.signals[guard.signal]
            lost = not math.isfinite(value)
            if not (self._cautious if lost else guard.holds(value)):
                self._since[k] = math.inf
                continue
            self._since[k] = min(self._since[k], now)
            if not found and now - self._since[k] >= guard.lasting:
                found = f"{guard.signal} has no value" if lost else f"{guard} ({value:.4g})"
        return found


class Leaf(Behaviour):
    """A step at work. :meth:`begin` runs once, :meth:`aim` then and after each pause, :meth:`advance` every tick."""

    def __init__(self, step: steps.ProgramStep, runner: Surroundings, name: str) -> None:
        super().__init__(name)
        self.runner, self._step = runner, step
        self._unless = GuardWatch(step.unless, runner, cautious=True)
        self._until = GuardWatch(getattr(step, "until", ()), runner, cautious=False)
        self._started, self._begun = 0.0, False

    def initialise(self) -> None:
        # The step before may have been a single one: this one then begins when the program goes on
        self._begun, self.feedback_message = False, ""

    def update(self) -> Status:
        if not self._begun:
            if self.runner.paused:
                return Status.RUNNING
            self._start()
        if reason := self._unless.met():
            return self._failed(reason)
        status = self.advance()
        late = self._step.timeout is not None and self.runner.time - self._started >= self._step.timeout
        if late and status is Status.RUNNING:
            return self._failed(f"not done after {self._step.timeout:g} s{self.missing()}")
        return status

    def _start(self) -> None:
        self._begun, self._started = True, self.runner.time
        self._unless.start()
        self._until.start()
        self.begin()
        self.aim()
        self.runner.began(self)

    def terminate(self, new_status: Status) -> None:
        if self._begun and (new_status is not Status.INVALID or self.status is Status.RUNNING):
            self.rest()
            self.runner.ended(self, new_status)

    def begin(self) -> None:
        """Where from, and what is to be reached."""

    def aim(self) -> None:
        """Tell the hand where to."""

    def advance(self) -> Status:
        """How far it is."""
        return self._ended()

    def rest(self) -> None:
        """Leave the hand at rest."""

    def missing(self) -> str:
        """What is not there yet, after a comma."""
        return ""

    def _ended(self) -> Status:
        """By the guards that end the step well."""
        self.feedback_message = self._until.met()
        return Status.SUCCESS if self.feedback_message else Status.RUNNING

    def _failed(self, reason: str) -> Status:
        self.feedback_message = reason
        return Status.FAILURE


class MotionLeaf(Leaf):
    """To a pose: :class:`Move` and :class:`Retreat`."""

    def __init__(self, step: steps.Move | steps.Retreat, runner: Surroundings, name: str) -> None:
        super().__init__(step, runner, name)
        self._asked = step

    def begin(self) -> None:
        # From where it is commanded: what is measured late or with noise does not come into the program's path
        here = self.runner.hands[self._asked.hand].reference.pose
        if isinstance(self._asked, steps.Move):
            self._goal = self._asked.to.from_here(here)
        else:
            self._goal = here * pin.SE3(np.eye(3), np.array(self._asked.by))

    def aim(self) -> None:
        self.runner.hands[self._asked.hand].reference.aim(self._goal, self._asked.speed)

    def advance(self) -> Status:
        hand = self.runner.hands[self._asked.hand]
        if not hand.reference.arrived:
            return Status.RUNNING
        near = all(e <= w for e, w in zip(hand.off(self._goal), self._asked.within, strict=True))
        return Status.SUCCESS if near else Status.RUNNING

    def rest(self) -> None:
        self.runner.hands[self._asked.hand].reference.stop()

    def missing(self) -> str:
        distance, angle = self.runner.hands[self._asked.hand].off(self._goal)
        return f", the hand is {1e3 * distance:.3g} mm and {angle:.3g} rad from its pose"


class Approaching(Leaf):
    """:class:`Approach`."""

    def __init__(self, step: steps.Approach, runner: Surroundings, name: str) -> None:
        super().__init__(step, runner, name)
        self._asked = step
        self._direction = np.array(step.along) / np.linalg.norm(step.along)

    def begin(self) -> None:
        self._from = self.runner.hands[self._asked.hand].reference.pose.translation.copy()

    def aim(self) -> None:
        speed, reference = self._asked.speed, self.runner.hands[self._asked.hand].reference
        reference.drift(np.append(speed * self._direction, np.zeros(3)), (speed, speed))

    def advance(self) -> Status:
        status = self._ended()
        gone = self.runner.hands[self._asked.hand].reference.pose.translation - self._from
        if status is Status.RUNNING and float(gone @ self._direction) >= self._asked.at_most:
            return self._failed(f"nothing was met within {self._asked.at_most:g} m")
        return status

    def rest(self) -> None:
        self.runner.hands[self._asked.hand].reference.stop()


class Operating(Leaf):
    """:class:`Operate`."""

    def __init__(self, step: steps.Operate, runner: Surroundings, name: str) -> None:
        super().__init__(step, runner, name)
        self._asked = step

    def advance(self) -> Status:
        hand, asked = self.runner.hands[self._asked.hand], self._asked
        if self.runner.time - hand.ordered > asked.stale:
            hand.reference.stop()
        else:
            hand.reference.drift(hand.order, asked.speed)
        return self._ended()

    def rest(self) -> None:
        self.runner.hands[self._asked.hand].reference.stop()


class GripLeaf(Leaf):
    """:class:`Grasp` and :class:`Release`."""

    def __init__(self, step: steps.Grasp | steps.Release, runner: Surroundings, name: str) -> None:
        super().__init__(step, runner, name)
        self._gripper, self._closed = runner.grippers[step.gripper], isinstance(step, steps.Grasp)

    def begin(self) -> None:
        (self._gripper.close if self._closed else self._gripper.open)()

    def advance(self) -> Status:
        state = self._gripper.state
        return Status.SUCCESS if state == ("closed" if self._closed else "open") else Status.RUNNING

    def missing(self) -> str:
        return f", the gripper is {self._gripper.state}"


class Weighing(Leaf):
    """:class:`Activate`."""

    def __init__(self, step: steps.Activate, runner: Surroundings, name: str) -> None:
        super().__init__(step, runner, name)
        self._asked = step

    def begin(self) -> None:
        for name, weight in self._asked.weights.items():
            handle = self.runner.controller[name]
            if name in self.runner.hands and handle.weight == 0.0:
                self.runner.hands[name].start(self.runner.q)
            handle.ramp(weight, self._asked.seconds)

    def advance(self) -> Status:
        return Status.SUCCESS if self.runner.time - self._started >= self._asked.seconds else Status.RUNNING


_LEAVES: dict[type[steps.ProgramStep], type[Leaf]] = {
    steps.Move: MotionLeaf,
    steps.Retreat: MotionLeaf,
    steps.Approach: Approaching,
    steps.Operate: Operating,
    steps.Wait: Leaf,
    steps.Grasp: GripLeaf,
    steps.Release: GripLeaf,
    steps.Activate: Weighing,
}


def in_order(given: Sequence[AnyStep], runner: Surroundings, name: str) -> InOrder:
    """A tree of steps that are done one after the other."""
    return InOrder(name, True, [_tree(step, runner, f"{name}.{k}") for k, step in enumerate(given)])


def _tree(step: AnyStep, runner: Surroundings, place: str) -> Behaviour:
    name = f"{place} {step.name or step.step}"
    if isinstance(step, steps.Alternatives):
        tries = [in_order(some, runner, f"{place}.{k}") for k, some in enumerate(step.tries)]
        return Selector(name, True, tries)
    return _LEAVES[type(step)](step, runner, name)
