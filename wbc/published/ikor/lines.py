"""Trajectories as lines in equal steps, and yaw, pitch and roll of a rotation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.published.ikor.machines import ArmMachine
from wbc.robot.shortest_steps import CLOSED, ShortestSteps
from wbc.validation import Array

#: Of a line that is created: [m], [rad], as the published program shows them
INCREMENTS = 0.01, math.radians(1.0)
#: Configurations that a pose is searched from, beside home
SEARCHES = 40
#: Smallest cosine of the pitch at which yaw and roll are told apart
GIMBAL = 1e-6


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Where the tool goes.

    Attributes:
        start: columns of the machine at the start [M]. points: [n, 3] in m. euler: yaw, pitch, roll [n, 3] in rad.
        dropped: points beyond the most that a file may have.
    """

    start: Array
    points: Array
    euler: Array | None = None
    dropped: int = 0


def straight(machine: ArmMachine, step: Any, count: int, start: Any = None, turn: Any = None) -> Trajectory:
    """A line in equal steps from where the tool is; ``turn``: of yaw, pitch, roll a step [rad].

    Raises:
        ShapeError, NotFiniteError: no step, turn or start.
    """
    q = machine.home if start is None else machine.checked("start", start)
    place, rotation = machine.place(q)
    ways = np.arange(1, count + 1)[:, None]
    turn = validation.ordinary_array("turn", np.zeros(3) if turn is None else turn, (3,))
    return Trajectory(
        q, place + ways * validation.ordinary_array("step", step, (3,)), euler_angles(rotation) + ways * turn
    )


def line_to(machine: ArmMachine, point: Any, euler: Any = None, start: Any = None) -> Trajectory:
    """A line from where the tool is at the start, see :func:`posed`, to a point [m], turning to yaw, pitch, roll [rad]
    on the way, in equal steps of at most :data:`INCREMENTS`.

    Raises:
        ShapeError, NotFiniteError: no point or angles.
    """
    place, rotation = machine.place(machine.home if start is None else machine.checked("start", start))
    way, turn = validation.ordinary_array("point", point, (3,)) - place, np.zeros(3)
    if euler is not None:
        turn = turned(validation.ordinary_array("euler", euler, (3,)) - euler_angles(rotation))
    count = max(1, math.ceil(max(np.linalg.norm(way) / INCREMENTS[0], np.abs(turn).max() / INCREMENTS[1]) - 1e-9))
    return straight(machine, way / count, count, start, turn / count)


def arc_from(machine: ArmMachine, centre: Any, angle: float, turn: float = 0.0, start: Any = None) -> Trajectory:
    """A circle's arc from where the tool is, round a centre [m] in the plane of x and y, to the left by an angle [rad];
    the yaw turns by ``turn`` [rad] on the way. Equal steps of at most :data:`INCREMENTS`.

    Raises:
        ShapeError, NotFiniteError: no centre or angle. RangeError: the tool is at the centre.
    """
    q = machine.home if start is None else machine.checked("start", start)
    place, rotation = machine.place(q)
    off = place[:2] - validation.ordinary_array("centre", centre, (2,))
    radius, angle, turn = float(np.hypot(*off)), validation.scalar("angle", angle), validation.scalar("turn", turn)
    if radius == 0.0:
        raise RangeError("centre", centre, "the tool is there: expected a centre away from it")
    count = max(1, math.ceil(max(radius * abs(angle) / INCREMENTS[0], abs(turn) / INCREMENTS[1]) - 1e-9))
    shares = np.arange(1, count + 1) / count
    c, s = np.cos(angle * shares), np.sin(angle * shares)
    points = np.tile(place, (count, 1))
    points[:, 0] += c * off[0] - s * off[1] - off[0]
    points[:, 1] += s * off[0] + c * off[1] - off[1]
    return Trajectory(q, points, euler_angles(rotation) + shares[:, None] * [turn, 0.0, 0.0])


def posed(machine: ArmMachine, point: Any, euler: Any = None) -> Array:
    """Columns within their limits with the tool at a point [m] and, if they are given, at yaw, pitch, roll [rad]: by
    shortest steps from home, else from random configurations of a fixed seed.

    Raises:
        ShapeError, NotFiniteError: no point or angles. RangeError: none is found.
    """
    goal, rows = validation.ordinary_array("from", point, (3,)), slice(3 if euler is None else 6)
    turned_to = np.eye(3) if euler is None else rotation_of(validation.ordinary_array("from", euler, (3,)))

    def look(q: Array) -> tuple[Array, Array]:
        place, rotation = machine.place(q)
        return np.concatenate((place - goal, pin.log3(rotation @ turned_to.T)))[rows], machine.jacobian(q)[rows]

    rng, columns = np.random.default_rng(0), np.arange(len(machine.home))
    search = ShortestSteps(look, np.add, columns, machine.lower, machine.upper)
    reach = np.clip(machine.lower, -math.pi, None), np.clip(machine.upper, None, math.pi)
    for start in [machine.home, *(rng.uniform(*reach) for _ in range(SEARCHES))]:
        q, missed = search.root(np.clip(start, machine.lower, machine.upper))
        if missed <= CLOSED:
            return q
    raise RangeError("from", goal.tolist(), "no configuration within the limits is found with the tool there")


def euler_angles(rotation: Array) -> Array:
    """Yaw, pitch, roll of Rz Ry Rx; yaw 0 where the pitch is a right angle, as published."""
    roll, pitch, yaw = pin.rpy.matrixToRpy(rotation)
    if math.cos(pitch) < GIMBAL:
        yaw, roll = 0.0, math.copysign(1.0, pitch) * math.atan2(rotation[0, 1], rotation[1, 1])
    return np.array([yaw, pitch, roll])


def rotation_of(euler: Array) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    return np.asarray(pin.rpy.rpyToMatrix(euler[::-1]))


def turned(angles: Array) -> Array:
    """The same angles within half a turn of zero."""
    return np.asarray((angles + math.pi) % (2.0 * math.pi) - math.pi)
