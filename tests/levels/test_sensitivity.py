"""Derivatives and prices through all levels against differences of whole ticks; multipliers of equality rows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import wbc
from tests.backends import COMPILED, IN_PYTHON, way
from tests.levels import arms
from tests.repeats import repeats
from wbc.api import Controller
from wbc.controller import Status, Step
from wbc.errors import SolverError
from wbc.tasks import Elbow, EndEffector, Fixed, Hold, JointLimits, Posture

STEP = 1e-6
Q = np.array([0.3, 0.4, -0.2, 0.6, 0.1])


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def calm(request: pytest.FixtureRequest) -> Controller:
    return arms.levels(calm=True, soft=False).compile(**way(request.param))


@pytest.fixture(scope="module")
def plain() -> Controller:
    return arms.levels().compile(solver=IN_PYTHON)


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def held(request: pytest.FixtureRequest) -> Controller:
    """A hand that is held, and levels that pull at it."""
    controller = holding(lower=True).compile(**way(request.param))
    pull(controller)
    return controller


def holding(lower: bool) -> wbc.Stack:
    """A hold that the first level pulls at, with levels below or without."""
    stack = wbc.Stack(arms.arm(), arms.DT, calm=False)
    stack.add(Hold("link4", kind="position"), name="hold")
    stack.add(Fixed(("joint2",)), name="fixed")
    stack.add(EndEffector("tip", kind="position"), name="tip").add(JointLimits(), name="limits")
    if lower:
        stack.add(Elbow("link3"), name="knee", level=1).add(Posture(), name="posture", level=2)
    return stack


def pull(controller: Controller) -> None:
    controller.reset(Q)
    controller["tip"].target, controller["tip"].gain = [0.9, 0.8, 0.0], 2.0
    if "knee" in controller:
        controller["knee"].target, controller["posture"].target = [0.2, 0.5, 0.0], Q + 0.3


def differences(moved: Callable[[float, int], np.ndarray], count: int, by: float = STEP) -> np.ndarray:
    """Central differences of commands, a column for each direction."""
    return np.array([(moved(by, k) - moved(-by, k)) / (2.0 * by) for k in range(count)]).T


def check(controller: Controller, step: Step, q: np.ndarray, v: np.ndarray, room: float) -> float:
    """Derivatives of a step against differences; how large they are."""
    unit, target = np.eye(arms.JOINTS), controller["posture"].target

    def posture(by: float, k: int) -> np.ndarray:
        controller["posture"].target = target + by * unit[k]
        out = controller.step(q, v).v
        controller["posture"].target = target
        return out

    slopes = {
        "q": differences(lambda by, k: controller.step(q + by * unit[k], v).v, arms.JOINTS),
        "v": differences(lambda by, k: controller.step(q, v + by * unit[k]).v, arms.JOINTS),
    }
    found = {name: step.derivative(name) for name in slopes}
    slopes["posture"], found["posture"] = differences(posture, arms.JOINTS), step.derivative("posture", "target")
    for name, slope in slopes.items():
        assert np.abs(found[name] - slope).max() <= room * max(1.0, np.abs(slope).max()), name
    return float(np.abs(slopes["q"]).max())


def checked(controller: Controller, draws: int, room: float) -> tuple[list[float], set[int | None]]:
    """Sizes of the derivatives of random states, and the levels at which rows pushed."""
    rng, sizes, levels = np.random.default_rng(3), [], set()
    for _ in range(draws):
        q, v = arms.put(controller, rng)
        step = controller.step(q, v)
        # near a stretched arm ranks change, see below
        if step.status == Status.SOLVED and np.abs(q[1:]).max() > 0.01:
            sizes.append(check(controller, step, q, v, room))
            levels |= {b.level for b in step.binding}
    return sizes, levels


def test_derivatives_are_those_of_whole_ticks(plain: Controller) -> None:
    sizes, levels = checked(plain, repeats(8), 1e-6)
    assert len(sizes) >= 3
    assert max(sizes) > 1.0
    assert levels - {0}


def test_derivatives_go_through_curvature(calm: Controller) -> None:
    # a command with curvature in it is known to some 1e-10 rad/s, of which differences over 2e-6 rad make 1e-4
    sizes, _ = checked(calm, 6, 1e-3)
    assert len(sizes) >= 3
    assert max(sizes) > 1.0


def test_a_rank_that_changes_has_no_derivative(plain: Controller) -> None:
    plain.reset(np.zeros(arms.JOINTS))
    plain["tip"].target, plain["knee"].target = [1.2, 0.2, 0.0], [0.8, 0.1, 0.0]
    steps = [plain.step([0.0, bend, 0.0, 0.0, 0.0]) for bend in np.geomspace(1e-8, 1e-4, 100)]
    ranks = [step.levels[0].rank for step in steps]
    assert (ranks[0], ranks[-1]) == (1, 2)
    step = steps[ranks.index(2)]
    with pytest.raises(SolverError, match="no derivative"):
        step.derivative("q")


def test_prices_reach_across_levels(plain: Controller) -> None:
    """Joints of 1 rad/s that may be faster: what every task of every level misses falls as it is told."""
    rng, compared = np.random.default_rng(2), 0
    for _ in range(6):
        q, v = arms.put(plain, rng)
        plain["limits"].velocity_scale = 0.9
        step = plain.step(q, v)
        if step.status != Status.SOLVED:
            continue
        prices = [p for p in step.explain().prices if p.bound.item == "limits"]
        assert {p.task for p in prices} <= {"tip", "knee", "posture"}
        told = {(p.task, p.unit): 0.0 for p in prices}
        for price in prices:
            told[price.task, price.unit] += price.amount
        losses = []
        for scale in (0.9 + STEP, 0.9 - STEP):
            plain["limits"].velocity_scale = scale
            losses.append({(x.task, x.unit): x.lost for x in plain.step(q, v).explain().losses})
        plain["limits"].velocity_scale = 1.0
        for key, fall in told.items():
            assert (losses[1][key] - losses[0][key]) / (2.0 * STEP) == pytest.approx(fall, abs=2e-3), key
            compared += 1
    assert compared >= 8


def test_equality_rows_tell_what_they_cost_the_first_level(held: Controller) -> None:
    step = held.step(Q)
    alone = holding(lower=False).compile(solver=IN_PYTHON)
    pull(alone)
    wanted = {(b.item, b.row): b.multiplier for b in alone.step(Q).binding}
    found = {(b.item, b.row): b.multiplier for b in step.binding}
    assert {key for key in found if key[0] == "hold"} == {("hold", "x"), ("hold", "y")}
    for key in (("hold", "x"), ("hold", "y")):
        assert found[key] == pytest.approx(wanted[key], rel=1e-6)
    assert {(b.bound, b.level) for b in step.binding if b.item == "hold"} == {("equal", 0)}
    assert "hold/y equal costs knee" in str(step.explain())


def test_equality_rows_have_their_price_at_every_level(held: Controller) -> None:
    step = held.step(Q)
    prices = {(p.bound.row, p.task): p for p in step.explain().prices if p.bound.item == "hold"}
    start = held["hold"].target
    for row, k in (("x", 0), ("y", 1)):
        losses = []
        for by in (STEP, -STEP):
            moved = start.copy()
            moved.translation[k] += by / held["hold"].gain
            held["hold"].target = moved
            losses.append({x.task: x.lost for x in held.step(Q).explain().losses if x.unit == "m/s"})
        held["hold"].target = start
        for task in ("tip", "knee"):
            slope = abs(losses[0][task] - losses[1][task]) / (2.0 * STEP)
            assert abs(prices[row, task].amount) == pytest.approx(slope, rel=1e-3)
