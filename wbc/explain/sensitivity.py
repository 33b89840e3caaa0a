"""How the command of a past tick moves with what the tick was given: through its active set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wbc import validation
from wbc.errors import SolverError
from wbc.explain.past import Frozen, PastTick
from wbc.multibody import pin
from wbc.qp.problem import QP, QPSolution
from wbc.qp.relax import Relaxed
from wbc.qp.sensitivity import Sensitivity, Squares, force_between
from wbc.stack.layout import Block, Slot
from wbc.validation import Array

#: Displacement by which the QP's own numbers are differentiated
_STEP = 1e-6

Moves = Callable[[int, float], None]
#: x and the rows' multipliers of a first problem, and how they move [n, k], [m, k]
First = tuple[Array, Array, Array, Array]


def derivative(past: PastTick, name: str, value: str | None) -> Array:
    """dv/dx [nv, k] at the tick, for x = q, v, or a run-time value of an item; see :meth:`wbc.Step.derivative`.

        H dv + C_S' dlam = -(dH v + dg + dC_S' lam),      C_S dv = db_S - dC_S v

    for the rows S that hold v. What stands on the right are central differences of the QP's numbers, which are smooth
    where the solution's change of rows is not, those of H and g by :func:`~wbc.qp.sensitivity.force_between`. With
    strict levels they are differences of the levels, solved for the rows that push and the ranks of the tick. What
    bounds and margins keep a first command from, see docs/reach.md, moves with that command.

    Raises:
        UnknownNameError: no such item or value. SolverError: rows gave way, no optimum, or a rank that changes here.
    """
    moves, count = _moves(past, name, value)
    frozen = past.frozen()
    if frozen is not None:
        return _of_levels(past, frozen, moves, count)[: past.layout.nv]
    answer = past.solve()[1] if past.usable and not past.layout.cascade else None
    if answer is None or answer.flag != "solved":
        raise SolverError("derivative", name, "only a command for which every row holds has a derivative")
    return _of_one(past, answer, moves, count)[0][: past.layout.nv]


def _of_one(past: PastTick, answer: Relaxed, moves: Moves, count: int) -> tuple[Array, Array]:
    """Of one level, or of the first, and of its rows' multipliers."""
    wide, variables = past.tick.qp().with_slacks(), past.layout.variables
    n, size = wide.n, wide.lower.size
    sensitivity = Sensitivity(wide, QPSolution(answer.x, answer.multipliers, "solved"))
    upper = np.where(answer.multipliers > 0.0, 1.0, 0.0)
    force, offset, middle = np.zeros((n, count)), np.zeros((size, count)), _squares(past, wide)
    first = _first(past, moves, count)
    for k in range(count):
        found = [_moved(past, moves, k, by, first) for by in (_STEP, -_STEP)]
        ends, (up, down) = [qp for qp, _ in found], (squares for _, squares in found)
        A = _slope(ends, "A")
        force[:, k] = force_between(up, middle, down, answer.x) / (2.0 * _STEP) + A.T @ answer.multipliers[n:]
        with np.errstate(invalid="ignore"):
            ends_moved = np.where(upper > 0.0, _slope(ends, "upper"), _slope(ends, "lower"))
        offset[:, k] = np.nan_to_num(ends_moved) - np.concatenate((np.zeros(n), A @ answer.x))
    x, multipliers = sensitivity.changes(force, offset)
    return x[:variables], multipliers[n:]


def _of_levels(past: PastTick, frozen: Frozen, moves: Moves, count: int) -> Array:
    """With strict levels: differences of their optimum, the rows that push at each and its rank being what they are."""
    dofs = past.layout.dof_scales(past.stack)
    first, out = _of_one(past, frozen.first, moves, count)[0], np.zeros((past.layout.variables, count))
    before = _first(past, moves, count)
    for k in range(count):
        ends: list[Array] = []
        for by in (_STEP, -_STEP):
            state = past.tick.state.copy()
            _displace(past, moves, k, by, before)
            numbers = frozen.numbers(past.tick.qp(), frozen.first.x + by * first[:, k])
            past.tick.state[:] = state
            ends.append(frozen.optimum.at(numbers))
        out[:, k] = dofs * (ends[0] - ends[1]) / (2.0 * _STEP)
    return out


def _first(past: PastTick, moves: Moves, count: int) -> First | None:
    """The answer that bounds on velocities or margins held back; None where they did not."""
    held = past.tick.shortfall, past.tick.pressed
    before = [part.copy() for part in held]
    if not any(part.any() for part in before):
        return None
    for part in held:
        part[:] = 0.0
    wide, answer, found = past.tick.qp().with_slacks(), past.solve()[1], None
    if answer is not None and answer.flag == "solved":
        found = answer.x[: past.layout.variables], answer.multipliers[wide.n :], *_of_one(past, answer, moves, count)
    for part, value in zip(held, before, strict=True):
        part[:] = value
    return found


def _displace(past: PastTick, moves: Moves, k: int, by: float, first: First | None) -> None:
    tick, dt = past.tick, float(past.tick.dt[0])
    moves(k, by)
    if first is None:
        return
    tick.qp()
    x, multipliers, slope, turn = first
    rows, most = tick.task_rows(), np.abs(tick.report[past.places["error"]])
    left = np.clip(dt * (rows.J @ (x + by * slope[:, k]) - rows.desired), -most, most)
    tick.shortfall[:] = np.where(tick.shortfall != 0.0, left, 0.0)
    size = tick.pressed.size
    tick.pressed[:] = np.where(tick.pressed != 0.0, dt * (multipliers + by * turn[:, k])[:size], 0.0)


def _moved(past: PastTick, moves: Moves, k: int, by: float, first: First | None) -> tuple[QP, Squares]:
    """The QP of displaced inputs, and what it is made of."""
    state = past.tick.state.copy()
    _displace(past, moves, k, by, first)
    qp = past.tick.qp().with_slacks()
    squares = _squares(past, qp)
    past.tick.state[:] = state
    return qp, squares


def _squares(past: PastTick, qp: QP) -> Squares:
    """What the QP of the buffers, assembled last, is made of; slacks have no rows."""
    rows, first = past.tick.task_rows(), slice(past.layout.leading)
    J = np.zeros((past.layout.leading, qp.n))
    J[:, : past.layout.variables] = rows.J[first]
    return Squares(qp.H, qp.g, J, (past.tick.weight * rows.factor)[first], rows.desired[first])


def _slope(ends: list[QP], part: str) -> Array:
    return np.asarray((getattr(ends[0], part) - getattr(ends[1], part)) / (2.0 * _STEP))


def _moves(past: PastTick, name: str, value: str | None) -> tuple[Moves, int]:
    """What displaces the k-th entry of a value by a small number, and how many entries there are."""
    tick, model, nv = past.tick, past.stack.robot.model, past.layout.nv

    def move_q(k: int, by: float) -> None:
        tick.q[:] = pin.integrate(model, tick.q, by * np.eye(nv)[k])

    def move_v(k: int, by: float) -> None:
        tick.v_last[k] += by

    if value is None:
        own = {"q": move_q, "v": move_v}
        return own[validation.one_of("derivative", name, own)], nv
    block = past.layout.blocks[validation.one_of("derivative", name, past.layout.blocks)]
    names = (*block.slots, "weight") if block.form == "task" else tuple(block.slots)
    if validation.one_of(f"derivative.{name}", value, names) == "weight":
        return _weight(past, block), 1
    return _input(past, block.slots[value])


def _weight(past: PastTick, block: Block) -> Moves:
    """The item's weight, by its logarithm: d/d(ln w)."""

    def move(k: int, by: float) -> None:
        past.tick.weight[block.span] *= np.exp(by)

    return move


def _input(past: PastTick, slot: Slot) -> tuple[Moves, int]:
    """An input along its tangent space: poses by a twist (linear; angular) in the axes that they are given in."""
    numbers, kind = past.tick.p[slot.span], slot.input.kind

    def move(k: int, by: float) -> None:
        numbers[k] += by

    def turn(k: int, by: float) -> None:
        rotation = numbers[:9].reshape(3, 3, order="F")
        numbers[:9] = (pin.exp3(by * np.eye(3)[k]) @ rotation).ravel(order="F")

    def move_pose(k: int, by: float) -> None:
        if k < 3:
            numbers[9 + k] += by
        else:
            turn(k - 3, by)

    def along(k: int, by: float) -> None:
        model = past.stack.robot.model
        numbers[:] = pin.integrate(model, numbers.copy(), by * np.eye(model.nv)[k])

    if kind == "configuration":
        return along, past.layout.nv
    return {"pose": (move_pose, 6), "rotation": (turn, 3)}.get(kind, (move, slot.size))
