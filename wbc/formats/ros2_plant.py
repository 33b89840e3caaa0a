"""A robot of ROS 2 as a plant, over DDS or Zenoh and without ROS, by the types of messages that rosbags knows."""

from __future__ import annotations

import itertools
import json
import math
import os
import struct
import time as clock
import weakref
from collections import deque
from collections.abc import Callable, Iterable
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
#: What rmw_zenoh sends beside a message: its number, time [ns], and length and bytes of who sends
ATTACHMENT = struct.Struct("<qqB16s")


class Ros2Plant:
    """Reads ``sensor_msgs/JointState`` and commands ``trajectory_msgs/JointTrajectory``, one point a tick, as the
    joint_trajectory_controller of ros2_control takes them.

    A command of velocities is the position to which it leads within the next tick. Times are of this machine's clock.

    Args:
        robot: with joints of one coordinate each; what messages say of other joints is not looked at.
        states, commands: names of topics. domain: ``ROS_DOMAIN_ID``, to 232.
        zenoh: in place of DDS over Zenoh as rmw_zenoh speaks it: the router or peer, such as ``tcp/127.0.0.1:7447``, or
            "" for peers that are found by multicast.

    Raises:
        MissingPackageError: cyclonedds, or eclipse-zenoh, is not installed.
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
        zenoh: str | None = None,
    ) -> None:
        self._robot = checked_robot(robot)
        if robot.nq != robot.nv:
            raise RangeError("robot", robot.name, "has joints with several coordinates, which JointState has not")
        self.nq, self.nv = robot.nq, robot.nv
        topics = {STATE: states.strip("/"), TRAJECTORY: commands.strip("/")}
        validation.integer("domain", domain, high=232)
        self._link = _DdsLink(topics, domain) if zenoh is None else _ZenohLink(topics, domain, zenoh)
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
        for message in self._link.take():
            places = {name: k for k, name in enumerate(message.name)}
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
        made, none = self._link.types.types, np.zeros(0)
        span = made["builtin_interfaces/msg/Duration"](int(seconds), round(seconds % 1.0 * NANO))
        point = made["trajectory_msgs/msg/JointTrajectoryPoint"](q, v, none, none, span)
        header = made["std_msgs/msg/Header"](made["builtin_interfaces/msg/Time"](0, 0), "")
        message = made[TRAJECTORY](header, list(self._robot.joint_names), [point])
        self._link.put(bytes(self._link.types.serialize_cdr(message, TRAJECTORY)))


class _DdsLink:
    """Hears states and sends trajectories over Cyclone DDS as ROS 2 does by default: XCDR 1, topics under ``rt/``."""

    def __init__(self, topics: dict[str, str], domain: int) -> None:
        extras.require("ros2", "a robot of ROS 2")
        from cyclonedds.core import DDSException
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        self.types, known = ros2_types(), dict[str, Any]()
        plain = Policy.History.KeepLast(1), Policy.DataRepresentation(use_cdrv0_representation=True)
        heard, sent = Qos(Policy.Reliability.BestEffort, *plain), Qos(Policy.Reliability.Reliable(NANO), *plain)
        try:
            me = DomainParticipant(domain)
            state, order = (Topic(me, f"rt/{name}", _idl(self.types, kind, known)) for kind, name in topics.items())
            self._reader, self._writer = DataReader(me, state, qos=heard), DataWriter(me, order, qos=sent)
        except DDSException as error:
            raise FormatError("domain", domain, f"DDS does not connect: {error}") from error
        self._order = known[TRAJECTORY]

    def take(self) -> Iterable[Any]:
        # What is said of an endpoint that is gone has no names
        return (message for message in self._reader.take(KEPT) if hasattr(message, "name"))

    def put(self, data: bytes) -> None:
        self._writer.write(self._order.deserialize(data))


class _ZenohLink:
    """The same over Zenoh, with keys and attachments of rmw_zenoh, but not its tokens, of which it lists topics."""

    def __init__(self, topics: dict[str, str], domain: int, locator: str) -> None:
        extras.require("zenoh", "a robot of ROS 2 over Zenoh")
        import zenoh

        self.types, config, came = ros2_types(), zenoh.Config(), deque[bytes](maxlen=KEPT)
        if locator:
            config.insert_json5("connect/endpoints", json.dumps([locator]))
        self._came, self._sent, self._sender = came, itertools.count(1), os.urandom(16)
        hashes = {kind: self.types.hash_rihs01(kind) for kind in topics}
        states, commands = (f"{domain}/{name}/{_dds_name(kind)}/{hashes[kind]}" for kind, name in topics.items())
        try:
            session = zenoh.open(config)
            # An open one keeps the program from ending
            weakref.finalize(self, session.close)
            self._subscriber = session.declare_subscriber(states, lambda sample: came.append(bytes(sample.payload)))
            self._publisher = session.declare_publisher(commands)
        except zenoh.ZError as error:
            raise FormatError("zenoh", locator, f"Zenoh does not connect: {error}") from error

    def take(self) -> Iterable[Any]:
        return [self.types.deserialize_cdr(self._came.popleft(), STATE) for _ in range(len(self._came))]

    def put(self, data: bytes) -> None:
        attachment = ATTACHMENT.pack(next(self._sent), clock.time_ns(), 16, self._sender)
        self._publisher.put(data, attachment=attachment)


def _dds_name(kind: str) -> str:
    """``sensor_msgs/msg/JointState`` as DDS and Zenoh call it."""
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


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
        known[kind] = annotations.final(make_idl_struct(kind.rpartition("/")[2], _dds_name(kind), fields))
    return known[kind]
