"""Position, velocity and acceleration limits together, under adversaries, in discrete time with varying dt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.repeats import repeats
from tests.torque.problems import controller, robot
from tests.torque.referee import acceleration_interval
from wbc.api import Stack
from wbc.controller import core_of
from wbc.robot import Coupling, Robot
from wbc.tasks import JointLimits, Posture
from wbc.tasks.stopping import allowed_accelerations, stopping_deceleration

#: Ticks of an adversary
TICKS = 10_000
#: Joints at once; each has limits of its own
JOINTS = 64
LONGEST = 0.01

Interval = Callable[..., tuple[np.ndarray, np.ndarray]]


def ours(limits: dict[str, np.ndarray]) -> Interval:
    """The interval of the package for all joints, as one function."""
    q, v, dt = ca.SX.sym("q"), ca.SX.sym("v"), ca.SX.sym("dt")
    functions = []
    for k in range(JOINTS):
        ends = allowed_accelerations(
            q,
            v,
            dt,
            position=(float(limits["lower"][k]), float(limits["upper"][k])),
            velocity=float(limits["velocity"][k]),
            acceleration=float(limits["acceleration"][k]),
            velocity_scale=ca.SX(1.0),
            return_rate=ca.SX(5.0),
            longest=LONGEST,
        )
        functions.append(ca.Function("f", [q, v, dt], list(ends)))
    many_q, many_v = ca.SX.sym("q", JOINTS), ca.SX.sym("v", JOINTS)
    pairs = [f(many_q[k], many_v[k], dt) for k, f in enumerate(functions)]
    whole = ca.Function("all", [many_q, many_v, dt], [ca.vertcat(*p) for p in zip(*pairs, strict=True)])
    given = np.zeros(JOINTS), np.zeros(JOINTS), np.zeros(1)
    found = np.zeros(JOINTS), np.zeros(JOINTS)
    buffer, run = whole.buffer()
    for k in range(3):
        buffer.set_arg(k, memoryview(given[k]))
    for k in range(2):
        buffer.set_res(k, memoryview(found[k]))
    keep = buffer

    def interval(position: np.ndarray, speed: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
        assert keep is not None
        given[0][:], given[1][:], given[2][:] = position, speed, length
        run()
        return found[0].copy(), found[1].copy()

    return interval


def textbook(limits: dict[str, np.ndarray]) -> Interval:
    """Each limit for the next tick alone."""

    def interval(q: np.ndarray, v: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        high = np.minimum.reduce(
            [limits["acceleration"], (limits["velocity"] - v) / dt, 2 * (limits["upper"] - q - v * dt) / dt**2]
        )
        low = np.maximum.reduce(
            [-limits["acceleration"], (-limits["velocity"] - v) / dt, 2 * (limits["lower"] - q - v * dt) / dt**2]
        )
        return low, high

    return interval


def drawn(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Ranges from a fraction of what one tick may cross to full turns; slow and fast motors."""
    width = 10.0 ** rng.uniform(-4.0, 0.8, JOINTS)
    middle = rng.uniform(-1.0, 1.0, JOINTS)
    return {
        "lower": middle - width / 2,
        "upper": middle + width / 2,
        "velocity": 10.0 ** rng.uniform(-1.5, 1.0, JOINTS),
        "acceleration": 10.0 ** rng.uniform(-0.5, 3.0, JOINTS),
    }


def adversary(interval: Interval, limits: dict[str, np.ndarray], ticks: int, seed: int) -> dict[str, float]:
    """Worst breaches by whoever always asks for the ends, changes sides, or for anything between; dt changes."""
    rng = np.random.default_rng(seed)
    q, v = 0.5 * (limits["lower"] + limits["upper"]), np.zeros(JOINTS)
    worst = {"empty": 0.0, "acceleration": 0.0, "velocity": 0.0, "position": 0.0}
    side = rng.integers(0, 2, JOINTS)
    for k in range(ticks):
        dt = LONGEST * (rng.uniform(0.05, 1.0) if k % 3 else rng.choice([0.05, 1.0]))
        low, high = interval(q, v, dt)
        worst["empty"] = max(worst["empty"], float(((low - high) / limits["acceleration"]).max()))
        if rng.random() < 0.02:
            side = rng.integers(0, 2, JOINTS)
        share = np.where(rng.random(JOINTS) < 0.9, side, rng.random(JOINTS))
        a = low + share * (high - low)
        worst["acceleration"] = max(worst["acceleration"], float((np.abs(a) / limits["acceleration"]).max()) - 1.0)
        # where the joint turns round within the tick it is farther than at its end
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.where((v * (v + a * dt) < 0.0), q - 0.5 * v * v / a, q)
        q, v = q + v * dt + 0.5 * a * dt * dt, v + a * dt
        for there in (q, turn):
            beyond = np.maximum(there - limits["upper"], limits["lower"] - there)
            worst["position"] = max(worst["position"], float(beyond.max()))
        worst["velocity"] = max(worst["velocity"], float((np.abs(v) / limits["velocity"]).max()) - 1.0)
    return worst


def test_no_adversary_breaks_a_limit_and_the_textbook_version_fails_beside_it() -> None:
    limits = drawn(np.random.default_rng(0))
    worst = adversary(ours(limits), limits, repeats(TICKS), 1)
    # shares of the limits, and of the position radians
    assert max(worst.values()) < 1e-11, worst
    naive = adversary(textbook(limits), limits, 300, 1)
    assert naive["empty"] > 0.1, "limits for the next tick alone contradict each other"


def test_bounds_of_a_tick_are_those_of_a_search() -> None:
    """Against bisection of what an acceleration leads to, near limits."""
    tick, rng = controller("panda").clone(), np.random.default_rng(3)
    bot = tick.stack.robot
    lower, upper = bot.limits.position_lower, bot.limits.position_upper
    for _ in range(20):
        v = rng.uniform(-1.0, 1.0, bot.nv) * bot.limits.velocity
        stop = v * v / (2 * bot.limits.acceleration) + rng.exponential(1e-3, bot.nv)
        q = np.clip(np.where(v > 0, upper - stop, lower + stop), lower, upper)
        dt = 0.002 * rng.uniform(0.25, 2.0)
        tick.reset(q, v)
        tick.step(q, v, dt)
        # the step has moved the velocity on: the QP of the step is the one about v
        core_of(tick).tick.v_last[:] = v
        qp = tick.qp()
        wanted = np.array([acceleration_interval(bot, i, q, v, dt, tick.stack.dt_range[1]) for i in range(bot.nv)])
        assert np.abs(qp.lower[: bot.nv] - wanted[:, 0]).max() < 1e-6
        assert np.abs(qp.upper[: bot.nv] - wanted[:, 1]).max() < 1e-6


def test_a_joint_whose_limit_of_velocity_is_zero_comes_to_rest() -> None:
    bot = robot("panda").with_limits(velocity=[0.0, *[2.0] * 6, *[0.2] * (robot("panda").nv - 7)])
    tick = Stack(bot, dt=0.002).add(Posture()).add(JointLimits()).compile(command="acceleration", backend="vm")
    v = np.zeros(bot.nv)
    v[0] = 0.01
    tick.reset(bot.neutral)
    step = tick.step(bot.neutral, v)
    assert step.status == "solved"
    assert abs(v[0] + 0.002 * step.a[0]) < 1e-12


def geared() -> Robot:
    """Three hinges of which the last follows the second, runs further and brakes five times slower."""
    model, parent = pin.Model(), 0
    for k, kind in enumerate((pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelRY())):
        parent = model.addJoint(parent, kind, pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0])), f"j{k}")
        inertia = pin.Inertia(1.0, np.array([0.1, 0.0, 0.0]), 0.01 * np.eye(3))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    most = np.array([1.0, 1.0, 10.0])
    bot = wbc.robots.load(model).with_limits(position_lower=-most, position_upper=most, velocity=(2.0, 3.0, 3.0))
    bot = bot.with_limits(acceleration=(30.0, 30.0, 6.0), effort=200.0)
    return replace(bot, couplings=(Coupling(follower=2, leader=1, ratio=-1.7, offset=0.1),))


@pytest.mark.parametrize("command", ["velocity", "acceleration", "torque"])
def test_a_joint_that_follows_slower_than_its_leader_brakes_with_it(command: str) -> None:
    """With intervals of their own the two contradicted each other, and the coupling gave way in every fourth tick."""
    bot, rng = geared(), np.random.default_rng(0)
    made = Stack(bot, dt=LONGEST).add(Posture(gain=30.0), name="posture").add(JointLimits())
    tick = made.compile(command=command, backend="vm")
    q, v, reached = np.array([0.0, 0.0, 0.1]), np.zeros(3), 0.0
    tick.reset(q)
    for k in range(240):
        if k % 80 == 0:
            tick["posture"].target = np.array([0.0, 3.0, -5.1]) * (-1.0) ** (k // 80)
        dt = LONGEST * rng.uniform(0.25, 2.0)
        step = tick.step(q, dt=dt) if command == "velocity" else tick.step(q, v, dt)
        assert step.status == "solved"
        mean = step.v if command == "velocity" else v + 0.5 * dt * step.a
        q, v = q + mean * dt, step.v
        assert abs(q[1]) <= 1.0 + 1e-12
        assert q[2] == pytest.approx(0.1 - 1.7 * q[1], abs=1e-9)
        reached = max(reached, abs(q[1]))
    assert reached > 0.99


@pytest.mark.parametrize(
    ("limits", "wanted"), [((7.0, 1e9, 1e9), 7.0), ((1e9, 0.3, 1e9), 30.0), ((1e9, 1e9, 0.06), 2 * 0.06 / (3 * 1e-4))]
)
def test_braking_counts_on_all_that_the_limits_leave(limits: tuple[float, float, float], wanted: float) -> None:
    """The least of A, V / T and 2 (u - l) / (3 T^2): with less a joint would be slower than it has to be."""
    assert stopping_deceleration(*limits, longest=0.01) == pytest.approx(wanted, rel=1e-12)
