"""Runs for Rerun and Foxglove, and robots of ROS 2, where their packages are installed, by their own readers and
endpoints.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import websockets

import wbc
from tests.formats.runs import recorded
from tests.refusals import assert_refused
from wbc import extras
from wbc.formats import FormatError, Ros2Plant, convert
from wbc.formats.run import Piece, Run
from wbc.formats.writers import serve
from wbc.simulation import Connection


def free_port() -> int:
    """Of this machine."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def test_rerun_reads_its_recording(tmp_path: Path) -> None:
    from rerun import chunk as chunks

    recording = recorded(tmp_path, 0)
    file, _ = convert(recording, "rrd", rate=1000.0)
    log = wbc.Recording(recording).log()
    found: dict[str, list[float]] = {}
    entities = set[str]()
    for chunk in chunks.RrdReader(str(file)).stream():
        entities.add(str(chunk.entity_path))
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if "Scalars" in name]
        if str(chunk.entity_path) == "/tick/q" and names:
            found.setdefault("q", []).extend(batch.column(names[0]).to_pylist())
    assert {"/binding", "/why", "/scene/target/hand", "/scene/robot/panda_link7", "/tick/residual"} <= entities
    assert np.allclose(np.array(found["q"]), log.array("q"))


def test_foxglove_is_told_every_tick(tmp_path: Path) -> None:
    """A client that speaks the protocol itself: subscribes, and reads what comes."""
    extras.require("foxglove", "a server in a thread")
    recording = recorded(tmp_path, 0, ticks=20)
    log, run, port = wbc.Recording(recording).log(), Run(recording), free_port()
    served, heard = threading.Event(), threading.Event()

    def pieces() -> Iterator[Piece]:
        served.set()
        heard.wait()
        yield from run.pieces()

    server = threading.Thread(target=serve, args=(run, pieces(), Path(f"127.0.0.1:{port}")))
    server.start()
    assert served.wait(20.0)

    async def listen() -> dict[str, list[Any]]:
        told: dict[str, list[Any]] = {}
        address = f"ws://127.0.0.1:{port}"
        async with websockets.connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
            topics: dict[int, str] = {}
            while len(topics) < 5:
                said = json.loads(text) if isinstance(text := await socket.recv(), str) else {}
                topics |= {one["id"]: one["topic"] for one in said.get("channels", ())}
            wanted = [{"id": number, "channelId": number} for number in topics]
            await socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            await asyncio.sleep(0.3)
            heard.set()
            while len(told.get("/tick", ())) < len(log):
                data = await asyncio.wait_for(socket.recv(), 20.0)
                if isinstance(data, bytes) and data[0] == 1:
                    number, _ = struct.unpack_from("<IQ", data, 1)
                    told.setdefault(topics[number], []).append(json.loads(data[13:]))
        return told

    try:
        told = asyncio.run(listen())
    finally:
        heard.set()
        server.join()
    assert [tick["t"] for tick in told["/tick"]] == log["t"].tolist()
    assert told["/scene"][0]["entities"]
    assert told["/tf"]
    assert_refused(lambda: convert(recording, "foxglove", "localhost"), FormatError, "HOST:PORT")


ENDPOINT = """
import sys, time
from dataclasses import dataclass
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

numbers = sequence[float64]

@dataclass
@final
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32

@dataclass
@final
class Span(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: int32
    nanosec: uint32

@dataclass
@final
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str

@dataclass
@final
class State(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: numbers
    velocity: numbers
    effort: numbers

@dataclass
@final
class Point(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectoryPoint_"):
    positions: numbers
    velocities: numbers
    accelerations: numbers
    effort: numbers
    time_from_start: Span

@dataclass
@final
class Order(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
    header: Header
    joint_names: sequence[str]
    points: sequence[Point]

domain, names = int(sys.argv[1]), sys.argv[2].split(",")
qos = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(10),
          Policy.DataRepresentation(use_cdrv0_representation=True))
me = DomainParticipant(domain)
told = DataReader(me, Topic(me, "rt/joint_trajectory_controller/joint_trajectory", Order), qos=qos)
said = DataWriter(me, Topic(me, "rt/joint_states", State), qos=qos)
q, orders, until = dict.fromkeys(names, 0.1), 0, time.time() + 60.0
print("up", flush=True)
while time.time() < until:
    for order in told.take(10):
        orders += 1
        q |= dict(zip(order.joint_names, order.points[-1].positions))
    turned = [*reversed(names), "gripper"]
    said.write(State(Header(Time(1, 2), ""), turned, [q.get(name, 0.0) for name in turned], [], []))
    time.sleep(0.002)
"""


def test_a_robot_of_ros2_is_a_plant(tmp_path: Path) -> None:
    """Its endpoint is another process with definitions of messages of its own."""
    wheel = __import__("cyclonedds")
    robot, domain = wbc.robots.load("ur5"), 100 + os.getpid() % 100
    (tmp_path / "endpoint.py").write_text(ENDPOINT)
    path = os.pathsep.join([str(Path(wheel.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, str(tmp_path / "endpoint.py"), str(domain), ",".join(robot.joint_names)]
    other = subprocess.Popen(command, env=os.environ | {"PYTHONPATH": path}, stdout=subprocess.PIPE)
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == b"up\n"
        plant = Ros2Plant(robot, domain=domain)
        connection = Connection(plant, robot, 0.02)
        state = connection.reset(robot.neutral)
        assert np.allclose(state.q, robot.neutral)
        stack = wbc.Stack(robot, dt=0.02).add(wbc.tasks.EndEffector("tool0"), name="hand")
        controller = stack.add(wbc.tasks.JointLimits()).compile(backend="vm")
        target = robot.pose(robot.neutral, "tool0")
        target.translation = target.translation + np.array([0.03, 0.0, -0.03])
        controller["hand"].target = target
        for _ in range(200):
            state = connection.drive(controller.step(state.q).v)
        assert np.linalg.norm(robot.pose(state.q, "tool0").translation - target.translation) < 2e-3
    finally:
        other.kill()
        other.communicate()
