"""Points that stay on surfaces and curves, and limits beside pairs, on two arms of seven joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from tests.published.arm_machine import STATE, Machine
from wbc.coordinates import (
    BodyRows,
    CoordinatePair,
    JointRows,
    OnCircle,
    OnPlane,
    PairController,
    PlaneAngleRows,
    PointRows,
    parts,
)
from wbc.tasks import WorkspaceBox

ARMS = ("ssrms", "spdm_arm")
PSI = PlaneAngleRows("F3", "F4", "F5", axis="joint3")
#: How fast hands go, as a part of the arm's length in a second
SLOW = 1e-3
#: Normal of the plane; the circle's is y
SLOPE = np.array((0.6, 0.0, 0.8))


@dataclass(frozen=True)
class Driven:
    control: PairController
    centre: np.ndarray
    length: float


@cache
def driven(name: str) -> Driven:
    robot, xi = parts(name).robot, parts(name).arms[0].tip
    length, tip = robot.characteristic_length, Machine(robot).place("tip", STATE)
    table = PointRows("tip", OnPlane(tuple(tip), tuple(SLOPE)), name="table")
    centre = tip + 0.2 * length * np.array((0.8, 0.0, -0.6))
    ring = PointRows("tip", OnCircle(tuple(centre), (0.0, 1.0, 0.0), 0.2 * length), name="ring")
    across = BodyRows("tip", expressed="world", translation=(0, 1), name="across")
    along = BodyRows("tip", expressed="world", translation=(0,), name="along")
    pairs = [CoordinatePair(xi, PSI, "psi")]
    pairs.append(CoordinatePair(across, (table, JointRows("joint2")), "wipe"))
    pairs.append(CoordinatePair(along, (ring, JointRows("joint2")), "follow"))
    limits = WorkspaceBox("tip", upper=tuple(tip + 0.004 * length))
    return Driven(PairController(robot, pairs, items=[limits], backend="vm"), centre, length)


def go(control: PairController, pair: str, command: object, ticks: int) -> tuple[list[np.ndarray], np.ndarray]:
    """(configurations, rates) of a drive from STATE."""
    control.switch(pair, 0.0)
    control.reset(STATE)
    control.command(command)
    way, rates = [STATE], []
    for _ in range(ticks):
        step = control.step(way[-1])
        assert step.ended == "solved"
        assert step.certificate.violation < 1e-10
        rates.append(step.v)
        way.append(way[-1] + control.dt * step.v)
    return way, np.array(rates)


@pytest.mark.parametrize("name", ARMS)
def test_a_point_stays_on_a_plane_and_on_a_circle(name: str) -> None:
    case = driven(name)
    machine, still = Machine(case.control.robot), (0.0, 0.0, 0.0)
    for pair, speeds in (("wipe", (-1.0, 0.5)), ("follow", (-1.0,))):
        way, _ = go(case.control, pair, (*(20.0 * SLOW * case.length * np.array(speeds)), *still), 60)
        where = [machine.place("tip", q) for q in way]
        if pair == "wipe":
            off = [abs(float(SLOPE @ (place - where[0]))) for place in where]
        else:
            off = [abs(place[1] - where[0][1]) for place in where]
            off += [abs(float(np.linalg.norm(place - case.centre)) - 0.2 * case.length) for place in where]
        assert max(off) < 2e-5 * case.length
        assert np.linalg.norm(where[-1] - where[0]) > 5e-3 * case.length


@pytest.mark.parametrize("name", ARMS)
def test_a_wall_binds_without_chatter(name: str) -> None:
    """The tip is driven into a wall and along it: no rate goes back and forth, what is held stays exact."""
    case = driven(name)
    command = 10.0 * SLOW * case.length * np.array((0.5, -0.5, 0.0, 0.0, 0.0, 0.0))
    way, rates = go(case.control, "psi", command, 150)
    machine = Machine(case.control.robot)
    start, end = (machine.place("tip", way[k]) for k in (0, -1))
    assert end[0] - start[0] < 0.004 * case.length + 1e-6
    assert end[0] - start[0] > 0.0038 * case.length
    late = rates[60:]
    turns = (np.diff(np.sign(np.where(np.abs(late) > 1e-7, late, 0.0)), axis=0) != 0).sum(axis=0)
    assert turns.max() <= 3
    assert abs(PSI.task.angle(case.control.robot, way[-1]) - PSI.task.angle(case.control.robot, STATE)) < 1e-7
