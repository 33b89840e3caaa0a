"""Coordinates that other files drive on one arm only, on two arms of seven joints: angle of the plane, rotation about
an axis, points on surfaces and curves, limits; switches on three robots; 100 s of a held pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from tests.published.arm_machine import STATE, Machine
from wbc.coordinates import (
    AxisRows,
    BodyRows,
    CoordinatePair,
    JointRows,
    OnCircle,
    OnPlane,
    PairController,
    PlaneAngleRows,
    PointRows,
    expressions,
    mode_pairs,
    parts,
)
from wbc.tasks import WorkspaceBox

ARMS = ("ssrms", "spdm_arm")
PSI = PlaneAngleRows("F3", "F4", "F5", axis="joint3")
TURN = AxisRows("F4", (1.0, 2.0, 2.0))
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
    pairs = [CoordinatePair(xi, PSI, "psi"), CoordinatePair(xi, TURN, "turn"), CoordinatePair(PSI, xi, "swing")]
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
def test_an_angle_and_a_turn_about_an_axis_are_held_while_the_tip_moves(name: str) -> None:
    control, length = driven(name).control, driven(name).length
    command = SLOW * np.array((-length, -length, 0.5 * length, 1.0, 0.0, -1.0))
    robot = control.robot
    way, rates = go(control, "psi", command, 50)
    assert abs(PSI.task.angle(robot, way[-1]) - PSI.task.angle(robot, STATE)) < 1e-7
    assert np.abs(rates[-1]).max() > 1e-4
    way, _ = go(control, "turn", command, 50)
    row = expressions.rate_function(robot, (TURN,))
    gone = [float((np.asarray(row(0.5 * (a + b)).full()) @ (b - a))[0]) for a, b in pairwise(way)]
    assert abs(sum(gone)) < 1e-7
    moved = Machine(robot).place("tip", way[-1]) - Machine(robot).place("tip", STATE)
    np.testing.assert_allclose(moved, command[:3], atol=2e-3 * SLOW * length)


@pytest.mark.parametrize("name", ARMS)
def test_an_angle_is_commanded_while_the_pose_is_held(name: str) -> None:
    """The swap of the pair with the held angle: self-motion."""
    control = driven(name).control
    robot, machine = control.robot, Machine(control.robot)
    way, _ = go(control, "swing", [0.01], 100)
    turned = PSI.task.angle(robot, way[-1]) - PSI.task.angle(robot, STATE)
    assert turned == pytest.approx(0.02, abs=2e-4)
    assert np.abs(machine.place("tip", way[-1]) - machine.place("tip", STATE)).max() < 1e-6
    assert np.abs(machine.turn("tip", way[-1]) - machine.turn("tip", STATE)).max() < 1e-6


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


@pytest.mark.parametrize(("name", "prefix"), [("ssrms", ""), ("spdm_arm", ""), ("spdm", "arm1_")])
def test_held_rows_are_exact_and_rates_continuous_while_a_pair_becomes_another(name: str, prefix: str) -> None:
    """From the pitch plane's turn to beta's while the tip, of 15 joints all brakes, too, is held."""
    most = 0.05
    robot = parts(name).robot.with_limits(acceleration=most)
    names = [f"{prefix}{one} | {prefix}xi" for one in ("alpha", "beta")]
    pairs = [p for p in mode_pairs(name, "M2") if p.name in names]
    control = PairController(robot, pairs, backend="vm")
    q = STATE if not prefix else np.concatenate(([0.2], STATE, STATE))
    control.reset(q)
    machine, start = Machine(robot), q
    rates = [np.zeros(robot.nv)]

    def ticks(count: int, command: float) -> None:
        nonlocal q
        control.command([command])
        for _ in range(count):
            step = control.step(q)
            assert step.ended == "solved"
            assert step.certificate.violation < 1e-10
            A = control.rates(q)
            for one in control.pair.constraint:
                # Zero but for what takes drift back
                assert np.abs(A[one] @ step.v).max() < 5e-5
            q = q + control.dt * step.v
            rates.append(step.v)

    ticks(60, 0.02)
    assert np.abs(rates[-1]).max() > 5e-3
    seconds = control.switch(names[1], 0.5)
    assert control.blending
    ticks(round(seconds / control.dt) + 2, -0.01)
    assert not control.blending
    # What the acceleration limit left to be done
    ticks(40, -0.01)
    assert np.abs(np.diff(rates, axis=0)).max() / control.dt < most + 1e-9
    beta = control.pair.task[0]
    assert (control.rates(q)[beta] @ rates[-1])[0] == pytest.approx(-0.01, abs=5e-4)
    tip = f"{prefix}tip"
    assert np.abs(machine.place(tip, q) - machine.place(tip, start)).max() < 3e-6
    braked = [k for k, joint in enumerate(robot.dof_names) if not joint.startswith(prefix)]
    assert np.abs((q - start)[braked]).max(initial=0.0) < 1e-9


def test_a_pose_is_held_for_100_s_at_100_hz() -> None:
    """10^4 ticks of self-motion of the dexterous arm with all offsets, forth and back: the pose within 1e-6 m, rad."""
    robot = parts("spdm_arm").robot
    pair = next(p for p in mode_pairs("spdm_arm", "M2") if p.name == "alpha | xi")
    control, machine, q = PairController(robot, pair, dt=0.01), Machine(robot), STATE
    control.reset(q)
    far = 0.0
    for k in range(10_000):
        control.command([0.02 * np.cos(2.0 * np.pi * k / 5000)])
        step = control.step(q)
        assert step.certificate.violation < 1e-10
        q = q + control.dt * step.v
        if k % 50 == 0:
            far = max(far, float(np.linalg.norm(machine.place("tip", q) - machine.place("tip", STATE))))
            far = max(far, float(np.abs(machine.turn("tip", q) - machine.turn("tip", STATE)).max()))
        if k == 1250:
            assert np.abs(q - STATE).max() > 0.1
    assert far < 1e-6
