"""Messages of ROS 2 over DDS or Zenoh, without ROS: bytes as ROS has them, whose types the package rosbags knows."""

from __future__ import annotations

import json
import os
import struct
import time
import weakref
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc import extras
from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO
from wbc.validation import Array

#: States that are kept until they are taken
KEPT = 64
STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
#: What rmw_zenoh sends beside a message: its number, time [ns], and length and bytes of who sends
ATTACHMENT = struct.Struct("<qqB16s")


def dds_name(kind: str) -> str:
    """``sensor_msgs/msg/JointState`` as DDS and Zenoh call it."""
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


class Ros2Link(ABC):
    """Hears joint states and sends trajectories; who inherits knows over what."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_typestore

        self._store: Any = get_typestore(Stores.ROS2_JAZZY)

    @abstractmethod
    def take(self) -> Sequence[Any]:
        """The states that have come, with ``name``, ``position`` and ``velocity``."""

    def send(self, joints: Sequence[str], q: Array, v: Array, seconds: float) -> None:
        """A trajectory of one point: be at ``q`` with ``v`` in so many seconds."""
        made, none, whole = self._store.types, np.zeros(0), int(seconds)
        span = made["builtin_interfaces/msg/Duration"](whole, round((seconds - whole) * NANO))
        point = made["trajectory_msgs/msg/JointTrajectoryPoint"](q, v, none, none, span)
        header = made["std_msgs/msg/Header"](made["builtin_interfaces/msg/Time"](0, 0), "")
        self._put(bytes(self._store.serialize_cdr(made[TRAJECTORY](header, list(joints), [point]), TRAJECTORY)))

    @abstractmethod
    def _put(self, data: bytes) -> None:
        """Send a trajectory."""


class DdsLink(Ros2Link):
    """Over Cyclone DDS, in a domain, as ROS 2 has it by default: XCDR 1, topics under ``rt/``.

    Raises:
        MissingPackageError: cyclonedds is not installed. FormatError: it does not connect.
    """

    def __init__(self, states: str, commands: str, domain: int) -> None:
        extras.require("ros2", "a robot of ROS 2")
        from cyclonedds.core import DDSException
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        super().__init__()
        known = dict[str, Any]()
        state, self._order = (_idl(self._store, kind, known) for kind in (STATE, TRAJECTORY))
        plain = Policy.DataRepresentation(use_cdrv0_representation=True)
        kept = Qos(Policy.Reliability.Reliable(NANO), Policy.History.KeepLast(1), plain)
        heard = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1), plain)
        try:
            me = self._participant = DomainParticipant(domain)
            self._reader = DataReader(me, Topic(me, f"rt/{states}", state), qos=heard)
            self._writer = DataWriter(me, Topic(me, f"rt/{commands}", self._order), qos=kept)
        except DDSException as error:
            raise FormatError("domain", domain, f"DDS does not connect: {error}") from error

    def take(self) -> Sequence[Any]:
        # What is said of an endpoint that is gone has no names
        return [message for message in self._reader.take(KEPT) if hasattr(message, "name")]

    def _put(self, data: bytes) -> None:
        self._writer.write(self._order.deserialize(data))


def _idl(store: Any, kind: str, known: dict[str, Any]) -> Any:
    """The class of a message in Cyclone."""
    from cyclonedds.idl import make_idl_struct, types as idl
    from cyclonedds.idl.annotations import final

    def of(field: Any) -> Any:
        node, what = field
        if node.name == "SEQUENCE":
            return idl.sequence[of(what[0])]
        if node.name == "NAME":
            return _idl(store, what, known)
        return str if what[0] == "string" else getattr(idl, what[0])

    if kind not in known:
        fields = {name: of(field) for name, field in store.fielddefs[kind][1]}
        known[kind] = final(make_idl_struct(kind.rpartition("/")[2], dds_name(kind), fields))
    return known[kind]


class ZenohLink(Ros2Link):
    """Over Zenoh, with the keys and attachments of rmw_zenoh; lists of topics, which it takes from tokens, lack it.

    Args:
        locator: of a router or peer, such as ``tcp/192.168.1.5:7447``; "": peers are found by multicast.

    Raises:
        MissingPackageError: eclipse-zenoh is not installed. FormatError: it does not connect.
    """

    def __init__(self, states: str, commands: str, domain: int, locator: str) -> None:
        extras.require("zenoh", "a robot of ROS 2 over Zenoh")
        import zenoh

        super().__init__()
        store, config = self._store, zenoh.Config()
        if locator:
            config.insert_json5("connect/endpoints", json.dumps([locator]))
        came = self._came = deque[Any](maxlen=KEPT)
        self._sent, self._gid = 0, os.urandom(16)
        try:
            session = zenoh.open(config)
            # An open one keeps the program from ending
            weakref.finalize(self, session.close)
            key = f"{domain}/{states}/{dds_name(STATE)}/{store.hash_rihs01(STATE)}"
            self._subscriber = session.declare_subscriber(key, lambda sample: came.append(sample.payload))
            key = f"{domain}/{commands}/{dds_name(TRAJECTORY)}/{store.hash_rihs01(TRAJECTORY)}"
            self._publisher = session.declare_publisher(key)
        except zenoh.ZError as error:
            raise FormatError("zenoh", locator, f"Zenoh does not connect: {error}") from error

    def take(self) -> Sequence[Any]:
        came = range(len(self._came))
        return [self._store.deserialize_cdr(bytes(self._came.popleft()), STATE) for _ in came]

    def _put(self, data: bytes) -> None:
        self._sent += 1
        beside = ATTACHMENT.pack(self._sent, time.time_ns(), len(self._gid), self._gid)
        self._publisher.put(data, attachment=beside)
