"""No output is NaN, and no command leaves what the actuators can do, whatever comes in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st

from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, FRAMES, controller, near_limits, quarrel, robot
from tests.controller.test_sacrifice import within_actuators
from tests.models import placement
from wbc import tasks
from wbc.api import Stack
from wbc.controller import Status, Step, core_of
from wbc.shapes import Capsule, PlacedShape, Sphere

BACKENDS = (COMPILED, IN_PYTHON)


def numbers(step: Step) -> np.ndarray:
    """Every number of a step."""
    return np.frombuffer(step._data, dtype=np.float64, count=step._context.memory.report)


seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=50)
@given(seed=seeds, reach=st.floats(-2, 6), speed=st.floats(0, 3), factor=st.floats(0.25, 2.0))
def test_any_state_and_any_target(seed: int, reach: float, speed: float, factor: float) -> None:
    tick, rng = controller("conflicts", backend=COMPILED), np.random.default_rng(seed)
    bot = tick.stack.robot
    q, v, dt = near_limits(bot, rng), speed * rng.normal(size=bot.nv), DT * factor
    if seed % 4 == 0:  # far outside: several turns past the limits
        q = q + rng.normal(0.0, 10.0, bot.nq)
    tick.reset(q, v)
    quarrel(tick, rng)
    target = tick["hand"].target
    tick["hand"].target = pin.SE3(target.rotation, target.translation + 10.0**reach * rng.normal(size=3))
    tick["hand"].feedforward = 10.0 ** (reach - 1) * rng.normal(size=6)
    tick["hand"].gain = float(10.0 ** rng.uniform(-2, 3))
    for _ in range(3):
        step = tick.step(q, dt=dt)
        assert np.isfinite(numbers(step)).all()
        within_actuators(step, v, dt, bot)
        v, q = step.v.copy(), q + step.v * dt


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("size", [1e60, 1e150, 1e300])
def test_targets_beyond_any_measure(backend: str, size: float) -> None:
    """Squares of these numbers overflow: the tick may brake, but it gives no NaN and keeps the limits."""
    tick = controller("arm", "panda", **way(backend))
    bot, v = tick.stack.robot, np.full(7, 0.3)
    tick.reset(bot.neutral, v)
    tick["hand"].target = pin.SE3(np.eye(3), np.array([size, -size, size]))
    with np.errstate(over="ignore", invalid="ignore"):
        step = tick.step(bot.neutral, v)
    assert not np.isnan(numbers(step)).any()
    within_actuators(step, v, DT, bot)


@pytest.mark.parametrize("backend", BACKENDS)
def test_degenerate_geometry(backend: str) -> None:
    """A capsule without length, an obstacle on the centre of a link, a plane without an elbow, a half turn."""
    bot, f = robot("panda"), FRAMES["panda"]
    dot = PlacedShape(Capsule(0.05, 0.0), pin.SE3.Identity())
    bot = bot.with_shapes({"panda_link5": (dot, PlacedShape(Sphere(0.0), pin.SE3.Identity()))})
    stack = Stack(bot, DT).add(tasks.EndEffector(f.tip), name="hand").add(tasks.Posture(), name="posture", weight=1e-3)
    stack.add(tasks.PitchPlane("panda_link3", "panda_link3", "panda_link5"), name="plane")
    stack.add(tasks.JointLimits(), name="limits").add(tasks.Obstacle(Sphere(0.05)), name="ball")
    tick = stack.compile(**way(backend))
    link = placement(bot, "panda_link5", bot.neutral)
    tip = placement(bot, f.tip, bot.neutral)
    tick["ball"].pose = pin.SE3(np.eye(3), link.translation)
    tick["hand"].target = pin.SE3(tip.rotation @ np.diag([-1.0, -1.0, 1.0]), tip.translation)
    step = tick.step(bot.neutral)
    assert np.isfinite(numbers(step)).all()
    assert step.status in (Status.SOLVED, Status.RELAXED)
    assert "plane" in step.faded
    assert np.abs(step.residuals["hand"].values[3:]) @ np.ones(3) > 3.0
    within_actuators(step, np.zeros(7), DT, bot)


@dataclass(frozen=True)
class Broken(tasks.Constraint):
    """A constraint whose numbers are what its input says: NaN and infinite ones included."""

    where: str = "lower"

    def inputs(self, robot: Any) -> tuple[tasks.Input, ...]:
        return (tasks.Input("x", default=1.0),)

    def rows(self, robot: Any) -> tuple[tasks.Row, ...]:
        return (tasks.Row("row", "rad/s"),)

    def velocity_rows(self, robot: Any, kin: Any, inputs: Any, dt: ca.SX) -> tasks.Rows:
        value = ca.sqrt(inputs["x"])  # NaN for x < 0
        matrix = ca.SX(1, robot.nv)
        matrix[0, 2] = value if self.where == "matrix" else 1
        lower = value - 2 if self.where == "lower" else ca.SX(-2)
        return tasks.Rows(matrix, lower, value + 2 if self.where == "upper" else ca.SX(2))


@dataclass(frozen=True)
class BrokenBounds(tasks.Constraint):
    """Simple bounds [lower, upper] on one joint, NaN where lower > 100."""

    order: ClassVar[tasks.SacrificeOrder] = tasks.SacrificeOrder.SOFT

    def inputs(self, robot: Any) -> tuple[tasks.Input, ...]:
        return (tasks.Input("lower", default=-1.0), tasks.Input("upper", default=1.0))

    def rows(self, robot: Any) -> tuple[tasks.Row, ...]:
        return tuple(tasks.Row(name, "rad/s") for name in robot.dof_names)

    def bounds(self, robot: Any, kin: Any, inputs: Any, dt: ca.SX) -> tasks.Bounds:
        lower, upper = -ca.SX.inf(robot.nv), ca.SX.inf(robot.nv)
        lower[2], upper[2] = inputs["lower"] + 0 * ca.sqrt(100 - inputs["lower"]), inputs["upper"]
        return tasks.Bounds(lower, upper)


@dataclass(frozen=True)
class BrokenMargin(tasks.Constraint):
    """h = sqrt(q_3 - x), NaN beyond."""

    def inputs(self, robot: Any) -> tuple[tasks.Input, ...]:
        return (tasks.Input("x", default=-3.0),)

    def rows(self, robot: Any) -> tuple[tasks.Row, ...]:
        return (tasks.Row("root", "rad"),)

    def margins(self, robot: Any, kin: Any, inputs: Any) -> ca.SX:
        return ca.sqrt(kin.q[2] - inputs["x"])


def fragile(backend: str) -> Any:
    root = tasks.Expression(
        lambda kin, p: ca.sqrt(kin.joint("panda_joint3") + p["x"]), units="rad", inputs=(tasks.Input("x", default=1.0),)
    )
    stack = Stack(robot("panda"), DT).add(tasks.Posture(), name="posture").add(tasks.JointLimits(), name="limits")
    stack.add(root, name="root", weight=0.1)
    for where in ("matrix", "lower", "upper"):
        stack.add(Broken(where), name=where)
    stack.add(BrokenBounds(), name="bounds").add(BrokenMargin(), name="margin")
    return stack.compile(**way(backend))


BAD = [("root", "x", -5.0), ("matrix", "x", -1.0), ("lower", "x", -1.0), ("upper", "x", -1.0), ("margin", "x", 3.0)]
BAD += [("bounds", "lower", 101.0), ("bounds", "lower", 1.5)]


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_item_without_finite_numbers_brakes_until_it_is_off(backend: str) -> None:
    tick = fragile(backend)
    bot = robot("panda")
    q, v = bot.neutral, np.array([0.5, -0.4, 0.3, 0.0, 1.0, -1.0, 0.02])
    with np.errstate(invalid="ignore"):
        good = tick.step(q, v)
        assert good.status is Status.SOLVED
        for name, value, bad in BAD:
            before = getattr(tick[name], value)
            setattr(tick[name], value, bad)
            step = tick.step(q, v)
            assert step.status is Status.BRAKED, name
            assert not np.isnan(numbers(step)).any()
            within_actuators(step, v, DT, bot)
            assert step.v == pytest.approx(v - np.clip(v, -10 * DT, 10 * DT), abs=1e-12)
            if name == "root":
                assert step.residuals["root"].values[0] == np.inf
            if name == "margin":
                assert step.margins["margin"][0] == step.margins_ahead["margin"][0] == -np.inf
            tick[name].enabled = False
            without = tick.step(q, v)
            assert without.status is Status.SOLVED, name
            assert not np.isnan(numbers(without)).any()
            tick[name].enabled = True
            setattr(tick[name], value, before)
            # the tick that braked has left nothing behind
            core_of(tick).tick.reset()
            assert tick.step(q, v).v == pytest.approx(good.v, abs=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
def test_bounds_that_cross_by_rounding_only_are_one_value(backend: str) -> None:
    tick = fragile(backend)
    tick["bounds"].lower, tick["bounds"].upper = 0.03 + 1e-12, 0.03
    step = tick.step(robot("panda").neutral)
    assert step.status is Status.SOLVED
    assert step.v[2] == pytest.approx(0.03, abs=1e-11)
