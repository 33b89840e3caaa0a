"""A robot of ROS 2 as a plant, over DDS and without ROS, by the types of messages that rosbags knows."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from typing import Any

import numpy as np

from wbc import extras, validation
from wbc.errors import RangeError
from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO
from wbc.formats.motion_file import ros2_types
from wbc.robot.robot import Robot, checked_robot
from wbc.simulation import Command, CommandKind, PlantError, PlantState
from wbc.validation import Array

#: How long a robot may be silent before its state is no longer trusted [s]
SILENT = 0.5
#: How long a robot may take to say where it is, and to be at rest where it is wanted [s]
PATIENCE = 10.0
#: Where a robot is taken to be where it is wanted [rad or m]
THERE = 1e-2
#: States that are kept until they are taken
KEPT = 64
STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


class Ros2Plant:
    """Reads ``sensor_msgs/JointState`` and commands ``trajectory_msgs/JointTrajectory``, one point a tick, as the
    joint_trajectory_controller of ros2_control takes them.

    A command of velocities is the position to which it leads within the next tick. Times are of this machine's clock.
    Messages are those of ROS 2 over DDS as it is by default: XCDR 1, topics under ``rt/``.

    Args:
        robot: with joints of one coordinate each; what messages say of other joints is not looked at.
        states, commands: names of topics. domain: ``ROS_DOMAIN_ID``, to 232.

    Raises:
        MissingPackageError: cyclonedds is not installed.
        RangeError: joints with several coordinates, or no domain. FormatError: no connection.
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
        self._robot = checked_robot(robot)
        if robot.nq != robot.nv:
            raise RangeError("robot", robot.name, "has joints with several coordinates, which JointState has not")
        self.nq, self.nv = robot.nq, robot.nv
        validation.integer("domain", domain, high=232)
        extras.require("ros2", "a robot of ROS 2")
        from cyclonedds import core, pub, sub, topic
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.qos import Policy, Qos

        plain = Policy.History.KeepLast(1), Policy.DataRepresentation(use_cdrv0_representation=True)
        heard, sent = Qos(Policy.Reliability.BestEffort, *plain), Qos(Policy.Reliability.Reliable(NANO), *plain)
        # Names of ROS 2 -> classes of messages in Cyclone
        self._messages = dict[str, Any]()
        state, order = _idl(ros2_types(), STATE, self._messages), _idl(ros2_types(), TRAJECTORY, self._messages)
        try:
            me = DomainParticipant(domain)
            self._reader = sub.DataReader(me, topic.Topic(me, f"rt/{states.strip('/')}", state), qos=heard)
            self._writer = pub.DataWriter(me, topic.Topic(me, f"rt/{commands.strip('/')}", order), qos=sent)
        except core.DDSException as error:
            raise FormatError("domain", domain, f"DDS does not connect: {error}") from error
        self._q, self._v, self._heard = np.full(self.nq, math.nan), np.zeros(self.nv), -math.inf
        self._now, self._due, self._command = 0.0, 0.0, Command(CommandKind.VELOCITY, np.zeros(self.nv))

    def reset(self, q: Array, time: float) -> None:
        """Go to a configuration, and wait until the robot is there.

        Raises:
            PlantError: it says nothing, or does not come there.
        """
        self._wait(lambda: bool(np.isfinite(self._q).all()), "no JointState with all of its joints has come")
        limits = self._robot.limits.velocity
        # Half as fast as it may
        slowest = float(np.where(np.isfinite(limits), limits, 1.0).min())
        self._send(q, np.zeros(self.nv), max(0.1, 2.0 * float(np.abs(q - self._q).max()) / slowest))
        self._wait(lambda: bool(np.abs(self._q - q).max() < THERE), "it does not come to where it is wanted")
        self._now, self._due = time, clock.monotonic()

    def _wait(self, done: Callable[[], bool], reason: str) -> None:
        until = clock.monotonic() + PATIENCE
        while not done():
            if clock.monotonic() > until:
                raise PlantError("plant", self._robot.name, reason)
            clock.sleep(1e-3)
            self.read()

    def read(self) -> PlantState:
        """The last message with all joints, invalid where it is older than half a second."""
        for message in self._reader.take(KEPT):
            # What is said of an endpoint that is gone has no names
            places = {name: k for k, name in enumerate(getattr(message, "name", ()))}
            if places.keys() >= set(self._robot.joint_names) and len(message.position) == len(places):
                order, self._heard = [places[name] for name in self._robot.joint_names], clock.monotonic()
                self._q = np.array(message.position)[order]
                full = len(message.velocity) == len(places)
                self._v = np.array(message.velocity)[order] if full else np.zeros(self.nv)
        valid = clock.monotonic() - self._heard < SILENT and np.isfinite([*self._q, *self._v]).all()
        return PlantState(self._q.copy(), self._v.copy(), self._now, bool(valid))

    def apply(self, command: Command) -> None:
        # It is sent by advance, which knows for how long it is
        self._command = command

    def advance(self, dt: float) -> None:
        """Send the command, and wait until its time is over."""
        values = self._command.values
        if self._command.kind == CommandKind.POSITION:
            self._send(values, np.zeros(self.nv), dt)
        else:
            self._send(self._q + dt * values, values, dt)
        self._now, self._due = self._now + dt, self._due + dt
        clock.sleep(max(0.0, self._due - clock.monotonic()))

    def _send(self, q: Array, v: Array, seconds: float) -> None:
        """A trajectory of one point: be at q with v in so many seconds."""
        made = self._messages
        span = made["builtin_interfaces/msg/Duration"](int(seconds), round(seconds % 1.0 * NANO))
        point = made["trajectory_msgs/msg/JointTrajectoryPoint"](q.tolist(), v.tolist(), [], [], span)
        header = made["std_msgs/msg/Header"](made["builtin_interfaces/msg/Time"](0, 0), "")
        self._writer.write(made[TRAJECTORY](header, list(self._robot.joint_names), [point]))


def _idl(types: Any, kind: str, known: dict[str, Any]) -> Any:
    """The class of a message in Cyclone."""
    from cyclonedds.idl import annotations, make_idl_struct, types as idl

    def of(node: Any, what: Any) -> Any:
        if node.name == "SEQUENCE":
            return idl.sequence[of(*what[0])]
        if node.name == "NAME":
            return _idl(types, what, known)
        return str if what[0] == "string" else getattr(idl, what[0])

    if kind not in known:
        fields = {name: of(*field) for name, field in types.fielddefs[kind][1]}
        package, _, name = kind.split("/")
        known[kind] = annotations.final(make_idl_struct(name, f"{package}::msg::dds_::{name}_", fields))
    return known[kind]
