"""How near a robot stays to its path on servos that lag, are late, sag and rub; what users write by hand beside it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.repeats import repeats
from tests.servo.plants import DT, HOME, Drives
from wbc.api import Controller
from wbc.servo import Following, Response, Servo, identify
from wbc.simulation import Command, CommandKind


def goal(start: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    a, f = np.pi * k * DT, np.pi
    y, z = np.array([0.0, 0.1, 0.0]), np.array([0.0, 0.0, 0.06])
    return start + y * np.sin(a) + z * np.sin(2 * a), f * (y * np.cos(a) + 2 * z * np.cos(2 * a))


def aim(control: Controller, start: np.ndarray, k: int) -> None:
    where, rate = goal(start, k)
    control["tip"].target = pin.SE3(np.eye(3), where)
    control["tip"].feedforward = [*rate, 0.0, 0.0, 0.0]


def follow(servo: Servo, plant: Drives, ticks: int = 750, measured: bool = True) -> tuple[np.ndarray, ...]:
    """Distances from the path [mm], commands, positions, and how it followed."""
    plant.reset(HOME)
    servo.reset(HOME)
    start, model = plant.robot.pose(HOME, "tip").translation, plant.robot
    off, sent, seen, how = [], [], [], []
    for k in range(ticks):
        aim(servo.controller, start, k)
        state = plant.read()
        step = servo.step(state.q, state.v if measured else None)
        sent.append(step.command.values)
        seen.append(state.q if servo.kind is CommandKind.POSITION else state.v)
        how.append(step.following)
        plant.apply(step.command)
        plant.advance(DT)
        off.append(1e3 * np.linalg.norm(model.pose(plant.q, "tip").translation - goal(start, k + 1)[0]))
    return np.array(off), np.array(sent), np.array(seen), np.array(how)


def by_hand(control: Controller, plant: Drives, ticks: int = 750) -> np.ndarray:
    """Distances from the path with ticks at what was commanded, sent as it is [mm]."""
    plant.reset(HOME)
    control.reset(HOME)
    start, q, off = plant.robot.pose(HOME, "tip").translation, HOME, []
    for k in range(ticks):
        aim(control, start, k)
        v = control.step(q).v.copy()
        q = q + DT * v
        plant.apply(Command(plant.kind, q if plant.kind is CommandKind.POSITION else v))
        plant.advance(DT)
        off.append(1e3 * np.linalg.norm(plant.robot.pose(plant.q, "tip").translation - goal(start, k + 1)[0]))
    return np.array(off)


@pytest.mark.parametrize("seed", range(repeats(1)))
@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_random_servos_that_nobody_told_of(control: Controller, kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    lag, sag = ((0.03, 0.15), 2e-3) if kind == "position" else ((0.005, 0.05), 5e-3)
    drives = Drives(
        control.stack.robot, CommandKind(kind), rng.uniform(*lag), int(rng.integers(0, 11)), rng.uniform(0, sag),
        friction=rng.uniform(0, 2e-3), payload=rng.uniform(0, 1),
    )  # fmt: skip
    servo = Servo(control, kind)
    off, _, _, how = follow(servo, drives)
    told = follow(Servo(control, kind, response=servo.response), drives)[0]
    hand = np.median(by_hand(control, drives)[250:])
    assert set(how) == {Following.CLOSE}
    assert np.median(off[250:]) < (3.0 if kind == "position" else 2.0)
    assert np.median(told[250:]) < 2.0
    assert np.median(off[250:]) < 0.5 * hand


@pytest.mark.parametrize("seed", range(repeats(2)))
def test_random_torque_servos(control: Controller, seed: int) -> None:
    rng = np.random.default_rng(seed)
    late, friction, payload = int(rng.integers(0, 8)), *rng.uniform(0, (0.5, 0.3))
    drives = Drives(control.stack.robot, CommandKind.TORQUE, delay=late, friction=friction, payload=payload)
    off, *_ = follow(Servo(control, "torque", response=Response(delay=late * DT)), drives)
    # A torque F that nobody told moves a joint of inertia I by F / (I w^2); the last one's tip is 0.4 m away
    untold, inertia = friction + 9.81 * 0.4 * payload, 0.02 + 0.15**2
    assert np.median(off[250:]) < 0.5 + 1e3 * 0.4 * untold / inertia * max(10 * DT, late * DT) ** 2


def test_velocity_may_be_left_out(control: Controller) -> None:
    drives = Drives(control.stack.robot, CommandKind.VELOCITY, lag=0.02, delay=2)
    servo = Servo(control, "velocity", response=Response(lag=0.02, delay=2 * DT))
    assert np.median(follow(servo, drives, measured=False)[0][250:]) < 1.0


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_a_recording_tells_lag_and_delay(control: Controller, kind: str) -> None:
    lag, late = (0.08, 5) if kind == "position" else (0.03, 4)
    drives = Drives(control.stack.robot, CommandKind(kind), lag, late)
    _, sent, seen, _ = follow(Servo(control, kind), drives)
    found = identify(sent, seen, DT)
    assert found.delay == pytest.approx(late * DT, abs=1.1 * DT)
    assert found.lag == pytest.approx(np.full(3, lag), abs=0.15 * lag + DT)
