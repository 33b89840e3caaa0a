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


def named(joints: Iterable[str], values: Iterable[Any]) -> dict[str, Any]:
    """What LeRobot calls the positions of joints -> a value each."""
    return {f"{joint}.pos": value for joint, value in zip(joints, values, strict=True)}


class LeRobotDevice:
    """What LeRobot asks of robots and teleoperators alike; there is nothing to calibrate or to configure.

    Attributes:
        name, id: as LeRobot names it. joints: of actions.
    """

    name = "wbc"
    is_calibrated = True

    def __init__(self, identity: str, joints: Sequence[str]) -> None:
        self.id, self.joints, self.is_connected = identity, tuple(joints), False

    @property
    def action_features(self) -> dict[str, type]:
        """What an action has."""
        return named(self.joints, [float] * len(self.joints))

    def calibrate(self) -> None:
        """Nothing to do."""

    configure = calibrate

    def disconnect(self) -> None:
        """End it."""
        self.is_connected = False

    def _require(self) -> None:
        if not self.is_connected:
            raise RangeError(self.name, self.id, "is not connected; call connect")


class StackRobot(LeRobotDevice):
    """Joints that go where an action says, as far as the stack's constraints let them: limits, obstacles, contacts.

    It has the methods of ``lerobot.robots.Robot``, without inheriting from it, so that LeRobot need not be installed;
    observations and actions are ``{"JOINT.pos": position}`` [rad or m].

        robot = wbc.learning.StackRobot(controller, "posture")
        robot.connect()
        robot.send_action({"panda_joint1.pos": 0.3})

    Attributes:
        robot, controller: what is commanded, and what commands. real_time: whether an action takes a tick's time.

    Args:
        controller: of a stack that commands velocities of joints with one coordinate each.
        posture: name of its task ``Posture``, whose target actions are.
        plant: the robot; default: one that does what it is told.

    Raises:
        ShapeError: no controller. UnknownNameError: no such task. RangeError: joints with several coordinates.
    """

    observation_features = LeRobotDevice.action_features

    def __init__(
        self, controller: Controller, posture: str, plant: Plant | None = None, *, real_time: bool = False
    ) -> None:
        validation.instance("controller", controller, Controller, "a wbc Controller")
        self.robot = controller.stack.robot
        if self.robot.nq != self.robot.nv:
            raise RangeError("controller", self.robot.name, "has joints with several coordinates")
        validation.one_of("posture", posture, [entry.name for entry in controller.stack.entries])
        super().__init__(self.robot.name, self.robot.joint_names)
        self.controller, self.real_time, self._posture = controller, real_time, posture
        self._connection = Connection(plant, self.robot, controller.stack.dt)

    def connect(self, calibrate: bool = True) -> None:
        """Bring the robot to rest at its neutral configuration.

        Raises:
            PlantError: it cannot be there.
        """
        self._q = self._connection.reset(self.robot.neutral).q
        self.controller.reset(self._q)
        self._target, self._due, self.is_connected = self._q.copy(), time.monotonic(), True

    def disconnect(self) -> None:
        """Bring the robot to rest."""
        if self.is_connected:
            self._connection.rest()
        super().disconnect()

    def get_observation(self) -> dict[str, float]:
        """Positions of the joints.

        Raises:
            RangeError: it is not connected.
        """
        self._require()
        return named(self.joints, self._q.tolist())

    def send_action(self, action: Mapping[str, Any]) -> dict[str, float]:
        """Go towards positions for one tick; joints that it does not name keep their last target.

        Returns:
            Where the joints are after it, which a data set records as what was done.

        Raises:
            UnknownNameError: no such joint. RangeError: it is not connected. NotFiniteError: a number that is none.
            PlantError: the robot failed.
        """
        self._require()
        places, target = named(self.joints, range(len(self.joints))), self._target.copy()
        for key, value in action.items():
            target[places[validation.one_of("action", key, places)]] = validation.scalar(f"action.{key}", value)
        self.controller[self._posture].target = target
        self._target = target
        step = self.controller.step(self._q)
        if self.real_time:
            self._due = max(self._due + self.controller.stack.dt, time.monotonic() - self.controller.stack.dt)
            time.sleep(max(0.0, self._due - time.monotonic()))
        self._q = self._connection.drive(step.v).q
        return self.get_observation()


class StackTeleoperator(LeRobotDevice):
    """A recorded motion as what leads a robot, with the methods of ``lerobot.teleoperators.Teleoperator``; it feels
    nothing.

    Args:
        motion: from :func:`wbc.formats.read_motion`. clock: time since it began [s]; default: since :meth:`connect`.
    """

    name = "wbc_motion"
    feedback_features: Mapping[str, type] = {}

    def __init__(self, motion: RecordedMotion, clock: Callable[[], float] | None = None) -> None:
        self._motion = validation.instance("motion", motion, RecordedMotion, "a RecordedMotion")
        super().__init__("motion", motion.joints)
        self._clock = clock

    def connect(self, calibrate: bool = True) -> None:
        """Begin the motion."""
        self._began, self.is_connected = time.monotonic(), True

    def get_action(self) -> dict[str, float]:
        """Positions of the recorded joints now.

        Raises:
            RangeError: it is not connected.
        """
        self._require()
        now = time.monotonic() - self._began if self._clock is None else self._clock()
        return named(self.joints, self._motion.at(now).tolist())

    def send_feedback(self, feedback: Mapping[str, Any]) -> None:
        """It is not felt."""
