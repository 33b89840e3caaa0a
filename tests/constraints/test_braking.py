"""The braking bound alone: the largest speed that stops in time, at constant and at varying tick lengths."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, strategies as st

from wbc.tasks.braking import braking_bound

positive = {"allow_nan": False, "allow_infinity": False}
accelerations = st.floats(0.1, 1e4, **positive)
ticks = st.floats(1e-4, 0.1, **positive)
#: Distance in units of a dt^2: from one tick of braking to thousands
distances = st.floats(1e-6, 1e6, **positive)


_d, _a, _dt, _s = (ca.SX.sym(name) for name in ("d", "a", "dt", "s"))
ANY = ca.Function("any", [_d, _a, _dt], [braking_bound(_d, _a, _dt)])
LEAST = ca.Function("least", [_d, _a, _dt, _s], [braking_bound(_d, _a, _dt, _s)])


def bound(d: float, a: float, dt: float, shortest: float | None = None) -> float:
    if a in (0.0, np.inf):
        return float(ca.evalf(braking_bound(ca.SX(d), a, ca.SX(dt), shortest)))
    return float(ANY(d, a, dt) if shortest is None else LEAST(d, a, dt, shortest))


def stopping_distance(v: float, a: float, lengths: np.ndarray) -> float:
    """Travel of a command v held for the first tick and braked at a over the others."""
    speeds = v - a * np.concatenate([[0.0], np.cumsum(lengths[1:])])
    assert speeds[-1] <= 0.0, "not enough ticks to stop"
    return float(np.maximum(speeds, 0.0) @ lengths)


def enough(v: float, a: float, dt: float) -> int:
    return int(v / (a * dt)) + 3


@given(a=accelerations, dt=ticks, x=distances)
def test_constant_ticks_exact_largest_speed(a: float, dt: float, x: float) -> None:
    d = x * a * dt**2
    v = bound(d, a, dt, shortest=dt)
    lengths = np.full(enough(1.001 * v, a, dt), dt)
    assert stopping_distance(v, a, lengths) <= d * (1 + 1e-12)
    assert stopping_distance(v * (1 + 1e-6), a, lengths) > d


@pytest.mark.parametrize("ticks_to_stop", [1, 2, 3, 10, 1000, 10**6])
@pytest.mark.parametrize("nudge", [-1, 0, 1])
def test_rounding_where_the_number_of_ticks_changes_costs_nothing(ticks_to_stop: int, nudge: int) -> None:
    """At d = a dt^2 n (n + 1) / 2 both numbers of ticks give n a dt, so a wrong ceil is harmless."""
    a, dt, n = 7.0, 0.003, ticks_to_stop
    d = a * dt**2 * n * (n + 1) / 2
    for _ in range(abs(nudge)):
        d = np.nextafter(d, nudge * np.inf)
    assert bound(d, a, dt, shortest=dt) == pytest.approx(n * a * dt, rel=1e-14)


@given(
    a=accelerations, shortest=st.floats(1e-4, 0.02), ratio=st.floats(1.0, 8.0), x=st.floats(1e-2, 1e4),
    seed=st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_ticks_of_a_least_length_stop_in_time(a: float, shortest: float, ratio: float, x: float, seed: int) -> None:
    dt = ratio * shortest
    d = x * a * shortest**2
    v = bound(d, a, dt, shortest)
    assert v >= bound(d, a, dt) * (1 - 1e-12), "a promise may only help"
    rng = np.random.default_rng(seed)
    count = enough(v, a, shortest)
    for later in (np.full(count, shortest), shortest * rng.uniform(1.0, 8.0, count), np.full(count, dt)):
        assert stopping_distance(v, a, np.concatenate([[dt], later])) <= d * (1 + 1e-12)
    worst = np.concatenate([[dt], np.full(count + 3, shortest)])
    assert stopping_distance(v * (1 + 1e-6), a, worst) > d


@pytest.mark.parametrize("shortest", [None, 0.005])
def test_ends_of_the_range(shortest: float | None) -> None:
    assert bound(0.0, 10.0, 0.005, shortest) == 0.0
    assert bound(0.0, 0.0, 0.005, shortest) == 0.0
    assert bound(1.0, 0.0, 0.005, shortest) == 0.0
    assert bound(0.01, np.inf, 0.005, shortest) == 2.0
    assert bound(1e300, 1e-300, 0.005, shortest) < np.inf
    assert bound(1e-9, 10.0, 0.005, shortest) == pytest.approx(2e-7, rel=1e-4)
