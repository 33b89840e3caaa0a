"""How the commands of many robots move with what their ticks were given, in one pass of array code."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.qp.sensitivity import Squares, force_between
from wbc.tick.context import Context
from wbc.tick.native import NativeTick
from wbc.validation import Array

#: Displacement by which the QP's own numbers are differentiated, as for a single step
_STEP = 1e-6
#: Robots at a time
_CHUNK = 2048
#: What the multipliers' block of the system has on its diagonal, times the largest entry of H: rows that depend on
#: each other leave it regular, and a correction takes the error away
REGULAR = 1e-10

Moves = Callable[[Array, int, float], None]


class Derivatives:
    """dv/dx of ticks whose rows all hold, see :meth:`wbc.batch.BatchStep.derivative`.

        H dv + C_S' dlam = -(dH v + dg + dC_S' lam),      C_S dv = db_S - dC_S v

    for the rows S that hold v. The numbers' own derivatives are central differences in C, those of H and g by
    :func:`~wbc.qp.sensitivity.force_between`.

    Attributes:
        size: numbers of a QP, see :meth:`assembled`.
    """

    def __init__(self, tick: NativeTick, context: Context) -> None:
        self._tick, self._context = tick, context
        self._many = tick.library_function("wbc_tick_qp_many", None, unlocked=True)
        memory = context.memory
        self._base, self.size = memory["H"].start, memory["unusable"].start - memory["H"].start

    def twin(self) -> Derivatives:
        """Another one with a tick of its own, for another thread."""
        return Derivatives(self._tick.twin(), self._context)

    def find(self, name: str, value: str | None, reports: Array, inputs: Array) -> Array:
        """[n, nv, k] for reports and inputs of n robots, whose ticks are over.

        Raises:
            UnknownNameError: no such item or value.
        """
        moves, count = self._moves(name, value)
        out = np.empty((len(reports), self._context.nv, count))
        for start in range(0, len(reports), _CHUNK):
            part = slice(start, start + _CHUNK)
            out[part] = self._part(reports[part], inputs[part], moves, count)
        return out

    def _part(self, reports: Array, inputs: Array, moves: Moves, count: int) -> Array:
        memory, layout = self._context.memory, self._context.layout
        n, m = layout.variables, layout.general_rows
        before = inputs.copy()
        # Accelerations count from where the tick found them
        self._given(before, "v_last")[:] = self._given(before, "v_in")
        x, force = reports[:, memory["v"]], reports[:, memory["multipliers"]]
        middle, A, low, high = self.problems(before)
        H = middle.H
        holds = (force != 0.0) | (low == high)
        rows = np.concatenate([np.broadcast_to(np.eye(n), (len(x), n, n)), A], axis=1) * holds[:, :, None]
        diagonal = np.where(holds, -REGULAR / H.max(axis=(1, 2))[:, None], 1.0)
        right = np.zeros((len(x), 2 * n + m, count))
        for k in range(count):
            ends = []
            for by in (_STEP, -_STEP):
                moved = before.copy()
                moves(moved, k, by)
                ends.append(self.problems(moved))
            (up, *numbers), (down, *others) = ends
            pushed = force_between(up, middle, down, x) / (2.0 * _STEP)
            with np.errstate(invalid="ignore"):
                dA, dlow, dhigh = ((more - less) / (2.0 * _STEP) for more, less in zip(numbers, others, strict=True))
                side = np.nan_to_num(np.where(force > 0.0, dhigh, dlow), posinf=0.0, neginf=0.0)
            along = np.einsum("rij,rj->ri", dA, x)
            right[:, :n, k] = -(pushed + np.einsum("rij,ri->rj", dA, force[:, n:]))
            right[:, n:, k] = holds * (side - np.concatenate([np.zeros_like(x), along], axis=1))
        return _solved(H, rows, diagonal, right)[:, : self._context.nv]

    def _given(self, inputs: Array, name: str) -> Array:
        where, start = self._context.memory[name], self._context.memory.report
        return inputs[:, where.start - start : where.stop - start]

    def problems(self, inputs: Array) -> tuple[Squares, Array, Array, Array]:
        """What H and g are made of, A, lower and upper bounds of all."""
        layout, memory = self._context.layout, self._context.memory
        n, m, rows = layout.variables, layout.general_rows, layout.task_rows
        tasks = np.empty((len(inputs), rows * (n + 2)))
        found = self.assembled(inputs, tasks)
        H, g, A, low, high = (
            found[:, memory[name].start - self._base : memory[name].stop - self._base]
            for name in ("H", "g", "A", "low", "high")
        )
        upper = np.triu(H.reshape(len(found), n, -1)[:, :, :n])
        J, desired, weight = np.split(tasks, [rows * n, rows * (n + 1)], axis=1)
        whole = upper + np.triu(upper, 1).transpose(0, 2, 1)
        made = Squares(whole, g[:, :n], J.reshape(len(found), rows, n), weight, desired)
        return made, A.reshape(len(found), m, n), low, high

    def assembled(self, inputs: Array, tasks: Array | None = None) -> Array:
        """The QPs as C has them, a row a robot; J, desired rates and weights of task rows into ``tasks``."""
        given, found = np.ascontiguousarray(inputs), np.empty((len(inputs), self.size))
        places = (ctypes.c_void_p(0 if array is None else array.ctypes.data) for array in (given, found, tasks))
        self._many(self._tick.pointer, ctypes.c_longlong(len(given)), *places)
        return found

    def _moves(self, name: str, value: str | None) -> tuple[Moves, int]:
        """What displaces the k-th entry of a value of all robots, and how many entries there are."""
        layout, robot = self._context.layout, self._context.stack.robot

        def move_v(inputs: Array, k: int, by: float) -> None:
            self._given(inputs, "v_last")[:, k] += by

        if value is None:
            validation.one_of("derivative", name, ("q", "v"))
            if name == "v":
                return move_v, layout.nv
            return lambda inputs, k, by: _along(robot.model, self._given(inputs, "q"), k, by), layout.nv
        block = layout.blocks[validation.one_of("derivative", name, layout.blocks)]
        names = (*block.slots, "weight") if block.form == "task" else tuple(block.slots)
        if validation.one_of(f"derivative.{name}", value, names) == "weight":

            def move_weight(inputs: Array, k: int, by: float) -> None:
                self._given(inputs, "weight")[:, block.span] *= np.exp(by)

            return move_weight, 1
        slot = block.slots[value]

        def numbers(inputs: Array) -> Array:
            return self._given(inputs, "p")[:, slot.span]

        def move(inputs: Array, k: int, by: float) -> None:
            numbers(inputs)[:, k] += by

        def turn(inputs: Array, k: int, by: float) -> None:
            columns = numbers(inputs)[:, :9].reshape(-1, 3, 3)
            # Numbers are rotations by columns: rows of this array are columns of R
            numbers(inputs)[:, :9] = (columns @ pin.exp3(by * np.eye(3)[k]).T).reshape(-1, 9)

        def move_pose(inputs: Array, k: int, by: float) -> None:
            if k < 3:
                numbers(inputs)[:, 9 + k] += by
            else:
                turn(inputs, k - 3, by)

        def along(inputs: Array, k: int, by: float) -> None:
            _along(robot.model, numbers(inputs), k, by)

        if slot.input.kind == "configuration":
            return along, layout.nv
        return {"pose": (move_pose, 6), "rotation": (turn, 3)}.get(slot.input.kind, (move, slot.size))


def _along(model: pin.Model, q: Array, k: int, by: float) -> None:
    """q (+) by e_k of each row, in place."""
    if model.nq == model.nv:
        q[:, k] += by
        return
    step = by * np.eye(model.nv)[k]
    for row in q:
        row[:] = pin.integrate(model, row.copy(), step)


def _solved(H: Array, rows: Array, diagonal: Array, right: Array) -> Array:
    """The first part of the solutions of [[H, rows'], [rows, diag]] x = right, corrected for what keeps it regular."""
    n, m = H.shape[1], rows.shape[1]
    system = np.zeros((len(H), n + m, n + m))
    system[:, :n, :n], system[:, :n, n:], system[:, n:, :n] = H, rows.transpose(0, 2, 1), rows
    system[:, range(n, n + m), range(n, n + m)] = diagonal
    x = np.linalg.solve(system, right)
    system[:, range(n, n + m), range(n, n + m)] = np.where(diagonal == 1.0, 1.0, 0.0)
    rest = right - system @ x
    system[:, range(n, n + m), range(n, n + m)] = diagonal
    return np.asarray((x + np.linalg.solve(system, rest))[:, :n])
