"""The angle of an arm's plane in closed loops, and within limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.tasks.planes import (
    LIMIT,
    OFFSET,
    PANDA,
    SPHERICAL,
    TILTED,
    clear,
    compiled,
    evaluate,
    robot,
    seen,
    states,
    wrap,
)
from wbc.tasks.pitch_plane import PitchPlane
from wbc.tasks.pitch_plane_limit import PitchPlaneLimit


@pytest.mark.parametrize(
    ("name", "item"),
    [
        ("panda", PANDA),
        ("spherical", SPHERICAL),
        ("ssrms", OFFSET),
        ("ssrms", replace(OFFSET, axis="joint3", reference=TILTED)),
    ],
    ids=str,
)
def test_closed_loop_from_random_starts(name: str, item: PitchPlane) -> None:
    """100 random starts: v = J' wish, damped and faded as in the tick; psi measured with Pinocchio's poses."""
    dt, gain, count = 0.01, 2.0, 100
    starts = states(name, count, seed=12).T
    targets = np.random.default_rng(13).uniform(-np.pi, np.pi, (1, count))
    rows = compiled(name, item).map(count)
    q, begin, worst = starts.copy(), None, np.ones(count)
    for _ in range(400):
        error, jacobian, factor, _ = (np.array(o) for o in rows(q, targets))
        jacobian = jacobian.reshape(count, -1)
        begin = error.ravel() if begin is None else begin
        worst = np.minimum(worst, factor.ravel())
        size = factor.ravel() * (jacobian**2).sum(axis=1)
        speed = -gain * error.ravel() * factor.ravel() / (size + 1e-8)
        q = q + dt * (speed[:, None] * jacobian).T
    left = np.array([wrap(seen(name, item, q[:, k]).psi - targets[0, k]) for k in range(count)])
    # Starts that never came near a singular set: exponential decay, the first step's curvature aside
    good = worst == 1.0
    assert good.sum() > 50
    assert np.abs(left[good]).max() < 3e-3
    np.testing.assert_array_less(np.abs(left[good]), np.abs(begin[good]) * np.exp(-gain * 400 * dt) * 1.5 + 1e-9)
    # Through a faded zone it is slower, and nothing blows up
    assert np.isfinite(q).all()
    assert np.mean(np.abs(left) < 3e-3) > 0.8


LIMITS: dict[str, tuple[str, PitchPlaneLimit]] = {
    "panda": ("panda", PitchPlaneLimit("panda_link2", "panda_link4", "panda_link6", lower=-1.0, upper=0.2)),
    "spherical": ("spherical", LIMIT),
    "range across pi": ("spherical", replace(LIMIT, lower=2.5, upper=4.0)),
    "axis": ("ssrms", PitchPlaneLimit("F3", "F4", "F5", axis="joint3", lower=-1.0, upper=1.0)),
}


@pytest.mark.parametrize("case", LIMITS)
def test_margins_are_the_distances_to_the_bounds(case: str) -> None:
    name, item = LIMITS[case]
    for q in clear(name, item, 20, seed=14):
        middle, half = (item.lower + item.upper) / 2, (item.upper - item.lower) / 2
        off = wrap(seen(name, item, q).psi - middle)
        np.testing.assert_allclose(evaluate(name, item, q)[0], [half + off, half - off], atol=1e-11)


@pytest.mark.parametrize("case", LIMITS)
def test_margin_derivative_includes_the_fading(case: str) -> None:
    """Central differences of the margins themselves, at random states and inside the faded zones."""
    name, item = LIMITS[case]
    model = robot(name).model
    states_here = list(states(name, 10, seed=15))
    if name == "spherical":
        states_here += [np.array([0.3, 0.9, 0.2, bend, 0.4, 0.5, 0.6]) for bend in (0.05, 0.1, 0.15, 0.2)]
        assert 0.0 < evaluate(name, item, states_here[-2])[2][0] < 1.0
    for q in states_here:
        jacobian = evaluate(name, item, q)[1]
        for k, direction in enumerate(1e-6 * np.eye(model.nv)):
            change = evaluate(name, item, q + direction)[0] - evaluate(name, item, q - direction)[0]
            np.testing.assert_allclose(jacobian[:, k], change / 2e-6, atol=1e-6 * (1 + np.abs(jacobian).max() ** 2))


def push(
    name: str, item: PitchPlaneLimit, dt: float, seconds: float = 0.8, count: int = 20
) -> tuple[np.ndarray, float]:
    """Constant commands against the margin rows from admissible starts: last states and the lowest margin."""
    model, rate = robot(name).model, 20.0
    inside = [q for q in states(name, 200, seed=16) if evaluate(name, item, q)[0].min() > 0.02][:count]
    assert len(inside) == count
    q = np.array(inside).T
    wanted = np.random.default_rng(17).normal(scale=0.4, size=(model.nv, count))
    mapped, none = compiled(name, item).map(count), np.zeros((1, count))
    lowest, touched = np.inf, 0
    for _ in range(round(seconds / dt)):
        margin, jacobian, _, _ = (np.array(o) for o in mapped(q, none))
        v = wanted.copy()
        for side, along in enumerate(jacobian.reshape(2, model.nv, count, order="F")):
            size = (along**2).sum(axis=0)
            short = np.maximum(-rate * margin[side] - (along * v).sum(axis=0), 0.0)
            touched += int((short > 0).sum())
            v = v + along * (short / np.where(size > 0, size, 1.0))
        q = q + dt * v
        lowest = min(lowest, float(np.array(mapped(q, none)[0]).min()))
    assert touched > 100
    return q, lowest


@pytest.mark.parametrize("case", LIMITS)
def test_closed_loop_stays_within_the_limit(case: str) -> None:
    """What is passed is the curvature of one tick: small, and in proportion to dt. Checked with Pinocchio's poses."""
    name, item = LIMITS[case]
    _, coarse = push(name, item, 0.004)
    last, fine = push(name, item, 0.002)
    assert coarse > -0.05
    assert min(coarse, -1e-3) * 0.7 < fine
    reached = [wrap(seen(name, item, q).psi - (item.lower + item.upper) / 2) for q in last.T]
    clear_now = [evaluate(name, item, q)[2][0] == 1.0 for q in last.T]
    assert sum(clear_now) > 5
    half = (item.upper - item.lower) / 2
    assert max(abs(a) for a, c in zip(reached, clear_now, strict=True) if c) < half - fine + 1e-9
