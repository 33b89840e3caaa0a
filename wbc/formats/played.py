"""A recorded motion in place of a robot: what a stack would have commanded."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from wbc import validation
from wbc.api import Controller
from wbc.formats.errors import FormatError
from wbc.formats.motion import RecordedMotion
from wbc.log import Log
from wbc.record.recorder import names
from wbc.robot import Robot
from wbc.simulation import Command, CommandKind, PlantState
from wbc.tick.outcome import Status
from wbc.validation import Array

#: Times that differ by less are one [s]
AT_ONCE = 1e-9


class PlayedPlant:
    """A plant that moves as was recorded, whatever it is commanded; commands are kept.

    Attributes:
        nq, nv, time_step, commands: as of :class:`wbc.simulation.Plant`. given: the commands, with their times [s].

    Args:
        robot: whose joints they are. motion: what was recorded, two states or more.
        ignored: as of :meth:`wbc.formats.RecordedMotion.configurations`.

    Raises:
        FormatError: less than two states. UnknownNameError: a joint that the robot has not.
    """

    time_step = 0.0
    commands = (CommandKind.VELOCITY, CommandKind.POSITION, CommandKind.TORQUE)

    def __init__(self, robot: Robot, motion: RecordedMotion, ignored: Sequence[str] = ()) -> None:
        if len(motion.t) < 2:
            raise FormatError("motion", len(motion.t), "expected two joint states or more")
        self.nq, self.nv, self.given = robot.nq, robot.nv, list[tuple[float, Command]]()
        self._robot, self._t, self._q = robot, motion.t, motion.configurations(robot, ignored)
        self._now = self._start = float(motion.t[0])
        self._shift = 0.0

    def reset(self, q: Array, time: float) -> None:
        """Begin the recording anew; ``q`` is not gone to: read says where the robot was."""
        self._now, self._shift = self._start, time - self._start

    def read(self) -> PlantState:
        """Between two recorded states on the line that joins them, with the velocity that led there; invalid after the
        last one.
        """
        k = int(np.clip(np.searchsorted(self._t, self._now - AT_ONCE) - 1, 0, len(self._t) - 2))
        length = self._t[k + 1] - self._t[k]
        v = self._robot.difference(self._q[k], self._q[k + 1]) / length
        q = self._robot.integrate(self._q[k], v, float(np.clip(self._now - self._t[k], 0.0, length)))
        return PlantState(q, v, self._now + self._shift, valid=bool(self._now <= self._t[-1] + AT_ONCE))

    def apply(self, command: Command) -> None:
        """Keep it."""
        self.given.append((self._now + self._shift, Command(command.kind, command.values.copy())))

    def advance(self, dt: float) -> None:
        """Go on in the recording."""
        self._now += dt


def answered(
    controller: Controller,
    motion: RecordedMotion,
    aim: Callable[[Controller, float], None] | None = None,
    *,
    ignored: Sequence[str] = (),
) -> Log:
    """What a stack would have commanded at every state of a recorded motion.

        log = wbc.formats.answered(controller, motion, lambda c, t: c["hand"].set(target=motion.pose("tool0", t)))
        log.array("command") - log.array("v")               # what it would have done otherwise

    Args:
        aim: sets values of the controller before the tick at a time [s] of the recording.
        ignored: as of :meth:`wbc.formats.RecordedMotion.configurations`.

    Returns:
        Columns ``t``, ``q.*``, ``v.*`` (as recorded), ``command.*`` (what the stack commands there), and
        ``status``, a place in ``list(wbc.Status)``. What bound each is in ``controller.record``.

    Raises:
        FormatError, UnknownNameError: as of :class:`PlayedPlant`. WbcError: as of :meth:`wbc.Controller.step`.
    """
    validation.instance("controller", controller, Controller, "a wbc Controller")
    robot, dt = controller.stack.robot, controller.stack.dt
    plant, states = PlayedPlant(robot, motion, ignored), list(Status)
    controller.reset(plant.read().q)
    rows = []
    while (state := plant.read()).valid:
        if aim is not None:
            aim(controller, state.time)
        step = controller.step(state.q, state.v)
        rows.append(np.concatenate([[state.time, states.index(step.status)], state.q, state.v, step.command]))
        plant.advance(dt)
    said, each = names(controller), zip(robot.dof_names, robot.dof_units, strict=True)
    units = {"t": "s", "status": ""} | {f"q.{name}": unit for name, unit in said["q"]}
    units |= {f"v.{name}": f"{unit}/s" for name, unit in each}
    units |= {f"command.{name}": unit for name, unit in said["v"]}
    columns = dict(zip(units, np.array(rows).T, strict=True))
    return Log(columns | {"status": columns["status"].astype(int)}, units, {"robot": robot.name, "dt": dt})
