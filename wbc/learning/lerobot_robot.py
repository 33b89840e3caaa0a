"""A robot under a stack, with the methods that LeRobot asks of robots and teleoperators."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from wbc import validation
from wbc.api import Controller
from wbc.errors import RangeError
from wbc.formats.motion import RecordedMotion
from wbc.simulation import Connection, Plant


class LeRobotDevice:
    """What LeRobot asks of robots and teleoperators alike; there is nothing to calibrate or to configure."""

    name = "wbc"
    is_calibrated = True

    def __init__(self, identity: str, joints: Sequence[str]) -> None:
        self.id, self.joints, self.is_connected = identity, tuple(joints), False
        self.action_features = self._named([float] * len(self.joints))

    def calibrate(self) -> None:
        """Nothing to do."""

    configure = calibrate

    def disconnect(self) -> None:
        self.is_connected = False

    def _named(self, values: Iterable[Any]) -> dict[str, Any]:
        return {f"{joint}.pos": value for joint, value in zip(self.joints, values, strict=True)}

    def _require(self) -> None:
        if not self.is_connected:
            raise RangeError(self.name, self.id, "is not connected; call connect")


class StackRobot(LeRobotDevice):
    """Joints that go where an action says, as far as the stack's constraints let them: limits, obstacles, contacts.

    It has the methods of ``lerobot.robots.Robot``, without inheriting from it, so that LeRobot need not be installed;
    observations and actions are ``{"JOINT.pos": position}`` [rad or m].

    Args:
        controller: of a stack that commands velocities of joints with one coordinate each.
        posture: name of its task ``Posture``, whose target actions are.
        plant: the robot; default: one that does what it is told at once, which :class:`wbc.simulation.RealTime` paces.

    Raises:
        ShapeError: no controller. UnknownNameError: no such task, or no joint of an action. RangeError: joints with
            several coordinates, or methods before ``connect``. PlantError: the robot failed.
    """

    def __init__(self, controller: Controller, posture: str, plant: Plant | None = None) -> None:
        robot = validation.instance("controller", controller, Controller, "a wbc Controller").stack.robot
        if robot.nq != robot.nv:
            raise RangeError("controller", robot.name, "has joints with several coordinates")
        validation.one_of("posture", posture, [entry.name for entry in controller.stack.entries])
        super().__init__(robot.name, robot.joint_names)
        self.observation_features = self.action_features
        self.controller, self._posture, self._start = controller, controller[posture], robot.neutral
        self._connection = Connection(plant, robot, controller.stack.dt)

    def connect(self, calibrate: bool = True) -> None:
        """Bring the robot to rest at its neutral configuration."""
        self._q = self._connection.reset(self._start).q
        self.controller.reset(self._q)
        self._target, self.is_connected = self._q.copy(), True

    def disconnect(self) -> None:
        if self.is_connected:
            self._connection.rest()
        super().disconnect()

    def get_observation(self) -> dict[str, float]:
        self._require()
        return self._named(self._q.tolist())

    def send_action(self, action: Mapping[str, Any]) -> dict[str, float]:
        """One tick towards positions; joints that it does not name keep their last target. Returns where they are."""
        self._require()
        places, target = self._named(range(len(self.joints))), self._target.copy()
        for key, value in action.items():
            target[places[validation.one_of("action", key, places)]] = validation.scalar(f"action.{key}", value)
        self._posture.target = self._target = target
        self._q = self._connection.drive(self.controller.step(self._q).v).q
        return self.get_observation()


class StackTeleoperator(LeRobotDevice):
    """A recorded motion that leads a robot, with the methods of ``lerobot.teleoperators.Teleoperator``.

    Args:
        motion: from :func:`wbc.formats.read_motion`. clock: time since it began [s]; default: since :meth:`connect`.

    Raises:
        ShapeError: no motion. RangeError: ``get_action`` before ``connect``.
    """

    name = "wbc_motion"
    feedback_features: Mapping[str, type] = {}

    def __init__(self, motion: RecordedMotion, clock: Callable[[], float] | None = None) -> None:
        self._motion = validation.instance("motion", motion, RecordedMotion, "a RecordedMotion")
        super().__init__("motion", motion.joints)
        self._clock = clock or (lambda: time.monotonic() - self._began)

    def connect(self, calibrate: bool = True) -> None:
        """Begin the motion."""
        self._began, self.is_connected = time.monotonic(), True

    def get_action(self) -> dict[str, float]:
        self._require()
        return self._named(self._motion.at(self._clock()).tolist())

    def send_feedback(self, feedback: Mapping[str, Any]) -> None:
        """Feel nothing."""
