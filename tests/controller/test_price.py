"""Soft constraints at a price: the stated cost against bounded least squares, and everything that holds for weights."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.softness import Soft, Wish, jacobian, optimum
from tests.controller.stacks import DT, robot
from tests.refusals import assert_refused
from wbc.api import Controller, Stack
from wbc.controller import Status
from wbc.errors import NotFiniteError, RangeError, UnknownAttributeError
from wbc.tasks import EndEffector, Fixed, FrameVelocityLimit, Hold, JointLimits, Obstacle, Posture

TIP, MIDDLE = "panda_hand_tcp", "panda_link5"
LIMIT = 0.1


def stack(hold: float | None, slow: float | None, level: int = 0) -> Stack:
    """A hand that is slowed down at a price, and a link that is held at another; no more than velocity limits."""
    out = Stack(robot("panda"), DT, calm=False, length=0.5)
    out.add(EndEffector(TIP, kind="position"), name="hand", weight=2.0)
    out.add(Posture(), name="posture", weight=1e-2, level=level)
    out.add(JointLimits(acceleration=False, position=False), name="limits")
    out.add(Hold(MIDDLE, kind="position"), name="hold", soft=hold)
    return out.add(FrameVelocityLimit(TIP, linear=LIMIT), name="slow", soft=slow)


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def tick(request: pytest.FixtureRequest) -> Controller:
    return stack(3.0, 5.0).compile(**way(request.param))


@pytest.fixture(autouse=True)
def _fresh(tick: Controller) -> None:
    tick.reset(robot("panda").neutral)
    tick["hold"].set(price=3.0)
    tick["slow"].price = 5.0


def state(tick: Controller, rng: np.random.Generator) -> np.ndarray:
    """A random configuration, with the hand's target and the held place somewhere near."""
    q = np.asarray(pin.integrate(robot("panda").model, robot("panda").neutral, rng.uniform(-1.0, 1.0, 7)))
    tick.reset(q)
    tick["hand"].target = jacobian(robot("panda"), q, TIP)[0] + rng.normal(0.0, 0.3, 3)
    tick["hold"].target = pin.SE3(np.eye(3), jacobian(robot("panda"), q, MIDDLE)[0] + rng.normal(0.0, 0.02, 3))
    return q


def expected(tick: Controller, q: np.ndarray) -> np.ndarray:
    bot, unit = robot("panda"), tick.stack.length**2
    speed = bot.limits.velocity
    place, J = jacobian(bot, q, TIP)
    hand, posture = tick["hand"], tick["posture"]
    wishes = [
        Wish(J, -hand.gain * (place - hand.target), hand.weight / unit),
        Wish(np.eye(7), -posture.gain * pin.difference(bot.model, posture.target, q), posture.weight),
    ]
    middle, J_middle = jacobian(bot, q, MIDDLE)
    still = -tick["hold"].gain * (middle - tick["hold"].target.translation)
    bound = np.full(3, LIMIT)
    rows = [
        Soft(J_middle, still, still, tick["hold"].price / unit),
        Soft(J, -bound, bound, tick["slow"].price / unit),
    ]
    return optimum(-speed, speed, wishes, rows)[0]


def test_the_command_minimises_the_stated_cost(tick: Controller) -> None:
    rng = np.random.default_rng(3)
    gave = 0
    for _ in range(15):
        q = state(tick, rng)
        for name in ("hold", "slow"):
            tick[name].price = float(10.0 ** rng.uniform(-3.0, 3.0))
        step = tick.step(q)
        assert step.status is Status.SOLVED
        assert step.certificate.error_bound < 1e-6
        v = expected(tick, q)
        assert step.v == pytest.approx(v, abs=2e-7)
        beyond = np.abs(jacobian(robot("panda"), q, TIP)[1] @ step.v) - LIMIT
        told = {s.row: s.amount for s in step.relaxed if s.item == "slow"}
        assert set(told) == {axis for axis, x in zip("xyz", beyond, strict=True) if x > 1e-8}
        assert all(told[a] == pytest.approx(x, abs=1e-9) for a, x in zip("xyz", beyond, strict=True) if a in told)
        gave += len(told)
    assert gave > 10


def test_prices_change_at_run_time_and_ramp(tick: Controller) -> None:
    q = state(tick, np.random.default_rng(8))
    tick["hand"].target = jacobian(robot("panda"), q, TIP)[0] + np.array([0.4, 0.4, -0.2])

    def excess() -> float:
        step = tick.step(q)
        return float(np.abs(jacobian(robot("panda"), q, TIP)[1] @ step.v).max())

    speeds = []
    for price in (0.0, 0.1, 1.0, 10.0, 1e3, 1e6):
        tick["slow"].price = price
        speeds.append(excess())
    assert (np.diff(speeds) < 0.0).all()
    assert speeds[-1] == pytest.approx(LIMIT, abs=1e-5)
    tick["slow"].enabled = False
    assert excess() == pytest.approx(speeds[0], abs=1e-9), "a price of 0 is no constraint"
    tick["slow"].enabled = True
    tick["slow"].ramp(0.0, 0.1)
    on_the_way = [excess() for _ in range(21)]
    assert (np.diff(on_the_way) >= -1e-12).all()
    assert np.diff(on_the_way).max() < 0.5 * (speeds[0] - LIMIT)
    assert tick["slow"].price == 0.0
    tick["slow"].ramp(7.0, 0.1)
    tick["slow"].price = 4.0
    excess()
    assert tick["slow"].price == 4.0, "setting the price ends the ramp"
    assert_refused(lambda: tick["limits"].ramp(1.0, 1.0), UnknownAttributeError, "limits.ramp")
    with pytest.raises(RangeError, match="price"):
        tick["slow"].price = -1.0
    assert_refused(lambda: tick["slow"].ramp(1e12, 1.0), RangeError, "price")


def test_the_explanation_says_what_was_given_up_and_to_whom(tick: Controller) -> None:
    q = state(tick, np.random.default_rng(2))
    tick["hand"].target = jacobian(robot("panda"), q, TIP)[0] + np.array([0.0, 0.5, 0.0])
    step = tick.step(q)
    found = step.explain()
    loss = next(loss for loss in found.losses if loss.task == "slow")
    amounts = [s.amount for s in step.relaxed if s.item == "slow"]
    assert loss.lost == pytest.approx(float(np.linalg.norm(amounts)), rel=1e-6)
    assert loss.to[0].item == "hand"
    assert "slow gives up" in str(found)
    assert not found.conflicts


def test_the_price_is_no_part_of_the_compiled_code() -> None:
    assert stack(3.0, 5.0).key_data() == stack(4.0, 5e-3).key_data()
    assert stack(None, 5.0).key_data() != stack(3.0, 5.0).key_data()
    plain = stack(None, None)
    assert wbc.stack.layout.Layout(plain).variables == 7, "nothing is added where nothing is soft"


def test_levels_price_violations_within_a_level() -> None:
    """Below the hand a held link gives way entirely, whatever its price; above the posture it pays as at one level."""
    bot = robot("panda")
    out = Stack(bot, DT, calm=False)
    out.add(EndEffector(TIP, kind="position"), name="hand")
    out.add(Posture(), name="posture", level=1)
    out.add(JointLimits(acceleration=False, position=False), name="limits")
    out.add(Hold(TIP, kind="position"), name="hold", soft=1e3, level=1)
    out.add(FrameVelocityLimit(TIP, linear=LIMIT), name="slow", soft=4.0)
    speeds = {}
    for backend in (IN_PYTHON, COMPILED):
        c = out.compile(**way(backend))
        c.reset(bot.neutral)
        c["hand"].target = jacobian(bot, bot.neutral, TIP)[0] + np.array([0.0, 0.15, 0.0])
        step = c.step(bot.neutral)
        assert step.status is Status.SOLVED
        speeds[backend] = step.v
        moved = (jacobian(bot, bot.neutral, TIP)[1] @ step.v)[1]
        assert moved == pytest.approx((0.3 + 4.0 * LIMIT) / 5.0, abs=1e-6)
        assert {(s.item, s.row) for s in step.relaxed} == {("slow", "y"), ("hold", "y")}
    assert speeds[COMPILED] == pytest.approx(speeds[IN_PYTHON], abs=1e-8)


@pytest.mark.parametrize("item", [JointLimits(), Fixed("panda_joint1"), EndEffector(TIP)])
def test_what_cannot_be_soft_is_refused(item: Any) -> None:
    out = Stack(robot("panda"), DT)
    assert_refused(lambda: out.add(item, soft=1.0), RangeError, "soft")
    assert len(out) == 0


def test_bad_prices_are_refused() -> None:
    out = Stack(robot("panda"), DT)
    for bad, error in ((-1.0, RangeError), (np.nan, NotFiniteError), (1e10, RangeError)):
        with pytest.raises(error, match="soft"):
            out.add(Hold(TIP), soft=bad)
    assert_refused(lambda: out.add(Hold(TIP), soft=1.0, hard=False), RangeError, "soft")
    assert len(out) == 0
    out.add(EndEffector(TIP), name="hand").add(Obstacle(wbc.shapes.Sphere(0.1)), name="ball", soft=1.0)
    with pytest.raises(RangeError, match=r"ball.*inverse kinematics"):
        out.inverse_kinematics()
