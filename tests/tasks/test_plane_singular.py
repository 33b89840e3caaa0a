"""The angle of an arm's plane at and near its singular sets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.tasks.planes import (
    OFFSET,
    PANDA,
    SPHERICAL,
    TILTED,
    compiled,
    evaluate,
    robot,
    wrap,
)
from wbc.tasks._plane import PlaneItem
from wbc.tasks._stereographic import PlaneReference
from wbc.tasks.pitch_plane import PitchPlane
from wbc.tasks.pitch_plane_limit import PitchPlaneLimit

#: name of the robot, item, configuration exactly on a singular set, direction that leaves it
SINGULAR: dict[str, tuple[str, PlaneItem, list[float], list[float]]] = {
    "straight arm": ("spherical", SPHERICAL, [0.3, 0.9, 0.2, 0, 0.4, 0.5, 0.6], [0, 0, 0, 1, 0, 0, 0]),
    "folded arm": ("unequal", SPHERICAL, [0.3, 0.9, 0.2, np.pi, 0.4, 0.5, 0.6], [0, 0, 0.2, 1, 0, 0, 0]),
    "wrist at shoulder": ("equal", SPHERICAL, [0.3, 0.9, 0.2, np.pi, 0.4, 0.5, 0.6], [0, 0.3, 0, 1, 0, 0, 0]),
    "straight down": ("spherical", SPHERICAL, [0, np.pi, 0, 0, 0, 0, 0], [0, 1, 0, 0.7, 0, 0, 0]),
    "all zero": ("spherical", SPHERICAL, [0] * 7, [0, 0.2, 0, 1, 0, 0, 0]),
    "half-line": ("equal", SPHERICAL, [0.4, np.pi - 0.5, 0, 1, 0, 0, 0], [0.1, 1, 0.3, 0, 0, 0, 0]),
    "pitch axes coaxial": (
        "ssrms",
        replace(OFFSET, axis="joint3"),
        [0.3, 0.4, -0.5, np.pi, 0.7, -0.6, 0.9],
        [0, 0, 0.3, 1, 0, 0, 0],
    ),
    "pitch axes coaxial, angle": (
        "ssrms",
        replace(OFFSET, axis="joint3", reference=TILTED),
        [0.3, 0.4, -0.5, np.pi, 0.7, -0.6, 0.9],
        [0, 0, 0.3, 1, 0, 0, 0],
    ),
    "limit, straight arm": (
        "spherical",
        PitchPlaneLimit("F1", "F4", "F5", lower=-1, upper=2),
        [0.3, 0.9, 0.2, 0, 0.4, 0.5, 0.6],
        [0, 0, 0, 1, 0, 0, 0],
    ),
    "limit, half-line": (
        "equal",
        PitchPlaneLimit("F1", "F4", "F5", lower=-1, upper=2),
        [0.4, np.pi - 0.5, 0, 1, 0, 0, 0],
        [0.1, 1, 0.3, 0, 0, 0, 0],
    ),
}


@pytest.mark.parametrize("case", SINGULAR)
def test_nothing_breaks_on_a_singular_set(case: str) -> None:
    """Finite values and derivatives on the set and at every distance from it; the row is off on the set."""
    name, item, q, direction = SINGULAR[case]
    q, direction = np.array(q, dtype=float), np.array(direction, dtype=float)
    value, jacobian, factor = evaluate(name, item, q)
    assert (factor == 0.0).all()
    if isinstance(item, PitchPlaneLimit):
        np.testing.assert_allclose(value, 1.5)
        np.testing.assert_array_equal(jacobian, np.zeros((2, 7)))
    for distance in [0.0, *np.logspace(-300, 0, 301)]:
        for part in evaluate(name, item, q + distance * direction, 0.4):
            assert np.isfinite(part).all()


@pytest.mark.parametrize("case", SINGULAR)
def test_fading_is_smooth(case: str) -> None:
    """Along a line through the set: 0 on it, 1 far off, monotone between, no jump in the first two derivatives."""
    name, item, q, direction = SINGULAR[case]
    q, direction = np.array(q, dtype=float), np.array(direction, dtype=float)
    jumps = []
    for count in (4000, 8000):
        distances = np.linspace(-1.2, 1.2, count + 1)
        moved = np.stack([q + t * direction for t in distances], axis=1)
        function = compiled(name, item)
        factor = np.array(function.map(count + 1)(moved, np.zeros((1, count + 1)))[2])
        factor = factor.reshape(-1, order="F")[:: 2 if isinstance(item, PitchPlaneLimit) else 1]
        assert ((factor >= 0) & (factor <= 1)).all()
        step = distances[1] - distances[0]
        first = np.diff(factor) / step
        second = np.diff(first) / step
        jumps.append((np.abs(np.diff(first)).max(), np.abs(np.diff(second)).max()))
        assert factor[count // 2] == 0.0
        assert factor.max() == 1.0
    # A jump would stay when the step is halved; a continuous derivative's differences halve with it
    assert jumps[1][0] < 0.6 * jumps[0][0]
    assert jumps[1][1] < 0.7 * jumps[0][1]


@pytest.mark.parametrize("case", [c for c in SINGULAR if not c.startswith("limit")])
def test_faded_curvature_goes_to_zero(case: str) -> None:
    """factor J'J, what the row adds to the Hessian, is bounded and vanishes towards the set, though J grows."""
    name, item, q, direction = SINGULAR[case]
    q, direction = np.array(q, dtype=float), np.array(direction, dtype=float)
    rows = [evaluate(name, item, q + t * direction) for t in np.logspace(-9, np.log10(0.4), 600)]
    added = np.array([f[0] * (j @ j.T).item() for _, j, f in rows])
    plain = max((j @ j.T).item() for _, j, f in rows if f[0] == 1.0)
    assert added[:5].max() == 0.0
    assert added.max() < 4 * plain
    assert added[np.flatnonzero(added)[0]] < 1e-3 * plain


def share_clear(item: PitchPlane) -> float:
    """Share of 500 uniform states within the Panda's limits where the row has its full weight."""
    limits = robot("panda").limits
    within = np.random.default_rng(11).uniform(limits.position_lower, limits.position_upper, (500, 7))
    return float(np.mean([evaluate("panda", item, q)[2][0] == 1.0 for q in within]))


def test_panda_elbow_that_crosses_the_line() -> None:
    """Link 4 crosses the shoulder-wrist line at q4 = -(atan(0.0825 / 0.316) + atan(0.0825 / 0.384)), inside the limits.

    There the three-point plane is undefined; link 3, on the upper arm's axis, and the axis form have no such state.
    """
    crossing = -(np.arctan(0.0825 / 0.316) + np.arctan(0.0825 / 0.384))
    assert robot("panda").limits.position_lower[3] < crossing < robot("panda").limits.position_upper[3]
    q = np.array([0.2, 0.4, -0.3, crossing, 0.1, 1.2, 0.5])
    beyond = q + [0, 0, 0, 0.3, 0, 0, 0]
    before = q - [0, 0, 0, 0.3, 0, 0, 0]
    straight = replace(PANDA, elbow="panda_link3")
    axis = replace(PANDA, axis="panda_joint4", reference=PlaneReference())
    assert evaluate("panda", PANDA, q)[2][0] == 0.0
    assert abs(wrap(evaluate("panda", PANDA, beyond)[0][0] - evaluate("panda", PANDA, before)[0][0])) > 2.0
    for item in (straight, axis):
        assert evaluate("panda", item, q)[2][0] == 1.0
        assert abs(wrap(evaluate("panda", item, beyond)[0][0] - evaluate("panda", item, before)[0][0])) < 0.5
    assert 0.85 < share_clear(PANDA) < 0.92
    assert share_clear(straight) > 0.95
    assert share_clear(axis) > 0.99
