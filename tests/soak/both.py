"""The native tick beside one solved by OSQP from the same states: how they end, and by how much they differ."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

from tests.judges.exact_qp import reference
from tests.soak.episodes import label
from tests.soak.levels import with_levels
from tests.soak.machines import configuration, machine
from tests.soak.stacks import DT, provoke, random_stack
from wbc.controller import Status, Step
from wbc.errors import SolverError
from wbc.explain.past import past_of
from wbc.qp import QP, make_solver
from wbc.validation import Array

#: Ticks from one start on
LENGTH = 4
#: Differences up to this are no matter [rad/s, m/s]; QPs that differ by more of their size are two problems
SAME, ALIKE = 1e-9, 1e-12


def both(seed: int, k: int, ticks: int, levels: bool = False) -> list[tuple[str, Counter[str]]]:
    """A random stack with both solvers: its description and its counts."""
    rng = np.random.default_rng([seed, 14, k, int(levels)])
    robot = machine(rng)
    stack = random_stack(robot, rng)
    if levels:
        stack = with_levels(stack, rng)
    pair, counts = (stack.compile(backend="native"), stack.compile(backend="vm", solver="osqp")), Counter[str]()
    q, v = robot.neutral, np.zeros(robot.nv)
    for tick in range(ticks):
        if tick % LENGTH == 0:
            q = configuration(robot, rng, False)
            v = robot.limits.velocity * rng.uniform(-0.5, 0.5, robot.nv)
            state = rng.bit_generator.state
            for controller in pair:
                rng.bit_generator.state = state
                controller.reset(q, v)
                provoke(controller, rng)
        steps = [controller.step(q, v) for controller in pair]
        counts[label(steps[0])] += 1
        counts.update(f"wrong: {what}" for what in wrong(steps, stack.calm and bool(levels)))
        q, v = pin.integrate(robot.model, q, steps[0].v * DT), steps[0].v
    items = " ".join(f"{e.name}:{e.level}" for e in stack.entries)
    return [(f"both {seed}/{k}: {robot.nv} dof, {items}", counts)]


def wrong(steps: list[Step], curved_levels: bool) -> set[str]:
    """What must not be: braking where rows can hold, and an error beyond the bound that is stated for it."""
    found = set()
    for step in steps:
        if step.status is Status.BRAKED:
            past = past_of(step._data, step._context)
            if past.usable and feasible(past.qp):
                found.add("braked on rows that can hold")
    one, other = steps
    stated = one.certificate.error_bound + other.certificate.error_bound
    if one.status is other.status is Status.SOLVED and np.abs(one.v - other.v).max() > stated + SAME:
        if not one.levels:
            found |= {"further off than stated" for step in steps if beyond(step)}
        elif not curved_levels and alike(past_of(one._data, one._context).qp, past_of(other._data, other._context).qp):
            found.add("levels further off than stated")
    return found


def beyond(step: Step) -> bool:
    """Whether a command is further from the verified minimiser of its own QP than its certificate says."""
    wide = past_of(step._data, step._context).qp.with_slacks()
    try:
        best: Array = reference(wide, make_solver("daqp", wide.n, wide.m).solve(wide, warm=False)).x
    except SolverError:
        return False
    return bool(np.abs(best[: step.v.size] - step.v).max() > step.certificate.error_bound + SAME)


def alike(one: QP, other: QP) -> bool:
    """Whether two QPs differ by rounding only."""
    return all(
        np.allclose(a, b, rtol=ALIKE, atol=ALIKE * float(np.abs(a).max(initial=0.0)))
        for a, b in ((one.H, other.H), (one.g, other.g), (one.A, other.A))
    )


def feasible(qp: QP) -> bool:
    """Whether a linear program finds a point that keeps all hard rows."""
    qp = qp.hard()
    n = qp.n
    low, high = qp.lower[n:], qp.upper[n:]
    rows = np.vstack((qp.A[np.isfinite(high)], -qp.A[np.isfinite(low)]))
    sides = np.concatenate((high[np.isfinite(high)], -low[np.isfinite(low)]))
    given = {"A_ub": rows, "b_ub": sides} if len(rows) else {}
    box = list(zip(qp.lower[:n], qp.upper[:n], strict=True))
    return bool(linprog(np.zeros(n), bounds=box, **given).status == 0)
