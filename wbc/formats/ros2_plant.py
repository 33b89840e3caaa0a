"""A robot of ROS 2 as a plant, over DDS and without ROS."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable

import numpy as np

from wbc import extras, validation
from wbc.errors import RangeError
from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO
from wbc.robot.robot import Robot, checked_robot
from wbc.simulation import Command, CommandKind, PlantError, PlantState
from wbc.validation import Array

#: How long a robot may be silent before its state is no longer trusted [s]
SILENT = 0.5
#: How long a robot may take to say where it is, and to be at rest where it is wanted [s]
PATIENCE = 10.0
#: Where a robot is taken to be where it is wanted [rad or m]
THERE = 1e-2
#: Most of DDS's domains
DOMAINS = 232


class Ros2Plant:
    """Reads ``sensor_msgs/JointState`` and commands ``trajectory_msgs/JointTrajectory``, one point a tick, as the
    joint_trajectory_controller of ros2_control takes them.

        plant = wbc.formats.Ros2Plant(robot)
        wbc.track.run(..., plant=plant)

    A command of velocities is the position to which it leads within the next tick. Times are of this machine's clock.

    Attributes:
        nq, nv, time_step, commands: as of :class:`wbc.simulation.Plant`.

    Args:
        robot: with joints of one coordinate each; what messages say of other joints is not looked at.
        states, commands: names of topics. domain: ``ROS_DOMAIN_ID``.

    Raises:
        MissingPackageError: cyclonedds is not installed. RangeError: joints with several coordinates, or no domain.
        FormatError: no connection.
    """

    time_step = 0.0
    commands = (CommandKind.VELOCITY, CommandKind.POSITION)

    def __init__(
        self,
        robot: Robot,
        states: str = "joint_states",
        commands: str = "joint_trajectory_controller/joint_trajectory",
        *,
        domain: int = 0,
    ) -> None:
        extras.require("ros2", "a robot of ROS 2")
        from cyclonedds.core import DDSException

        self._robot = checked_robot(robot)
        if robot.nq != robot.nv:
            raise RangeError("robot", robot.name, "has joints with several coordinates, which JointState has not")
        self.nq, self.nv = robot.nq, robot.nv
        number = int(validation.scalar("domain", domain, low=0, high=DOMAINS))
        try:
            self._connect(states, commands, number)
        except DDSException as error:
            raise FormatError("domain", domain, f"DDS does not connect: {error}") from error
        self._q, self._v = np.full(self.nq, math.nan), np.zeros(self.nv)
        self._heard = -math.inf
        self._now = self._due = 0.0
        self._command = Command(CommandKind.VELOCITY, np.zeros(self.nv))

    def _connect(self, states: str, commands: str, domain: int) -> None:
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        from wbc.formats.ros2_types import JointStateMessage, TrajectoryMessage

        # As ROS 2 has it: XCDR 1, and topics under rt/
        plain = Policy.DataRepresentation(use_cdrv0_representation=True)
        kept = Qos(Policy.Reliability.Reliable(NANO), Policy.History.KeepLast(1), plain)
        heard = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1), plain)
        self._participant = DomainParticipant(domain)
        self._reader = DataReader(
            self._participant, Topic(self._participant, f"rt/{states.strip('/')}", JointStateMessage), qos=heard
        )
        self._writer = DataWriter(
            self._participant, Topic(self._participant, f"rt/{commands.strip('/')}", TrajectoryMessage), qos=kept
        )

    def _hear(self) -> None:
        """Take in what has come."""
        for message in self._reader.take(64):
            places = {name: k for k, name in enumerate(getattr(message, "name", ()))}
            if any(name not in places for name in self._robot.joint_names):
                continue
            order = [places[name] for name in self._robot.joint_names]
            if len(message.position) != len(places):
                continue
            self._q = np.array(message.position)[order]
            full = len(message.velocity) == len(places)
            self._v = np.array(message.velocity)[order] if full else np.zeros(self.nv)
            self._heard = clock.monotonic()

    def reset(self, q: Array, time: float) -> None:
        """Go to a configuration, and wait until the robot is there.

        Raises:
            PlantError: it says nothing, or does not come there.
        """
        self._wait(lambda: bool(np.isfinite(self._q).all()), "no JointState with all of its joints has come")
        far = float(np.abs(q - self._q).max())
        speed = np.where(np.isfinite(self._robot.limits.velocity), self._robot.limits.velocity, 1.0)
        # Half as fast as it may
        self._send(q, np.zeros(self.nv), max(0.1, 2.0 * far / float(speed.min())))
        self._wait(lambda: bool(np.abs(self._q - q).max() < THERE), "it does not come to where it is wanted")
        self._now, self._due = time, self._clock()

    def _wait(self, done: Callable[[], bool], reason: str) -> None:
        until = self._clock() + PATIENCE
        while True:
            self._hear()
            if done():
                return
            if self._clock() > until:
                raise PlantError("plant", self._robot.name, reason)
            clock.sleep(1e-3)

    def read(self) -> PlantState:
        """The last message, invalid where it is older than half a second."""
        self._hear()
        valid = self._clock() - self._heard < SILENT and bool(np.isfinite(self._q).all() and np.isfinite(self._v).all())
        return PlantState(self._q.copy(), self._v.copy(), self._now, valid)

    def apply(self, command: Command) -> None:
        """Keep it: it is sent by :meth:`advance`, which knows for how long it is."""
        self._command = command

    def advance(self, dt: float) -> None:
        """Send the command, and wait until its time is over."""
        if self._command.kind == CommandKind.POSITION:
            self._send(self._command.values, np.zeros(self.nv), dt)
        else:
            self._send(self._q + dt * self._command.values, self._command.values, dt)
        self._now, self._due = self._now + dt, self._due + dt
        clock.sleep(max(0.0, self._due - self._clock()))

    def _send(self, q: Array, v: Array, seconds: float) -> None:
        from wbc.formats.ros2_types import PointMessage, SpanMessage, TrajectoryMessage

        whole = int(seconds)
        span = SpanMessage(whole, round((seconds - whole) * NANO))
        point = PointMessage(q.tolist(), v.tolist(), [], [], span)
        self._writer.write(TrajectoryMessage(joint_names=list(self._robot.joint_names), points=[point]))

    @staticmethod
    def _clock() -> float:
        return clock.monotonic()
