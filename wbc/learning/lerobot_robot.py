"""A robot under a stack, with the methods that LeRobot asks of robots and teleoperators."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from wbc import validation
from wbc.api import Controller
from wbc.errors import RangeError, UnknownNameError
from wbc.formats.motion import RecordedMotion
from wbc.simulation import Connection, KinematicPlant, Plant

#: What a joint's position is called in observations and actions
POSITION = ".pos"


class Uncalibrated:
    """What LeRobot asks of devices that are calibrated."""

    is_calibrated = True

    def calibrate(self) -> None:
        """Nothing to do."""

    def configure(self) -> None:
        """Nothing to do."""


class StackRobot(Uncalibrated):
    """Joints that go where an action says, as far as the stack's constraints let them: limits, obstacles, contacts.

    It has the methods of ``lerobot.robots.Robot``, without inheriting from it, so that LeRobot need not be installed;
    observations and actions are ``{"JOINT.pos": position}`` [rad or m].

        robot = wbc.learning.StackRobot(controller, "posture")
        robot.connect()
        robot.send_action({"panda_joint1.pos": 0.3})

    Attributes:
        name, id: as LeRobot names it. controller: what commands. real_time: whether an action takes a tick's time.

    Args:
        controller: of a stack that commands velocities of joints with one coordinate each.
        posture: name of its task ``Posture``, whose target actions are.
        plant: the robot; default: one that does what it is told.

    Raises:
        ShapeError: no controller. UnknownNameError: no such task. RangeError: joints with several coordinates.
    """

    name = "wbc"

    def __init__(
        self, controller: Controller, posture: str, plant: Plant | None = None, *, real_time: bool = False
    ) -> None:
        validation.instance("controller", controller, Controller, "a wbc Controller")
        self.robot = controller.stack.robot
        if self.robot.nq != self.robot.nv:
            raise RangeError("controller", self.robot.name, "has joints with several coordinates")
        validation.one_of("posture", posture, [entry.name for entry in controller.stack.entries])
        self.id, self.controller, self.real_time = self.robot.name, controller, real_time
        self._posture, self._plant = posture, plant or KinematicPlant(self.robot)
        self._connection: Connection | None = None
        self._due = 0.0

    @property
    def observation_features(self) -> dict[str, type]:
        """What an observation has."""
        return {f"{name}{POSITION}": float for name in self.robot.joint_names}

    @property
    def action_features(self) -> dict[str, type]:
        """What an action has."""
        return self.observation_features

    @property
    def is_connected(self) -> bool:
        """Between :meth:`connect` and :meth:`disconnect`."""
        return self._connection is not None

    def connect(self, calibrate: bool = True) -> None:
        """Bring the robot to rest at its neutral configuration.

        Raises:
            PlantError: it cannot be there.
        """
        self._connection = connection = Connection(self._plant, self.robot, self.controller.stack.dt)
        self._q = connection.reset(self.robot.neutral).q
        self.controller.reset(self._q)
        self._target, self._due = self._q.copy(), time.monotonic()

    def disconnect(self) -> None:
        """Bring the robot to rest."""
        if self._connection is not None:
            self._connection.rest()
            self._connection = None

    def get_observation(self) -> dict[str, float]:
        """Positions of the joints.

        Raises:
            RangeError: it is not connected.
        """
        self._connected()
        return {f"{name}{POSITION}": float(x) for name, x in zip(self.robot.joint_names, self._q, strict=True)}

    def send_action(self, action: Mapping[str, Any]) -> dict[str, float]:
        """Go towards positions for one tick; joints that it does not name keep their last target.

        Returns:
            Where the joints are after it, which a data set records as what was done.

        Raises:
            UnknownNameError: no such joint. RangeError: it is not connected. NotFiniteError: a number that is none.
            PlantError: the robot failed.
        """
        connection, names = self._connected(), list(self.robot.joint_names)
        target = self._target.copy()
        for key, value in action.items():
            if key not in self.action_features:
                raise UnknownNameError("action", key, self.action_features)
            target[names.index(key.removesuffix(POSITION))] = validation.scalar(f"action.{key}", value)
        self.controller[self._posture].target = target
        self._target = target
        step = self.controller.step(self._q)
        if self.real_time:
            self._due = max(self._due + self.controller.stack.dt, time.monotonic() - self.controller.stack.dt)
            time.sleep(max(0.0, self._due - time.monotonic()))
        self._q = connection.drive(step.v).q
        return self.get_observation()

    def _connected(self) -> Connection:
        if self._connection is None:
            raise RangeError("robot", self.id, "is not connected; call connect")
        return self._connection


class StackTeleoperator(Uncalibrated):
    """A recorded motion as what leads a robot, with the methods of ``lerobot.teleoperators.Teleoperator``.

    Args:
        motion: from :func:`wbc.formats.read_motion`. clock: time since it began [s]; default: since :meth:`connect`.
    """

    name = "wbc_motion"

    def __init__(self, motion: RecordedMotion, clock: Callable[[], float] | None = None) -> None:
        self._motion = validation.instance("motion", motion, RecordedMotion, "a RecordedMotion")
        self.id, self._clock = "motion", clock
        self._began: float | None = None

    @property
    def action_features(self) -> dict[str, type]:
        """What an action has."""
        return {f"{name}{POSITION}": float for name in self._motion.joints}

    @property
    def feedback_features(self) -> dict[str, type]:
        """It feels nothing."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Between :meth:`connect` and :meth:`disconnect`."""
        return self._began is not None

    def connect(self, calibrate: bool = True) -> None:
        """Begin the motion."""
        self._began = time.monotonic()

    def disconnect(self) -> None:
        """End it."""
        self._began = None

    def get_action(self) -> dict[str, float]:
        """Positions of the recorded joints now.

        Raises:
            RangeError: it is not connected.
        """
        if self._began is None:
            raise RangeError("teleoperator", self.id, "is not connected; call connect")
        now = time.monotonic() - self._began if self._clock is None else self._clock()
        return {
            f"{name}{POSITION}": float(x) for name, x in zip(self._motion.joints, self._motion.at(now), strict=True)
        }

    def send_feedback(self, feedback: Mapping[str, Any]) -> None:
        """It feels nothing."""
