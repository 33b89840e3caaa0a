"""The declared order of sacrifice: what holds, what gives way, and how it is said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, controller, inside, near_limits, quarrel, robot
from tests.models import frame_jacobian
from wbc.api import Controller, Stack
from wbc.controller import Status, Step, core_of
from wbc.shapes import HalfSpace
from wbc.tasks import Constraint, EndEffector, Fixed, Hold, JointLimits, Obstacle, Posture, Row, Rows, SacrificeOrder

BACKENDS = (COMPILED, IN_PYTHON)
TIP = "panda_hand_tcp"


def within_actuators(step: Step, before: np.ndarray, dt: float, bot: object) -> None:
    """Velocity and acceleration limits, counted by hand from the velocity before the tick."""
    limits = bot.limits
    assert np.isfinite(step.v).all()
    reach = limits.acceleration * dt
    # from above the velocity limit the joint can only brake towards it
    high = np.maximum(limits.velocity, before - reach)
    low = np.minimum(-limits.velocity, before + reach)
    room = 1e-12 * np.maximum(1.0, np.where(np.isfinite(limits.velocity), limits.velocity, 1.0))
    assert (step.v <= high + room).all()
    assert (step.v >= low - room).all()
    assert (np.abs(step.v - before) <= reach + room).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_actuator_bounds_hold_whatever_contradicts(backend: str) -> None:
    tick = controller("conflicts", **way(backend))
    bot, rng = tick.stack.robot, np.random.default_rng(2)
    for _ in range(120 if backend == COMPILED else 30):
        q, v, dt = near_limits(bot, rng), 1.5 * rng.normal(size=bot.nv), DT * rng.uniform(0.25, 2.0)
        tick.reset(q, v)
        quarrel(tick, rng)
        within_actuators(tick.step(q, v, dt), v, dt, bot)


def two_holds() -> Stack:
    """Two frames of one body that are held, a floor and the joint limits; a task for what is left."""
    stack = Stack(robot("panda"), DT)
    stack.add(EndEffector(TIP), name="hand")
    stack.add(Posture(), name="posture", weight=1e-3)
    stack.add(JointLimits(), name="limits")
    stack.add(Hold(TIP), name="hold")
    stack.add(Obstacle(HalfSpace(), links=TIP), name="floor")
    return stack


@pytest.fixture(scope="module", params=BACKENDS)
def both(request: pytest.FixtureRequest) -> Controller:
    return two_holds().compile(**way(request.param))


def lifted(tick: Controller, q: np.ndarray, clearance: float) -> None:
    """A floor below the tip's shapes at the given clearance, so that the held frame may collide."""
    tick["floor"].pose = pin.SE3.Identity()
    tick["floor"].enabled = False
    margin = tick.step(q).margins["floor"].min()
    tick["floor"].pose = pin.SE3(np.eye(3), np.array([0.0, 0.0, margin - clearance]))
    tick["floor"].enabled = True
    tick.reset(q)


def test_a_collision_margin_gives_way_to_a_hold(both: Controller) -> None:
    q = both.stack.robot.neutral.copy()
    both.reset(q)
    lifted(both, q, clearance=-0.05)  # 5 cm inside the floor: the row asks for 1 m/s, the hold for none
    step = both.step(q)
    assert step.status is Status.RELAXED
    assert {s.item for s in step.relaxed} == {"floor"}
    assert all(s.unit == "m/s" and s.amount > 0.1 for s in step.relaxed)
    assert np.abs(frame_jacobian(both.stack.robot, TIP, q) @ step.v).max() < 1e-8
    # the amount is the violation of dh/dt >= -rate h, here with dh/dt = 0
    asked = -both["floor"].rate * step.margins["floor"]
    rows = core_of(both).layout.blocks["floor"].rows
    assert {s.row: s.amount for s in step.relaxed} == pytest.approx(
        {row.label: a for row, a in zip(rows, asked, strict=True) if a > 0},
        abs=1e-6,
    )
    # without the hold the margin is recovered as fast as the joints may
    both["hold"].enabled = False
    both.reset(q)
    free = both.step(q)
    assert max(s.amount for s in free.relaxed) < max(s.amount for s in step.relaxed)
    both["hold"].enabled = True
    both.reset(q)
    lifted(both, q, clearance=0.2)
    assert both.step(q).status is Status.SOLVED


def test_a_hold_gives_way_to_joint_limits(both: Controller) -> None:
    bot = both.stack.robot
    q = bot.neutral.copy()
    q[3] = bot.limits.position_upper[3] + 0.02  # outside: the joint must return, the held hand moves with it
    both["floor"].enabled = False
    both.reset(q)
    step = both.step(q, np.zeros(7))
    assert step.status is Status.RELAXED
    assert {s.item for s in step.relaxed} == {"hold"}
    assert {s.unit for s in step.relaxed} <= {"m/s", "rad/s"}
    assert step.v[3] < -1e-3
    assert any(b.item == "limits" and b.row == "panda_joint4" and b.bound == "upper" for b in step.binding)
    # the same rows at a place where nothing is outside: solved again at once
    q[3] = bot.limits.position_upper[3] - 0.3
    both.reset(q)
    assert both.step(q).status is Status.SOLVED
    both["floor"].enabled = True


def test_least_squares_among_equals() -> None:
    """Two holds of the same frame at different places share the conflict equally, in metres."""
    stack = Stack(robot("panda"), DT)
    stack.add(Posture(), name="posture")
    stack.add(Hold(TIP, "position", gain=5.0), name="here").add(Hold(TIP, "position", gain=5.0), name="there")
    for backend in BACKENDS:
        tick = stack.compile(**way(backend))
        q = robot("panda").neutral
        tick.reset(q)
        place = tick["here"].target
        tick["there"].target = pin.SE3(place.rotation, place.translation + np.array([0.02, 0.0, -0.04]))
        step = tick.step(q)
        amounts = {(s.item, s.row): s.amount for s in step.relaxed}
        wanted = {("here", "x"): 0.05, ("there", "x"): 0.05, ("here", "z"): 0.1, ("there", "z"): 0.1}
        assert amounts == pytest.approx(wanted, abs=1e-7)


@dataclass(frozen=True)
class Ask(Constraint):
    """lower <= v_joint <= upper, in a class of the test's choice."""

    joint: int = 0
    low: float = 0.0
    high: float = 0.0

    def rows(self, robot: object) -> tuple[Row, ...]:
        return (Row("ask", "rad/s"),)

    def velocity_rows(self, robot: object, kin: object, inputs: object, dt: ca.SX) -> Rows:
        matrix = ca.SX(1, robot.nv)
        matrix[0, self.joint] = 1
        return Rows(matrix, ca.SX(self.low), ca.SX(self.high))


@dataclass(frozen=True)
class AskActuator(Ask):
    order: ClassVar[SacrificeOrder] = SacrificeOrder.ACTUATOR


@dataclass(frozen=True)
class AskPosition(Ask):
    order: ClassVar[SacrificeOrder] = SacrificeOrder.POSITION


@dataclass(frozen=True)
class AskSoft(Ask):
    order: ClassVar[SacrificeOrder] = SacrificeOrder.SOFT


@pytest.mark.parametrize("backend", BACKENDS)
def test_classes_in_their_order(backend: str) -> None:
    """Four rows ask one joint for four velocities; the highest class that is on decides."""
    stack = Stack(robot("panda"), DT)
    stack.add(Posture(), name="posture").add(JointLimits(acceleration=False), name="limits")
    stack.add(AskPosition(low=0.1, high=0.1), name="position")
    stack.add(Ask(low=0.2, high=0.2), name="margin")
    stack.add(AskSoft(low=0.3, high=0.3), name="soft")
    tick = stack.compile(**way(backend))
    q = robot("panda").neutral
    for off, wanted, relaxed in (
        ((), 0.1, {"margin": 0.1, "soft": 0.2}),
        (("position",), 0.2, {"soft": 0.1}),
        (("margin",), 0.1, {"soft": 0.2}),
        (("position", "margin"), 0.3, {}),
    ):
        for name in ("position", "margin", "soft"):
            tick[name].enabled = name not in off
        step = tick.step(q)
        assert step.v[0] == pytest.approx(wanted, abs=1e-8)
        assert {s.item: s.amount for s in step.relaxed} == pytest.approx(relaxed, abs=1e-7)
        assert step.status is (Status.RELAXED if relaxed else Status.SOLVED)
    tick["position"].enabled = tick["margin"].enabled = tick["soft"].enabled = False
    assert tick.step(q).v[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
def test_rows_whose_sides_cross_are_met_half_way(backend: str) -> None:
    stack = Stack(robot("panda"), DT).add(Posture(), name="posture").add(Ask(low=0.3, high=0.1), name="crossed")
    tick = stack.compile(**way(backend))
    step = tick.step(robot("panda").neutral)
    assert step.status is Status.RELAXED
    assert step.v[0] == pytest.approx(0.2)
    assert [(s.item, s.row, s.unit) for s in step.relaxed] == [("crossed", "ask", "rad/s")]
    assert step.relaxed[0].amount == pytest.approx(0.1)


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_impossible_row_of_the_actuators_brakes(backend: str) -> None:
    """Nothing may stand in for what the actuators cannot do: every joint comes to rest at its own limits."""
    bot = robot("panda")
    stack = Stack(bot, DT).add(EndEffector(TIP), name="hand").add(Posture(), name="posture", weight=1e-3)
    stack.add(JointLimits(), name="limits").add(AskActuator(joint=1, low=50.0, high=60.0), name="never")
    tick = stack.compile(**way(backend))
    v, q = np.array([1.0, -0.5, 0.02, 0.8, -1.2, 0.0, 0.3]), bot.neutral
    for _ in range(60):
        step = tick.step(q, v)
        assert step.status is Status.BRAKED
        within_actuators(step, v, DT, bot)
        assert (np.abs(step.v) <= np.abs(v)).all()
        assert step.v == pytest.approx(v - np.clip(v, -10 * DT, 10 * DT), abs=1e-12)
        assert np.isinf(step.certificate.error_bound)
        v, q = step.v.copy(), q + step.v * DT
    assert not v.any()
    tick["never"].enabled = False
    assert tick.step(q).status is Status.SOLVED


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_fixed_joint_outside_its_limits_returns(backend: str) -> None:
    """Position limits come before a fixed joint, among simple bounds as well."""
    bot = robot("panda")
    stack = Stack(bot, DT).add(Posture(), name="posture").add(Fixed("panda_joint2"), name="fixed")
    stack.add(JointLimits(), name="limits")
    tick = stack.compile(**way(backend))
    q = bot.neutral.copy()
    assert tick.step(q).v[1] == 0.0
    q[1] = bot.limits.position_upper[1] + 0.05
    tick.reset(q)
    step = tick.step(q)
    assert step.v[1] < 0.0
    assert step.status is Status.SOLVED


def test_feasible_again_is_solved_again() -> None:
    """Along a run that passes through conflicts, status follows the rows and nothing lingers."""
    tick, fresh = controller("conflicts", backend=COMPILED), controller("conflicts", backend=COMPILED)
    bot, rng = tick.stack.robot, np.random.default_rng(4)
    q = inside(bot, rng)
    seen = []
    for each in (tick, fresh):
        each.reset(q)
    for k in range(30):
        conflict = k % 3 == 1
        for each in (tick, fresh):
            for name in ("hold", "hold_elbow", "speed", "ball"):
                each[name].enabled = conflict
            each["hold"].gain = 30.0 if conflict else 1.0
            each["hold"].target = pin.SE3(np.eye(3), np.array([0.0, 0.0, 3.0]))
        step = tick.step(q, np.zeros(7))
        core_of(fresh).tick.reset()
        assert np.abs(step.v - fresh.step(q, np.zeros(7)).v).max() < 1e-9
        seen.append(step.status)
    assert seen == [Status.RELAXED if k % 3 == 1 else Status.SOLVED for k in range(30)]
