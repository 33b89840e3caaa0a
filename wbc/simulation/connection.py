"""A control loop's end of the seam: a plant that fits the robot, driven by commands of one kind."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from math import inf, isfinite
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError, WbcError
from wbc.robot import Robot
from wbc.simulation.kinematic import KinematicPlant
from wbc.simulation.plant import Command, CommandKind, Plant, PlantError, PlantState
from wbc.validation import Array

#: What a plant has
MEMBERS = ("nq", "nv", "time_step", "commands", "reset", "read", "apply", "advance")
#: How far a period may be from a whole multiple of a plant's time step, as a part of that step
MULTIPLE = 1e-6


class Connection:
    """Drives a plant tick by tick and checks what it says.

        with Connection(plant, robot, dt) as connection:      # at its end the plant is commanded to rest
            state = connection.reset(q)
            state = connection.drive(controller.step(state.q).v)

    Args:
        plant: None: a :class:`KinematicPlant`. dt: control period [s]. kind: of its commands.

    Raises:
        ShapeError: it is no plant, or one of another robot. RangeError: it does not advance by such periods, or takes
            no such commands.
    """

    def __init__(self, plant: Plant | None, robot: Robot, dt: float, kind: CommandKind = CommandKind.VELOCITY) -> None:
        self.plant: Plant = KinematicPlant(robot) if plant is None else plant
        _check(self.plant, robot, dt, kind)
        self._q_shape, self._v_shape, self._dt, self._time = (robot.nq,), (robot.nv,), dt, -inf
        # One command for all ticks, written anew in each
        self._command = Command(kind, np.zeros(robot.nv))
        self._values = self._command.values
        self._nq = robot.nq

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # Where something else went wrong, that is what is to be said
        with contextlib.suppress(*(() if kind is None else (WbcError,))):
            self.rest()

    def reset(self, q: Array, time: float = 0.0) -> PlantState:
        """At rest at a configuration.

        Raises:
            PlantError: the plant is not there, has no valid reading, or raised what is no error of this package.
        """
        with self._named():
            self._time = -inf
            self.plant.reset(q, time)
            return self._checked(self.plant.read())

    def drive(self, command: Array) -> PlantState:
        """One period with a command ``[nv]``, as a desired velocity; the state after it.

        Raises:
            PlantError: no valid reading, and the plant is commanded to rest; or it raised.
        """
        self._values[:] = command
        plant = self.plant
        try:
            plant.apply(self._command)
            plant.advance(self._dt)
            return self._checked(plant.read())
        except WbcError:
            raise
        except Exception as error:
            raise self._failed(error) from error

    def rest(self) -> None:
        """Command zeros: no velocity, or motors without torque; time does not go on.

        Raises:
            PlantError: the plant raised.
        """
        self._values[:] = 0.0
        with self._named():
            self.plant.apply(self._command)

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except WbcError:
            raise
        except Exception as error:
            raise self._failed(error) from error

    def _failed(self, error: Exception) -> PlantError:
        return PlantError("plant", type(self.plant).__name__, f"it raised {type(error).__name__}: {error}")

    def _checked(self, state: Any) -> PlantState:
        """Arrays of the loop's own: a plant may write into its."""
        if isinstance(state, PlantState) and state.valid:
            q, v, time = state.q, state.v, state.time
            if type(q) is type(v) is np.ndarray and q.shape == self._q_shape and v.shape == self._v_shape:
                read = np.concatenate((q, v), dtype=np.float64)
                # A sum of squares is a number where all are
                if time >= self._time and isfinite(read.dot(read)) and isfinite(time):
                    self._time = time
                    return PlantState(read[: self._nq], read[self._nq :], float(time))
        self.rest()
        raise PlantError("plant.state", state, self._fault(state))

    def _fault(self, state: Any) -> str:
        """What is wrong with a reading."""
        if not isinstance(state, PlantState):
            return "expected a PlantState"
        if not state.valid:
            return "there is no valid reading of where the robot is"
        shapes = np.shape(state.q), np.shape(state.v)
        if shapes != (self._q_shape, self._v_shape) or not isinstance(state.q, np.ndarray):
            wanted = f"q {list(self._q_shape)} and v {list(self._v_shape)}"
            return f"expected arrays {wanted}, not {shapes[0]} and {shapes[1]}"
        if state.time < self._time:
            return f"its clock went back from {self._time:g} s"
        return "expected finite numbers"


def _check(plant: Any, robot: Robot, dt: float, kind: CommandKind) -> None:
    missing = [name for name in MEMBERS if not hasattr(plant, name)]
    if missing or isinstance(plant, type):
        why = "an instance, not the class" if not missing else f"it has no {', '.join(missing)}"
        raise ShapeError("plant", plant, f"expected a wbc.simulation.Plant: {why}")
    for name, count in (("nq", robot.nq), ("nv", robot.nv)):
        if getattr(plant, name) != count:
            raise ShapeError(f"plant.{name}", getattr(plant, name), f"expected {count}, as {robot.name} has")
    step = validation.scalar("plant.time_step", plant.time_step, low=0.0, unit="s")
    periods = dt / step if step > 0.0 else 1.0
    if round(periods) < 1 or abs(periods - round(periods)) > MULTIPLE:
        raise RangeError("plant.time_step", step, f"expected a step that divides the control period of {dt:g} s")
    kinds = tuple(str(kind) for kind in validation.items("plant.commands", plant.commands, "kinds of commands"))
    if kind not in kinds:
        name = "velocities" if kind is CommandKind.VELOCITY else f"{kind}s"
        raise RangeError("plant.commands", kinds, f"the loop commands {name}, which this plant does not take")
