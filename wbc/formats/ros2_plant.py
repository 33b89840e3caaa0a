"""A robot of ROS 2 as a plant, over DDS or Zenoh and without ROS."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.formats.ros2_links import DdsLink, Ros2Link, ZenohLink
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
        number = int(validation.scalar("domain", domain, low=0, high=DOMAINS))
        topics = states.strip("/"), commands.strip("/")
        self._link: Ros2Link = DdsLink(*topics, number) if zenoh is None else ZenohLink(*topics, number, zenoh)
        self._q, self._v = np.full(self.nq, math.nan), np.zeros(self.nv)
        self._heard = -math.inf
        self._now = self._due = 0.0
        self._command = Command(CommandKind.VELOCITY, np.zeros(self.nv))

    def _hear(self) -> None:
        """Take in what has come."""
        for message in self._link.take():
            places = {name: k for k, name in enumerate(message.name)}
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
        self._now, self._due = time, clock.monotonic()

    def _send(self, q: Array, v: Array, seconds: float) -> None:
        self._link.send(self._robot.joint_names, q, v, seconds)

    def _wait(self, done: Callable[[], bool], reason: str) -> None:
        until = clock.monotonic() + PATIENCE
        while True:
            self._hear()
            if done():
                return
            if clock.monotonic() > until:
                raise PlantError("plant", self._robot.name, reason)
            clock.sleep(1e-3)

    def read(self) -> PlantState:
        """The last message, invalid where it is older than half a second."""
        self._hear()
        valid = clock.monotonic() - self._heard < SILENT and bool(
            np.isfinite(self._q).all() and np.isfinite(self._v).all()
        )
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
        clock.sleep(max(0.0, self._due - clock.monotonic()))
