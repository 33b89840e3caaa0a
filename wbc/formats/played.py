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
from wbc.simulation import Command, CommandKind, KinematicPlant, PlantState
from wbc.tick.outcome import Status
from wbc.validation import Array

#: Times that differ by less are one [s]
AT_ONCE = 1e-9


class PlayedPlant(KinematicPlant):
    """A plant that moves as was recorded, whatever it is commanded; commands are kept.

    Attributes:
        given: the commands, with their times [s].

    Args:
        robot: whose joints they are. motion: what was recorded, two states or more.
        ignored: as of :meth:`wbc.formats.RecordedMotion.configurations`.

    Raises:
        FormatError: less than two states. UnknownNameError: a joint that the robot has not.
    """

    commands = (CommandKind.VELOCITY, CommandKind.POSITION, CommandKind.TORQUE)

    def __init__(self, robot: Robot, motion: RecordedMotion, ignored: Sequence[str] = ()) -> None:
        if len(motion.t) < 2:
            raise FormatError("motion", len(motion.t), "expected two joint states or more")
        self._robot, self._t, self._recorded = robot, motion.t, motion.configurations(robot, ignored)
        self.given = list[tuple[float, Command]]()
        super().__init__(robot)

    def reset(self, q: Array, time: float) -> None:
        """Begin the recording anew; ``q`` is not gone to: read says where the robot was."""
        self._time, self._shift = float(self._t[0]), time - float(self._t[0])

    def read(self) -> PlantState:
        """Between two recorded states on the line that joins them, with the velocity that led there; invalid after the
        last one.
        """
        t, now = self._t, self._time
        k = int(np.clip(np.searchsorted(t, now - AT_ONCE) - 1, 0, len(t) - 2))
        v = self._robot.difference(*self._recorded[k : k + 2]) / (t[k + 1] - t[k])
        q = self._robot.integrate(self._recorded[k], v, float(np.clip(now, t[k], t[k + 1]) - t[k]))
        return PlantState(q, v, now + self._shift, valid=bool(now <= t[-1] + AT_ONCE))

    def apply(self, command: Command) -> None:
        """Keep it."""
        self.given.append((self._time + self._shift, Command(command.kind, command.values.copy())))

    def advance(self, dt: float) -> None:
        """Go on in the recording."""
        self._time += dt


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
