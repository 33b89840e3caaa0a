"""Weights of every size, scaled tasks and many soft rows: solved, certified, and the same as a referee's answer."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, robot
from tests.models import placement
from tests.soak.both import feasible
from wbc.api import Controller, Stack
from wbc.controller import Status, core_of
from wbc.qp.polishing import polish
from wbc.qp.problem import QPSolution
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.tasks import EndEffector, FrameVelocityLimit, JointLimits, Posture, WorkspacePolyhedron
from wbc.tick.buffers import BRAKED, SOLVED, UNSOUND
from wbc.tick.native import CompiledTick

TIP, MIDDLE = "panda_hand_tcp", "panda_link5"
#: What a step without any other solver reports besides the flags of a tick, as in ``native/tick.h``
RECOVERED, UNCERTIFIED = 4, 8


def hand(level: int | None, scaled: bool = True) -> Stack:
    """A hand within limits, and a posture at a level; None for none."""
    out = Stack(robot("panda"), DT)
    out.add(EndEffector(TIP), name="hand", scaled=scaled)
    if level is not None:
        out.add(Posture(), name="posture", level=level, weight=1e-2)
    return out.add(JointLimits())


def reached(q: np.ndarray, frame: str = TIP) -> pin.SE3:
    """Pose of a frame."""
    return placement(robot("panda"), frame, q)


def anywhere(rng: np.random.Generator, share: float = 0.0) -> np.ndarray:
    """A configuration within the position limits, and a share of their width away from them."""
    limits = robot("panda").limits
    low, high = limits.position_lower, limits.position_upper
    return rng.uniform(low + share * (high - low), high - share * (high - low))


@pytest.mark.parametrize("level", [None, 0, 1])
def test_scaled_hands_are_always_solved(level: int | None) -> None:
    controller, rng = hand(level).compile(backend=COMPILED), np.random.default_rng(0)
    q, seen = robot("panda").neutral, []
    for k in range(900):
        if k % 30 == 0:
            controller["hand"].target = reached(anywhere(rng))
        step = controller.step(q)
        seen.append((step.status, step.answered_by))
        q = pin.integrate(robot("panda").model, q, step.v * DT)
    assert set(seen) == {(Status.SOLVED, "")}


def wild(level: int, backend: str = COMPILED) -> Controller:
    """Two tasks, a posture and a soft speed, whose weights are far apart."""
    out = Stack(robot("panda"), DT)
    out.add(EndEffector(TIP), name="hand").add(EndEffector(MIDDLE, kind="position"), name="elbow")
    out.add(Posture(), name="posture", level=level).add(JointLimits())
    return out.add(FrameVelocityLimit(TIP, linear=0.1), name="slow", soft=1.0).compile(**way(backend))


def provoke(controller: Controller, rng: np.random.Generator) -> None:
    """Weights from 1e-12 to 1e9, prices from 1e-9 to 1e9, and targets anywhere."""
    q = anywhere(rng, 0.05)
    controller.reset(q)
    for name in ("hand", "elbow", "posture"):
        controller[name].weight = float(10.0 ** rng.uniform(-12.0, 9.0))
    controller["slow"].price = float(10.0 ** rng.uniform(-9.0, 9.0))
    controller["hand"].target = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(0.0, 0.5, 3))
    controller["elbow"].target = rng.normal(0.0, 0.5, 3)
    core_of(controller).begin(q, rng.normal(0.0, 0.3, 7))


def test_weights_of_every_size_are_solved_within_the_stated_bound() -> None:
    controller, rng = wild(0), np.random.default_rng(3)
    tick, places, compared = core_of(controller).tick, Memory(core_of(controller).layout), 0
    assert isinstance(tick, CompiledTick)
    for _ in range(120):
        provoke(controller, rng)
        qp = tick.qp()
        assert tick.step() == SOLVED or not feasible(qp)
        wide = qp.with_slacks()
        found = polish(wide, QPSolution(np.zeros(wide.n), np.zeros(wide.n + wide.m), "failed"), 200)
        push = np.abs(found.solution.multipliers[found.solution.multipliers != 0.0])
        spread = np.linalg.cond(qp.H)
        # numbers that far apart leave the referee's signs to rounding
        if not found.exact or spread > 1e14 or push.min(initial=1.0) < 1e-11 * push.max(initial=0.0):
            continue
        compared += 1
        off = np.abs(tick.report[places["v"]] - found.solution.x[: qp.n]).max()
        assert off <= float(tick.report[places["error_bound"]][0]) + 1e-15 * spread
    assert compared > 40


def test_a_step_without_other_solvers_brakes_and_says_so() -> None:
    controller, rng = wild(1), np.random.default_rng(0)
    tick, places = core_of(controller).tick, Memory(core_of(controller).layout)
    assert isinstance(tick, CompiledTick)
    safe = tick._library.wbc_tick_safe_step
    seen = dict.fromkeys((SOLVED, RECOVERED, UNCERTIFIED), 0)
    for _ in range(600):
        provoke(controller, rng)
        start, first = tick.v_last.copy(), tick.step()
        tick.v_last[:] = start
        status = safe(tick.pointer)
        if first == SOLVED:
            assert status == SOLVED
        if status == UNCERTIFIED:
            assert first & UNSOUND
            tick.v_last[:] = start
            qp = tick.qp()
            assert tick.report[places["v"]][:7] == pytest.approx(np.clip(0.0, qp.lower[:7], qp.upper[:7]), abs=1e-15)
        seen[status] = seen.get(status, 0) + 1
    assert seen[SOLVED] > 400
    assert seen[UNCERTIFIED] > 0
    assert not seen.get(BRAKED, 0)


def faces(count: int, soft: float | None) -> Stack:
    """A hand and planes on every side of it, of which it violates many at once where they are moved inwards."""
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    around = normals @ reached(robot("panda").neutral).translation - 0.05
    planes = WorkspacePolyhedron(TIP, normals=[tuple(n) for n in normals], offsets=[float(d) for d in around])
    return hand(0, scaled=False).add(planes, name="planes", soft=soft)


def test_soft_rows_add_no_variables() -> None:
    assert Layout(faces(2000, 1.0)).variables == Layout(faces(2000, None)).variables == 7


@pytest.mark.parametrize("backend", [COMPILED, IN_PYTHON])
def test_many_soft_rows_at_once(backend: str) -> None:
    controller, rng = faces(60, 1.0).compile(**way(backend)), np.random.default_rng(4)
    offsets, given = controller["planes"].offsets.copy(), 0
    for k in range(6 if backend == IN_PYTHON else 30):
        q = np.asarray(pin.integrate(robot("panda").model, robot("panda").neutral, rng.uniform(-0.05, 0.05, 7)))
        controller.reset(q)
        controller["planes"].set(price=float(10.0 ** rng.uniform(-4.0, 7.0)), offsets=offsets + 0.1 * (k % 3))
        controller["hand"].target = pin.SE3(reached(q).rotation, reached(q).translation + rng.normal(0.0, 0.2, 3))
        step = controller.step(q)
        assert step.status is Status.SOLVED
        tick = getattr(core_of(controller).tick, "assembly", core_of(controller).tick)
        tick.v_last[:] = 0.0
        wide = tick.qp().with_slacks()
        found = polish(wide, QPSolution(np.zeros(wide.n), np.zeros(wide.n + wide.m), "failed"), 400)
        if found.exact:
            assert step.v == pytest.approx(found.solution.x[:7], abs=step.certificate.error_bound + 1e-9)
        given = max(given, len(step.relaxed))
    assert given > 20
