"""Ten thousands of adversarial ticks: bounds never cross, limits are never passed, outside means coming back."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.repeats import repeats
from wbc.tasks.joint_limits import allowed_interval


@dataclass(frozen=True, eq=False)
class Joints:
    """Many unrelated one-dof joints with their limits."""

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    @property
    def n(self) -> int:
        return len(self.lower)

    def interval(self, shortest_dt: float | None, return_rate: float = 5.0) -> ca.Function:
        """(q, v, dt, velocity_scale) -> (lower, upper) for all joints."""
        q, v, dt, scale = ca.SX.sym("q", self.n), ca.SX.sym("v", self.n), ca.SX.sym("dt"), ca.SX.sym("s")
        ends = [
            allowed_interval(
                q[i], v[i], dt,
                position=(float(self.lower[i]), float(self.upper[i])),
                velocity=float(self.velocity[i]),
                acceleration=float(self.acceleration[i]),
                velocity_scale=scale,
                return_rate=ca.SX(return_rate),
                shortest_dt=shortest_dt,
            )
            for i in range(self.n)
        ]  # fmt: skip
        return ca.Function("interval", [q, v, dt, scale], [ca.vertcat(*[e[k] for e in ends]) for k in (0, 1)])


def draw(rng: np.random.Generator, n: int) -> Joints:
    """Accelerations from 0.1 to 1e4 (some unlimited), ranges from 1e-6 to 1e3, limits far from and across zero."""
    width = 10.0 ** rng.uniform(-6, 3, n)
    center = rng.choice([0.0, 1.0, -3.0, 100.0], n)
    acceleration = 10.0 ** rng.uniform(-1, 4, n)
    acceleration[::11] = np.inf
    velocity = 10.0 ** rng.uniform(-1, 2, n)
    velocity[::7] = np.inf
    velocity[np.isinf(acceleration) & np.isinf(velocity)] = 3.0
    return Joints(center - width / 2, center + width / 2, velocity, acceleration)


#: Ticks, and how many of them the adversary plans, and are judged, at once
TICKS, CHUNK = repeats(12_000), 1000


class Adversary:
    """Wishes a * lower + b * upper + c: outwards, to and fro, noise, creeping along a limit, any speed."""

    def __init__(self, rng: np.random.Generator, n: int) -> None:
        self.rng, self.n = rng, n
        self.kind = np.arange(n) % 5
        self.sign = rng.choice([-1.0, 1.0], n)

    def plan(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        shape = (CHUNK, self.n)
        turns = np.where(self.rng.random(shape) < 0.01, -1.0, 1.0)
        sign = self.sign * np.cumprod(turns, axis=0)
        self.sign = sign[-1]
        part, coin = self.rng.random(shape), self.rng.random(shape) < 0.5
        up = np.select([self.kind == 1, self.kind == 2, self.kind == 4], [coin, part, 0.0], sign > 0)
        low = np.where(self.kind == 4, 0.0, 1.0 - up)
        shift = np.select([self.kind == 3, self.kind == 4], [-1e-9 * sign * part, sign * 10.0 ** (12 * part - 9)], 0.0)
        return low, up, shift


class Buffered:
    """A CasADi function on kept arrays."""

    def __init__(self, function: ca.Function) -> None:
        self.buffer, self.run = function.buffer()
        self.inputs = [np.zeros(function.nnz_in(i)) for i in range(function.n_in())]
        self.outputs = [np.zeros(function.nnz_out(i)) for i in range(function.n_out())]
        for i, array in enumerate(self.inputs):
            self.buffer.set_arg(i, memoryview(array))
        for i, array in enumerate(self.outputs):
            self.buffer.set_res(i, memoryview(array))

    def __call__(self, *values: np.ndarray | float) -> list[np.ndarray]:
        for array, value in zip(self.inputs, values, strict=True):
            array[:] = value
        self.run()
        return self.outputs


def attack(joints: Joints, lengths: np.ndarray, shortest: float | None, seed: int) -> dict[str, float]:
    """Run the adversary from rest inside the limits; returns the worst of everything."""
    rng = np.random.default_rng(seed)
    interval, adversary = Buffered(joints.interval(shortest)), Adversary(rng, joints.n)
    q, v = joints.lower + rng.random(joints.n) * (joints.upper - joints.lower), np.zeros(joints.n)
    worst = {"crossed": -np.inf, "passed": 0.0, "faster": 0.0, "harder": 0.0}
    reached = np.full(joints.n, np.inf)
    for part in np.split(lengths, range(CHUNK, len(lengths), CHUNK)):
        low, up, shift = adversary.plan()
        log = np.zeros((4, len(part) + 1, joints.n))
        log[2, 0], log[3, 0] = q, v
        for k, dt in enumerate(part):
            lower, upper = interval(q, v, dt, 1.0)
            v = np.minimum(np.maximum(low[k] * lower + up[k] * upper + shift[k], lower), upper)
            q = q + v * dt
            log[0, k + 1], log[1, k + 1], log[2, k + 1], log[3, k + 1] = lower, upper, q, v
        outside = judge(joints, log, part, worst)
        reached = np.minimum(reached, np.abs(outside).min(axis=0))
    # The outward pushers turn round every hundred ticks, so only short ranges are crossed in time
    pushed = (adversary.kind == 0) & (joints.upper - joints.lower < 0.1)
    return worst | {"near": float(np.max(reached[pushed] / (joints.upper - joints.lower)[pushed], initial=0.0))}


def judge(joints: Joints, log: np.ndarray, lengths: np.ndarray, worst: dict[str, float]) -> np.ndarray:
    """Take the worst of a logged chunk into account; returns how far each joint is outside, negative inside."""
    lower, upper, q, v = log
    size = np.maximum(1.0, np.maximum(np.abs(joints.lower), np.abs(joints.upper)))
    outside = np.maximum(q - joints.upper, joints.lower - q)
    change = np.abs(np.diff(v, axis=0)) - 1e-13 * np.abs(v[1:])
    seen = {
        "crossed": (lower - upper)[1:],
        "passed": outside / size,
        "faster": np.abs(v) / joints.velocity,
        "harder": change / (joints.acceleration * lengths[:, None]),
    }
    for name, values in seen.items():
        assert not np.isnan(values).any()
        worst[name] = max(worst[name], float(values.max()))
    return outside


def check(worst: dict[str, float]) -> None:
    assert worst["crossed"] <= 0.0
    assert worst["passed"] <= 1e-12
    assert worst["faster"] <= 1 + 1e-12
    assert worst["harder"] <= 1 + 1e-9


@pytest.mark.parametrize("shortest", [None, 0.005])
def test_many_equal_ticks(shortest: float | None) -> None:
    worst = attack(draw(np.random.default_rng(1), 35), np.full(TICKS, 0.005), shortest, seed=2)
    check(worst)
    assert worst["near"] < 1e-6, "joints that are pushed outwards do come to their limits"


@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1), dt=st.floats(1e-4, 0.1), promise=st.booleans(), spread=st.floats(1.0, 8.0))
def test_any_limits_and_tick_lengths(seed: int, dt: float, promise: bool, spread: float) -> None:
    rng = np.random.default_rng(seed)
    lengths = dt * rng.uniform(1.0, spread, 400)
    check(attack(draw(rng, 24), lengths, dt if promise else None, seed))


def returning(joints: Joints, start: np.ndarray, speed: np.ndarray, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Violation over time, ticks x joints, under an adversary that pushes outwards half of the time."""
    interval = Buffered(joints.interval(None))
    q, v, out = start.copy(), speed.copy(), []
    for _ in range(1500):
        lower, upper = interval(q, v, dt, 1.0)
        assert (lower <= upper).all()
        outward = np.where(q > joints.upper, upper, np.where(q < joints.lower, lower, upper))
        command = np.where(rng.random(joints.n) < 0.5, outward, lower + rng.random(joints.n) * (upper - lower))
        assert (np.abs(command - v) <= joints.acceleration * dt * (1 + 1e-9)).all()
        moving_out = np.where(q > joints.upper, v, -v) > joints.acceleration * dt
        outside = (q > joints.upper) | (q < joints.lower)
        braked = np.where(q > joints.upper, v - command, command - v)
        assert (braked[moving_out & outside] >= (joints.acceleration * dt * (1 - 1e-9))[moving_out & outside]).all()
        q, v = q + command * dt, command
        out.append(np.maximum(np.maximum(q - joints.upper, joints.lower - q), 0.0))
    return np.array(out)


@pytest.mark.parametrize("seed", range(4))
def test_from_outside_it_brakes_fully_and_returns_for_good(seed: int) -> None:
    rng, n, dt = np.random.default_rng(seed), 50, 0.005
    width = 10.0 ** rng.uniform(-3, 1, n)
    joints = Joints(-width / 2, width / 2, rng.uniform(0.5, 5.0, n), 10.0 ** rng.uniform(0, 3, n))
    side = rng.choice([-1.0, 1.0], n)
    start = side * (width / 2 + 10.0 ** rng.uniform(-6, 0, n))
    speed = side * rng.uniform(-1.0, 2.0, n) * joints.velocity
    violation = returning(joints, start, speed, dt, rng)
    for column in violation.T:
        fall = int(np.argmax(column))
        assert (np.diff(column[fall:]) <= 1e-15).all(), "braked once, it never grows again"
    # Slowest: 2 m/s over the limit at 1 rad/s^2, then 5/s for what is left of 7.5 s
    stopped = np.argmax(violation, axis=0) < 1500 - 800
    assert stopped.sum() > 25
    assert (violation[-1][stopped] < 0.02 * violation.max(axis=0)[stopped] + 1e-9).all()


def test_too_fast_is_braked_at_the_acceleration_limit() -> None:
    """Above the velocity limit, or too fast before a position limit, the interval is the point of full braking."""
    joints = Joints(np.array([-1.0]), np.array([1.0]), np.array([2.0]), np.array([10.0]))
    interval = joints.interval(None)
    for q, v, scale in ((0.0, 3.0, 1.0), (0.9, 1.9, 1.0), (0.0, 1.5, 0.1)):
        lower, upper = (float(e) for e in interval(q, v, 0.005, scale))
        assert lower == upper == v - 10.0 * 0.005
        lower, upper = (float(e) for e in interval(-q, -v, 0.005, scale))
        assert lower == upper == -v + 10.0 * 0.005
