"""Levels of a stack: the independent solver's optimum, one answer of both back ends, and what a step tells."""

from __future__ import annotations

import pathlib
import pickle
from typing import Any

import numpy as np
import pytest

import wbc
from tests.backends import IN_PYTHON
from tests.levels import arms
from tests.levels.reference import Goal, hierarchy
from tests.models import frame_jacobian
from wbc.api import Controller
from wbc.controller import Status, core_of
from wbc.errors import LevelError
from wbc.stack.codegen import row_units
from wbc.tasks import EndEffector, Fixed, FrameVelocityLimit, Hold, JointLimits, Posture


@pytest.fixture(scope="module")
def vm() -> Controller:
    return arms.levels().compile(solver=IN_PYTHON)


@pytest.fixture(scope="module")
def native() -> Controller:
    return arms.levels().compile(backend="native")


@pytest.fixture(scope="module")
def calm() -> tuple[Controller, Controller]:
    stack = arms.levels(calm=True, soft=False)
    return stack.compile(solver=IN_PYTHON), stack.compile(backend="native")


def goals(controller: Controller) -> list[Goal]:
    """The levels of the last tick, written down anew."""
    tick: Any = core_of(controller).tick
    rows, layout = tick.assembly.task_rows(), core_of(controller).layout
    out = []
    for place, number in enumerate(layout.levels):
        blocks = [b for b in layout.of_form("task") if b.entry.level == number]
        at = np.concatenate([np.arange(b.span.start, b.span.stop) for b in blocks] or [np.zeros(0, dtype=int)])
        weight = np.sqrt(tick.weight[at] * rows.factor[at])
        soft = np.flatnonzero(np.array(layout.row_levels) == place)
        scale = max([float(w) for w in tick.weight[at] * layout.row_scales(controller.stack)[at] ** 2], default=1.0)
        assert scale == 1.0 or not soft.size
        out.append(Goal(weight[:, None] * rows.J[at], weight * rows.desired[at], soft))
    return out


def wanted(controller: Controller, v: np.ndarray) -> np.ndarray:
    """The optimum by the reference, from any velocity that the hard rows allow."""
    tick: Any = core_of(controller).tick
    qp, (low, high) = controller.qp(), tick.assembly.row_bounds()
    n, unit = qp.n, np.array(row_units(controller.stack, core_of(controller).layout))
    lower, upper = np.concatenate((qp.lower[:n], low / unit)), np.concatenate((qp.upper[:n], high / unit))
    return hierarchy(v, lower, upper, qp.A / unit[:, None], goals(controller))


def test_commands_are_the_optimum_of_the_reference(vm: Controller) -> None:
    rng = np.random.default_rng(2)
    compared = 0
    for _ in range(25):
        q, v = arms.put(vm, rng)
        step = vm.step(q, v)
        if step.status != Status.SOLVED or min(x.singular for x in step.levels) < 1e-2:
            continue
        assert np.abs(step.v - wanted(vm, step.v)).max() <= 1e-8
        compared += 1
    assert compared >= 10


def test_back_ends_agree(vm: Controller, native: Controller, calm: tuple[Controller, Controller]) -> None:
    for pair, count in (((vm, native), 30), (calm, 30)):
        first, second = np.random.default_rng(4), np.random.default_rng(4)
        statuses = set()
        for _ in range(count):
            one, other = (c.step(*arms.put(c, rng)) for c, rng in zip(pair, (first, second), strict=True))
            assert np.abs(one.v - other.v).max() <= 1e-6
            assert one.status == other.status
            assert [x.solved for x in one.levels] == [x.solved for x in other.levels]
            assert [str(b) for b in one.relaxed] == pytest.approx([str(b) for b in other.relaxed])
            statuses.add(one.status)
        assert Status.SOLVED in statuses


def test_later_levels_never_disturb_earlier_ones(native: Controller) -> None:
    """The first level alone moves its rows as it does with all the others below it."""
    rng = np.random.default_rng(6)
    stack = wbc.Stack(arms.arm(), arms.DT, calm=False)
    stack.add(EndEffector("tip", kind="position"), name="tip").add(JointLimits())
    upper = stack.compile(solver=IN_PYTHON)
    for _ in range(40):
        q, v = arms.put(native, rng)
        step = native.step(q, v)
        upper.reset(q)
        upper["tip"].target = native["tip"].target
        reference = upper.step(q, v)
        J = frame_jacobian(stack.robot, "tip", q)[:3]
        if step.status == Status.SOLVED and not any(b.item == "ball" for b in step.binding):
            assert np.abs(J @ (step.v - reference.v)).max() <= 2e-6
        assert max((x.disturbance for x in step.levels), default=0.0) <= 1e-6


def test_sensible_words_for_every_level(vm: Controller) -> None:
    rng = np.random.default_rng(0)
    q, v = arms.put(vm, rng)
    step = vm.step(q, v)
    assert [x.level for x in step.levels] == [0, 2, 3, 7, None]
    assert {name: r.level for name, r in step.residuals.items()} == {"tip": 0, "knee": 2, "posture": 7}
    assert {b.level for b in step.binding} <= {0, 2, 3, 7, None}
    dropped = [d for x in step.levels for d in x.dropped]
    assert {d.unit for d in dropped} <= {"m/s", "rad/s"}
    # what a dropped row misses is what its task asks for and does not get
    tick: Any = core_of(vm).tick
    rows = tick.assembly.task_rows()
    missed = np.abs(rows.J @ step.v - rows.desired)
    knee = next(d for d in dropped if (d.item, d.row) == ("knee", "x"))
    assert knee.inconsistency == pytest.approx(missed[core_of(vm).layout.blocks["knee"].start])


def test_contradicting_and_redundant_equalities_are_named() -> None:
    stack = wbc.Stack(arms.arm(), arms.DT, calm=False)
    stack.add(Hold("link2", kind="position"), name="hold")
    stack.add(Fixed(("joint1",)), name="fixed")
    stack.add(Posture(), name="posture", level=1).add(EndEffector("tip", kind="position"), name="tip")
    controller = stack.compile(solver=IN_PYTHON)
    step = controller.step([0.3, 0.4, -0.2, 0.6, 0.1])
    assert {(d.item, d.inconsistency <= 1e-12) for d in step.levels[0].dropped if d.item == "hold"} == {("hold", True)}
    # joints 1 and 2 are held: the posture cannot move them
    assert [d.row for d in step.levels[1].dropped] == ["joint1", "joint2"]


def test_a_braked_tick_has_no_levels(vm: Controller) -> None:
    clone = vm.clone()
    q, v = arms.put(clone, np.random.default_rng(0))
    clone["tip"].target = [1e300, 1e300, 0.0]
    clone["tip"].gain = 1e59
    step = clone.step(q, v)
    assert step.status == Status.BRAKED
    assert step.levels == ()
    assert np.isfinite(step.v).all()


def test_one_level_by_another_number_is_one_level() -> None:
    stack = wbc.Stack(arms.arm(), arms.DT).add(Posture(), level=4).add(JointLimits())
    controller = stack.compile(solver=IN_PYTHON)
    assert not core_of(controller).layout.cascade
    assert controller.step(np.full(5, 0.1)).levels == ()


@pytest.mark.parametrize(
    ("item", "says"),
    [(JointLimits(), "always hard"), (Fixed(("joint1",)), "always hard")],
)
def test_bounds_have_no_level(item: Any, says: str) -> None:
    stack = wbc.Stack(arms.arm(), arms.DT)
    with pytest.raises(LevelError, match=says):
        stack.add(item, level=1)
    assert len(stack) == 0


def test_inverse_kinematics_refuses_levels() -> None:
    stack = arms.levels(soft=False)
    with pytest.raises(LevelError, match="one level"):
        stack.inverse_kinematics()
    soft = wbc.Stack(arms.arm(), arms.DT).add(EndEffector("tip", kind="position"))
    soft.add(FrameVelocityLimit("link2", linear=0.1), level=1)
    with pytest.raises(LevelError, match="one level"):
        soft.inverse_kinematics()


def test_clones_pickles_and_replays(native: Controller, tmp_path: pathlib.Path) -> None:
    q, v = arms.put(native, np.random.default_rng(9))
    clone = native.clone()
    again = pickle.loads(pickle.dumps(native.stack)).compile(backend="native")
    assert again.cached
    with native.record(tmp_path / "run.npz"):
        for k in range(5):
            first, second = native.step(q, v if k == 0 else None), clone.step(q, v if k == 0 else None)
            assert np.array_equal(first.v, second.v)
            q = q + first.v * arms.DT
    assert wbc.replay(tmp_path / "run.npz").identical


def test_osqp_on_native_rows_gives_the_same_levels(native: Controller) -> None:
    other = native.stack.compile(solver="osqp", backend="native")
    first, second = np.random.default_rng(11), np.random.default_rng(11)
    for _ in range(10):
        one, two = native.step(*arms.put(native, first)), other.step(*arms.put(other, second))
        assert np.abs(one.v - two.v).max() <= 1e-6


def test_a_capped_search_keeps_what_was_reached(native: Controller) -> None:
    capped = native.clone()
    capped.iteration_cap = 1
    rng = np.random.default_rng(12)
    seen = set()
    for _ in range(60):
        q, v = arms.put(capped, rng)
        step = capped.step(q, v)
        seen.add(step.status)
        assert (np.abs(step.v) <= 1.0 + 1e-12).all()
        if step.status == Status.CAPPED:
            assert step.certificate.error_bound == np.inf
    assert Status.CAPPED in seen
