"""Each constraint in a loop on three robots from random starts, judged by Pinocchio and Coal.

A loop of 30 ticks follows a wish that the constraint must oppose: min |v - wish|^2 under the constraint's rows.
Every check is run once more with a mutated formula, which it must notice.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import casadi as ca
import daqp
import numpy as np
import pinocchio as pin
import pytest

from tests.constraints.items import tip
from tests.constraints.robots import robot
from tests.constraints.test_obstacle import coal_distance, random_pose
from tests.evaluation import Probe, probe, random_configuration
from tests.repeats import repeats
from wbc.robot import Robot
from wbc.shapes import HalfSpace, Sphere
from wbc.symbolic import rotations as rot
from wbc.symbolic.tracer import Tracer
from wbc.tasks import _gap, fixed, hold, joint_limits
from wbc.tasks.fixed import Fixed
from wbc.tasks.frame_velocity_limit import FrameVelocityLimit
from wbc.tasks.hold import Hold
from wbc.tasks.joint_limits import JointLimits
from wbc.tasks.obstacle import Obstacle

ROBOTS = ("panda", "ur5", "talos")
STARTS, TICKS, DT, RATE = repeats(8), 30, 0.005, 20.0


def nearest_allowed(wish: np.ndarray, matrix: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """argmin |v - wish|^2 under lower <= A v <= upper, |v| <= 3."""
    n = len(wish)
    low, high = np.concatenate([np.full(n, -3.0), lower]), np.concatenate([np.full(n, 3.0), upper])
    v, _, flag, _ = daqp.solve(
        np.eye(n), -wish, np.ascontiguousarray(matrix), np.minimum(high, 1e30), np.maximum(low, -1e30),
        np.zeros(len(low), dtype=np.int32), primal_tol=1e-10,
    )  # fmt: skip
    assert flag > 0, f"daqp flag {flag}"
    return v


def reading(bot: Robot) -> tuple[pin.Data, Callable[[np.ndarray, str], pin.SE3]]:
    data = bot.model.createData()

    def pose(q: np.ndarray, frame: str) -> pin.SE3:
        pin.framesForwardKinematics(bot.model, data, q)
        return data.oMf[bot.model.getFrameId(frame)].copy()

    return data, pose


def obstacle_clearance(name: str, shape: Any, seed: int = 1) -> float:
    """Smallest distance to the obstacle that Coal sees while every shape is driven into it [m]."""
    bot, rng = robot(name), np.random.default_rng(seed)
    item = Obstacle(shape)
    clear = probe(item, bot)
    worst = np.inf
    for _ in range(STARTS):
        pairs, q = item.pairs(bot), random_configuration(bot, rng)
        pose = random_pose(rng)
        while (gap := min(coal_distance(bot, q, *p[::2], shape, pose) for p in pairs)) < 0.02:
            pose = pin.SE3(pose.rotation, pose.translation + (gap - 0.03) * pose.rotation[:, 2])
        # A whole plane that moves may leave no way out for the first links of an arm; a ball does here
        twist = rng.uniform(-0.1, 0.1, 6) * isinstance(shape, Sphere)
        for _ in range(TICKS):
            h, jacobian, drift = clear(q, pose=pose, velocity=twist)
            closest = int(np.argmin(h))
            wish = -2.0 * jacobian[closest] / (np.linalg.norm(jacobian[closest]) + 1e-3)
            v = nearest_allowed(wish, jacobian, -RATE * h - drift, np.full(len(h), 1e30))
            q = pin.integrate(bot.model, q, v * DT)
            pose = pin.SE3(pin.exp3(twist[3:] * DT) @ pose.rotation, pose.translation + twist[:3] * DT)
        worst = min(worst, *(coal_distance(bot, q, *p[::2], shape, pose) for p in pairs))
    return float(worst)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("shape", [Sphere(0.1), HalfSpace()], ids=["sphere", "half-space"])
def test_obstacle_is_never_entered(name: str, shape: Any) -> None:
    assert obstacle_clearance(name, shape) > -1e-4


def test_a_wrong_obstacle_formula_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = _gap.between

    def wrong(start: ca.SX, end: ca.SX) -> tuple[ca.SX, ca.SX]:
        length, direction = right(start, end)
        return length + 0.05, direction

    monkeypatch.setattr(_gap, "between", wrong)
    assert obstacle_clearance("ur5", Sphere(0.1)) < -0.01


def hold_drift(name: str, seed: int = 2) -> float:
    """Largest drift at the end, over the drift at the start, while the robot is asked to move."""
    bot, rng = robot(name), np.random.default_rng(seed)
    frame = tip(bot)
    holding = probe(Hold(frame, gain=30.0), bot)
    _, pose = reading(bot)
    worst, count = 0.0, 0
    while count < STARTS:
        q = random_configuration(bot, rng)
        target = pose(q, frame) * pin.SE3(pin.exp3(rng.normal(0.0, 0.03, 3)), rng.normal(0.0, 0.01, 3))
        if np.linalg.svd(holding(q, target=target)[0], compute_uv=False)[-1] < 0.15:
            continue
        count += 1

        def drift(at: np.ndarray, goal: pin.SE3 = target) -> float:
            here = pose(at, frame)
            turn = np.linalg.norm(pin.log3(here.rotation.T @ goal.rotation))
            return float(turn + np.linalg.norm(here.translation - goal.translation))

        start, wish = drift(q), rng.normal(0.0, 0.3, bot.nv)
        for _ in range(TICKS):
            matrix, lower, _ = holding(q, target=target)
            v = wish + np.linalg.lstsq(matrix, lower - matrix @ wish, rcond=None)[0]
            q = pin.integrate(bot.model, q, v * DT)
        worst = max(worst, drift(q) / start)
    return worst


@pytest.mark.parametrize("name", ROBOTS)
def test_hold_brings_the_frame_back_and_keeps_it(name: str) -> None:
    assert hold_drift(name) < 0.05


def test_a_wrong_hold_formula_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hold, "rot", SimpleNamespace(log3=lambda r: rot.log3(r.T)))
    assert hold_drift("ur5") > 1.0


def frame_speed(name: str, seed: int = 3) -> float:
    """Largest speed of the tip along its own axes over the limit, as Pinocchio measures it."""
    bot, rng = robot(name), np.random.default_rng(seed)
    frame, limit = tip(bot), np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    limiting = probe(FrameVelocityLimit(frame, linear=tuple(limit[:3]), angular=tuple(limit[3:]), axes=frame), bot)
    data, worst = bot.model.createData(), 0.0
    for _ in range(STARTS):
        q, wish = random_configuration(bot, rng), rng.normal(0.0, 2.0, bot.nv)
        for _ in range(TICKS // 4):
            v = nearest_allowed(wish, *limiting(q))
            pin.forwardKinematics(bot.model, data, q, v)
            speed = pin.getFrameVelocity(bot.model, data, bot.model.getFrameId(frame), pin.LOCAL).vector
            worst = max(worst, float(np.max(np.abs(speed) / limit)))
            q = pin.integrate(bot.model, q, v * DT)
    return worst


@pytest.mark.parametrize("name", ROBOTS)
def test_frame_velocity_stays_in_its_box(name: str) -> None:
    assert 0.99 < frame_speed(name) < 1 + 1e-6


def test_wrong_axes_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = Tracer.rotation
    monkeypatch.setattr(Tracer, "rotation", lambda kin, frame: right(kin, frame).T)
    assert frame_speed("ur5") > 1.1


def joint_excess(bounds: Probe, bot: Robot, seed: int) -> tuple[float, float]:
    """Largest excess over the model's position limits, and over the acceleration limits, pushed at random."""
    rng, passed, harder = np.random.default_rng(seed), 0.0, 0.0
    limited = [int(k) for k in bot.position_index if k >= 0]
    low, high = (np.array(a)[limited] for a in (bot.model.lowerPositionLimit, bot.model.upperPositionLimit))
    for _ in range(STARTS):
        q, v, wish = random_configuration(bot, rng), np.zeros(bot.nv), rng.choice([-10.0, 10.0], bot.nv)
        for _ in range(TICKS):
            dt = rng.uniform(2.0, 10.0) * DT
            lower, upper = bounds(q, v, dt)
            command = np.clip(wish, lower, upper)
            harder = max(harder, float(np.max(np.abs(command - v) / (bot.limits.acceleration * dt))))
            v = command
            q = pin.integrate(bot.model, q, v * dt)
            passed = max(passed, float(np.max(np.maximum(q[limited] - high, low - q[limited]))))
    return passed, harder


@pytest.mark.parametrize("name", ROBOTS)
def test_joint_limits_are_never_passed(name: str) -> None:
    bot = robot(name)
    passed, harder = joint_excess(probe(JointLimits(), bot), bot, seed=4)
    assert passed <= 1e-12
    assert harder <= 1 + 1e-9


def test_wrong_joint_limits_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joint_limits, "braking_bound", lambda d, a, dt, s: d / dt)
    bot = robot("ur5")
    assert joint_excess(probe(JointLimits(), bot), bot, seed=4)[0] > 1e-3


def fixed_joints(name: str, seed: int = 5) -> tuple[float, float]:
    """Speed left after the time that braking takes, and the hardest braking over the limit."""
    bot, rng = robot(name), np.random.default_rng(seed)
    standing, left, harder = probe(Fixed(bot.joint_names), bot), 0.0, 0.0
    finite = np.isfinite(bot.limits.acceleration)
    for _ in range(STARTS):
        q, v = random_configuration(bot, rng), rng.uniform(-1.0, 1.0, bot.nv)
        for _ in range(TICKS):
            lower, upper = standing(q, v, DT)
            command = np.clip(rng.normal(size=bot.nv), lower, upper)
            change = np.abs(command - v)[finite] / (bot.limits.acceleration[finite] * DT)
            harder, v = max(harder, float(change.max())), command
            q = pin.integrate(bot.model, q, v * DT)
        data = bot.model.createData()
        pin.forwardKinematics(bot.model, data, q, v)
        left = max(left, *(float(np.linalg.norm(m.vector)) for m in data.v))
    return left, harder


@pytest.mark.parametrize("name", ROBOTS)
def test_fixed_joints_come_to_rest(name: str) -> None:
    left, harder = fixed_joints(name)
    assert left == 0.0
    assert harder <= 1 + 1e-9


def test_a_wrong_fixed_formula_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fixed, "clip", lambda value, lower, upper: value)
    assert fixed_joints("ur5")[1] > 2.0
    monkeypatch.setattr(fixed, "clip", lambda value, lower, upper: ca.fmin(value, upper))
    assert fixed_joints("ur5")[1] > 2.0
