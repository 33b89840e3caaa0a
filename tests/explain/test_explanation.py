"""What a step says of itself: who is in conflict, what binds, what the tasks lost and to whom."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, FRAMES, robot
from tests.models import frame_jacobian, placement
from tests.torque.problems import controller
from wbc.api import Controller, Stack
from wbc.controller import Status, core_of
from wbc.errors import SolverError
from wbc.explain.explanation import Contradiction, ExplainedBound, Give, Price, by_item, by_task
from wbc.explain.naming import Naming
from wbc.explain.past import past_of
from wbc.shapes import Sphere
from wbc.tasks import Constraint, EndEffector, Hold, Input, JointLimits, Obstacle, Posture, Row, Rows

TIP = FRAMES["panda"].tip


@dataclass(frozen=True)
class Ask(Constraint):
    """v_1 >= x, NaN for x < 0."""

    def inputs(self, robot: Any) -> tuple[Input, ...]:
        return (Input("x", default=0.0),)

    def rows(self, robot: Any) -> tuple[Row, ...]:
        return (Row("ask", "rad/s"),)

    def velocity_rows(self, robot: Any, kin: Any, inputs: Any, dt: ca.SX) -> Rows:
        matrix = ca.SX(1, robot.nv)
        matrix[0, 0] = 1
        return Rows(matrix, ca.sqrt(inputs["x"]), ca.SX.inf(1))


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def tick(request: pytest.FixtureRequest) -> Controller:
    stack = Stack(robot("panda"), DT)
    stack.add(EndEffector(TIP), name="hand").add(Posture(), name="posture", weight=1e-3)
    stack.add(JointLimits(), name="limits").add(Hold(TIP, kind="position"), name="grip")
    stack.add(Obstacle(Sphere(0.05)), name="ball").add(Ask(), name="ask")
    controller = stack.compile(**way(request.param))
    return controller


@pytest.fixture(autouse=True)
def _fresh(tick: Controller) -> None:
    q = robot("panda").neutral
    tick.reset(q)
    here = tip(q)
    tick["hand"].target, tick["grip"].target = here, here
    tick["ball"].pose = pin.SE3(np.eye(3), np.array([0.0, 0.0, 9.0]))
    tick["ask"].x = 0.0
    tick["limits"].velocity_scale = 1.0
    for name in ("grip", "ball", "ask"):
        tick[name].enabled = False


def tip(q: np.ndarray) -> pin.SE3:
    bot = robot("panda")
    return placement(bot, TIP, q)


def moved(by: list[float]) -> pin.SE3:
    here = tip(robot("panda").neutral)
    return pin.SE3(here.rotation, here.translation + by)


def test_a_conflict_names_row_and_joint_and_the_least_that_ends_it(tick: Controller) -> None:
    """A joint is asked for twice the speed that its acceleration allows from rest."""
    bot = robot("panda")
    able = bot.limits.acceleration[0] * DT
    tick["ask"].enabled, tick["ask"].x = True, (2 * able) ** 2
    step = tick.step(bot.neutral, np.zeros(7))
    assert step.status is Status.RELAXED
    explanation = step.explain()
    (conflict,) = explanation.conflicts
    assert [(s.name, s.which, s.kind) for s in conflict.bounds] == [
        ("limits/panda_joint1", "upper", "acceleration"),
        ("ask/ask", "lower", ""),
    ]
    assert [side.value for side in conflict.bounds] == pytest.approx([able, 2 * able])
    assert conflict.enough
    assert conflict.cheapest.bound.name == "ask/ask"
    assert conflict.cheapest.amount == pytest.approx(able, rel=1e-6)
    assert [(g.bound.name, g.bound.unit) for g in explanation.least] == [("ask/ask", "rad/s")]
    assert explanation.least[0].amount == pytest.approx(able, rel=1e-6)
    assert explanation.gave_way[0].amount == pytest.approx(step.relaxed[0].amount)
    text = str(explanation)
    assert "limits (acceleration: panda_joint1 at most 0.05 rad/s)" in text
    assert "Cheapest to relax: ask/ask by 0.05 rad/s." in text


def test_a_margin_says_what_it_has_to_spare(tick: Controller) -> None:
    q = robot("panda").neutral
    tick["grip"].enabled = tick["ball"].enabled = True
    tick["ball"].pose = moved([0.2, 0.0, 0.0])
    tick["ball"].velocity = [-4.0, 0, 0, 0, 0, 0]
    step = tick.step(q, np.zeros(7))
    sides = [side for conflict in step.explain().conflicts for side in conflict.bounds if side.item == "ball"]
    assert sides
    for side in sides:
        block = core_of(tick).layout.blocks["ball"]
        k = [row.label for row in block.rows].index(side.row)
        assert side.margin == step.margins["ball"][k]


def test_losses_and_prices_are_what_other_limits_give(tick: Controller) -> None:
    """Prices add up to the derivative of the loss along a common scale of all velocity limits."""
    bot = robot("panda")
    tick["hand"].target = moved([0.0, 0.05, 0.0])
    tick["limits"].velocity_scale = 0.01
    step = tick.step(bot.neutral, np.zeros(7))
    explanation = step.explain()
    assert step.status is Status.SOLVED
    assert explanation.conflicts == ()
    loss = next(loss for loss in explanation.losses if (loss.task, loss.unit) == ("hand", "m/s"))
    assert loss.requested == pytest.approx(2.0 * 0.05, rel=1e-6)
    assert loss.to[0].item == "limits"
    kinds = {side.kind for side in explanation.binding if side.item == "limits"}
    assert kinds == {"velocity"}

    def lost(scale: float) -> float:
        tick["limits"].velocity_scale = scale
        again = tick.step(bot.neutral, np.zeros(7)).explain()
        return next(loss.lost for loss in again.losses if (loss.task, loss.unit) == ("hand", "m/s"))

    measured = (lost(0.01 - 1e-6) - lost(0.01 + 1e-6)) / 2e-6
    speeds = dict(zip(bot.dof_names, bot.limits.velocity, strict=True))
    told = sum(p.amount * speeds[p.bound.row] for p in explanation.prices if (p.task, p.unit) == ("hand", "m/s"))
    assert told == pytest.approx(measured, rel=1e-3)
    # regained: what the loss is without the limits
    tick["limits"].enabled = False
    free = tick.step(bot.neutral, np.zeros(7)).explain()
    tick["limits"].enabled = True
    rest = [x.lost for x in free.losses if (x.task, x.unit) == ("hand", "m/s")]
    assert loss.to[0].amount == pytest.approx(loss.lost - (rest[0] if rest else 0.0), abs=2e-4 * loss.requested)


def test_losses_are_those_of_the_command(tick: Controller) -> None:
    """J v - w by Pinocchio: the hand is asked for 2/s times its error."""
    bot = robot("panda")
    q = bot.neutral
    tick["hand"].target = moved([0.0, 0.05, 0.0])
    step = tick.step(q, np.zeros(7))
    missing = frame_jacobian(bot, TIP, q)[:3] @ step.v - [0.0, 0.1, 0.0]
    loss = next(loss for loss in step.explain().losses if (loss.task, loss.unit) == ("hand", "m/s"))
    assert loss.lost == pytest.approx(np.linalg.norm(missing), rel=1e-9)


def test_an_explanation_stays_true_after_later_ticks(tick: Controller) -> None:
    q = robot("panda").neutral
    tick["ask"].enabled, tick["ask"].x = True, 1.0
    step = tick.step(q, np.zeros(7))
    first = str(step.explain())
    tick["ask"].enabled = False
    later = tick.step(q + 0.1)
    assert str(step.explain()) == first
    assert "cannot hold" in first
    assert "cannot hold" not in str(later.explain())
    assert np.array_equal(tick.last_command, later.v)


def test_items_without_numbers_are_named(tick: Controller) -> None:
    tick["ask"].enabled, tick["ask"].x = True, -1.0
    with np.errstate(invalid="ignore"):
        step = tick.step(robot("panda").neutral)
        explanation = step.explain()
    assert step.status is Status.BRAKED
    assert explanation.broken == ("ask",)
    assert "Without usable numbers: ask." in str(explanation)


def test_residuals_are_physical_and_small(tick: Controller) -> None:
    tick["hand"].target = moved([0.1, 0.05, 0.0])
    tick["grip"].enabled = True
    explanation = tick.step(robot("panda").neutral, np.zeros(7)).explain()
    for residue in (explanation.primal, explanation.dual, explanation.complementarity):
        assert residue.amount < 1e-8
        assert residue.unit in ("m/s", "rad/s")


def test_a_step_from_a_pickle_tells_everything_else(tick: Controller) -> None:
    step = tick.step(robot("panda").neutral)
    for other in (pickle.loads(pickle.dumps(step)), copy.deepcopy(step)):
        assert repr(other) == repr(step)
        with pytest.raises(SolverError, match="pickle"):
            other.explain()


def test_a_large_contradiction_names_its_largest_members_and_counts_the_rest() -> None:
    bounds = tuple(ExplainedBound(f"item {k % 8}", f"row {k}", "upper", float(k), "rad/s") for k in range(40))
    gives = tuple(Give(b, 1.0 + k) for k, b in enumerate(bounds))
    shares = tuple(1.0 / (1.0 + k) for k in range(40))
    text = str(Contradiction(bounds, gives, True, gives[0], shares))
    assert text == (
        "These 40 cannot hold together, any 39 of them can: "
        + ", ".join(
            f"item {i} (5 rows: row {i} at most {i} rad/s, row {i + 8} at most {i + 8} rad/s, "
            f"row {i + 16} at most {i + 16} rad/s, and 2 more)"
            for i in range(6)
        )
        + ", and 10 rows of item 6, item 7. Cheapest to relax: item 0/row 0 by 1 rad/s, instead item 1/row 1 by 2 rad/s"
        " or item 2/row 2 by 3 rad/s or item 3/row 3 by 4 rad/s or one of 36 others."
    )
    few = str(Contradiction(bounds[:12], gives[:12], True, gives[0], shares[:12]))
    assert all(str(bound) in few for bound in bounds[:12])


def test_wrenches_among_what_binds_have_names() -> None:
    tick = controller("walker")
    tick.reset(tick.stack.robot.neutral)
    step = tick.step(tick.stack.robot.neutral, np.zeros(tick.stack.robot.nv))
    naming = Naming(past_of(step._data, step._context))
    names = [(bound.row, bound.unit) for bound in (naming.bound(row, True) for row in (24, 29, 35))]
    assert names == [("grip 1.fx", "N"), ("grip 1.mz", "N m"), ("grip 2.mz", "N m")]


def test_many_bounds_are_told_by_item_and_many_prices_by_task() -> None:
    """A humanoid's torque tick has dozens of each: every bound is named once, of the prices the highest of a kind."""
    bounds = tuple(
        ExplainedBound("foot", row, "equal", 0.0, unit) for unit, row in (("m/s^2", "x"), ("m/s^2", "y"), ("N", "z"))
    )
    motor = ExplainedBound("motors", "knee", "upper", 17.0, "N m")
    assert by_item((*bounds, motor)) == "foot (x, y exactly 0 m/s^2; z exactly 0 N), motors (knee at most 17 N m)"
    prices = [Price(b, "hand", cost, "m/s^2") for b, cost in zip((*bounds, motor), (1.0, -2.0, 3.0, 4.0), strict=True)]
    told = (
        "Of 4 active bounds these cost hand most: foot/y -2 m/s^2 per m/s^2, foot/z 3 m/s^2 per N, "
        "motors/knee 4 m/s^2 per N m."
    )
    assert by_task(tuple(prices)) == [told]
