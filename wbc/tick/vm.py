"""Rows on CasADi's virtual machine, assembled by numpy: the same QP without a compiler."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from wbc.qp.problem import QP
from wbc.stack.codegen import bound_sequence, row_units, unit_groups
from wbc.stack.declaration import HIGHEST_PRICE, Declaration
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.stack.program import ROWS_OUTPUTS, TickProgram
from wbc.stack.tables import bent_rows
from wbc.tick.buffers import BAD_Q, BAD_UNIT, BAD_V, INFINITE, TOLERANCE, UNIT_TOLERANCE, Assembly, TaskRows
from wbc.tick.reach import DEAD, Reach
from wbc.validation import Array


class _Call:
    """A CasADi function bound once to flat arrays (kept alive here, as the buffer interface requires)."""

    def __init__(self, function: Any, arguments: list[Array], results: list[Array]) -> None:
        self._keep = (function, arguments, results)
        self._buffer, self.run = function.buffer()
        for i, array in enumerate(arguments):
            self._buffer.set_arg(i, memoryview(array.data))
        for i, array in enumerate(results):
            self._buffer.set_res(i, memoryview(array.data))


def _room(count: int) -> Array:
    """At least one number: the buffer interface takes no empty array."""
    return np.zeros(max(1, count))


class VmAssembly(Assembly):
    """Buffers of a controller and the QP at their values; mirrors ``native/assemble.h``."""

    def __init__(self, program: TickProgram, stack: Declaration, layout: Layout) -> None:
        nv, rows, tasks = layout.variables, layout.general_rows, layout.task_rows
        self._layout = layout
        self._given = (program, stack, layout)
        self.memory = memory = Memory(layout)
        self.state = np.zeros(memory.state)
        self.report = self.state[: memory.report]
        view = functools.partial(memory.view, self.state)
        self.q, self.p, self.dt, self.cap, self.plain = (view(name) for name in ("q", "p", "dt", "cap", "plain"))
        self.v_last, self.v_in, self.use_v = view("v_last"), view("v_in"), view("use_v")
        self._command, self._dofs = layout.command, layout.nv
        self._slewed, self._elastic = layout.slewed, layout.elastic
        if layout.command == "torque":
            self._torque = memory["torque"]
        if layout.command != "velocity":
            self.kept = view("kept")
            self.forget()
        self.weight, self.enabled, self.bound_enabled = view("weight"), view("enabled"), view("bound_enabled")
        # CasADi's buffers take no empty array: with the spare number
        self._q, self._v, self._p = self._wide("q"), self.v_last[: layout.nv], self._wide("p")
        self.weight[:], self.enabled[:], self.bound_enabled[:] = 1.0, 1.0, 1.0
        function = program.rows
        self._out = {n: _room(function.nnz_out(i)) for i, n in enumerate(ROWS_OUTPUTS)}
        arguments = [self._q, self._v, self._p, self.dt]
        self._rows = _Call(function, arguments, list(self._out.values()))
        self._ahead = None
        self._later, self._mean = _room(layout.margin_rows), _room(layout.nv)
        if program.ahead is not None:
            self._ahead = _Call(program.ahead, [self._q, self._mean, self._p, self.dt], [self._later])
        self._torques: _Call | None = None
        if program.torque is not None:
            given = [*arguments, self.report[memory["v"]], self._wide("enabled")]
            self._torques = _Call(program.torque, given, [self.report[memory["torque"]]])
        self._bent = np.array(bent_rows(layout, program), dtype=np.bool_)
        self.bend, self.curving, self.stopped = view("bend"), view("curving"), view("stopped")
        self.shortened, self._loss, self._assembled = view("shortened"), _room(rows), np.zeros(rows)
        self._lost: _Call | None = None
        if program.lost is not None:
            given = [self._q, self.report[memory["v"]][: layout.nv], self._p, self.dt]
            self._lost = _Call(program.lost, given, [self._loss])
        self._force = _room(tasks + rows)
        curved = stack.calm or self._bent.any()
        self._reach = Reach(stack, layout, program, self._curvature_of(program, arguments)) if curved else None
        self._calm = stack.calm
        jt, at = function.sparsity_out("jt"), function.sparsity_out("at")
        self._j_index = (np.repeat(np.arange(tasks), np.diff(jt.colind())), np.array(jt.row(), dtype=np.intp))
        self._a_index = (np.repeat(np.arange(rows), np.diff(at.colind())), np.array(at.row(), dtype=np.intp))
        self._J, self._A = np.zeros((tasks, nv)), np.zeros((rows, nv))
        self._damping = stack.damping / layout.dof_scales(stack) ** 2
        self._sequence = bound_sequence(layout)
        self._units = unit_groups(stack)
        self._dof_scales = layout.dof_scales(stack)
        self._q_good = self.q.copy()
        self._usable = True
        self._soft = np.array(layout.row_levels, dtype=np.int_) >= 0
        self._sides = np.zeros(rows), np.zeros(rows)
        self._price_at = np.array(layout.price_at, dtype=np.intp)
        self._priced = self._price_at >= 0
        self._row_units = np.array(row_units(stack, layout), dtype=np.float64)
        self._curvature: Array | None = None
        self._last = TaskRows(self._J, np.zeros(tasks), np.zeros(tasks))

    def _wide(self, name: str) -> Array:
        """A field of the state with its spare number, which no empty array lacks."""
        field = self.memory[name]
        return self.state[field.start : max(field.stop, field.start + 1)]

    def task_rows(self) -> TaskRows:
        return self._last

    def curvature(self) -> Array | None:
        return self._curvature

    def row_bounds(self) -> tuple[Array, Array]:
        return self._sides

    def _curvature_of(self, program: TickProgram, arguments: list[Array]) -> Callable[[Array], Array] | None:
        """Weights of the task rows, then of the general rows -> curvature, nv x nv."""
        if program.curvature is None:
            return None
        entries = _room(program.curvature.nnz_out(0))
        call = _Call(program.curvature, [*arguments, self._force], [entries])
        row, column = (np.array(i, dtype=np.intp) for i in program.curvature.sparsity_out(0).get_triplet())
        nv = self._layout.variables

        def curve(force: Array) -> Array:
            self._force[: len(force)] = force
            call.run()
            upper = np.zeros((nv, nv))
            upper[row, column] = entries[: len(row)]
            return upper + np.triu(upper, 1).T

        return curve

    def twin(self) -> VmAssembly:
        return VmAssembly(*self._given)

    def check(self) -> int:
        """Refuse bad inputs, or take over a measured velocity; 0 or a negative flag."""
        bad = 0
        if not np.isfinite(self.q).all():
            bad = BAD_Q
        elif any(abs(self.q[s : s + n] @ self.q[s : s + n] - 1.0) > UNIT_TOLERANCE for s, n in self._units):
            bad = BAD_UNIT
        elif self.use_v[0] and not np.isfinite(self.v_in).all():
            bad = BAD_V
        if not bad and self.use_v[0]:
            self.v_last[:] = self.v_in
        if not bad:
            self.p[self._slewed[0]] = self.kept[self._slewed[1]]
        self.use_v[0] = 0.0
        if bad:
            self.q[:] = self._q_good
        else:
            self.unbend()
            self._q_good[:] = self.q
        return bad

    @np.errstate(over="ignore", invalid="ignore")
    def qp(self) -> QP:
        """The QP at the present values; also writes errors, factors and margins to the report."""
        layout, out = self._layout, self._out
        self._rows.run()
        self._report_rows()
        self._J[self._j_index] = out["jt"][: len(self._j_index[0])]
        self._A[self._a_index] = out["at"][: len(self._a_index[0])]
        factor, desired = out["factor"][: layout.task_rows].copy(), out["desired"][: layout.task_rows].copy()
        J = self._J.copy()
        self._usable = self._drop_idle_rows(J, desired, factor)
        self.report[self.memory["factor"]] = factor
        self._last = TaskRows(J, desired, factor)
        first = slice(layout.leading)
        J, weight, desired = J[first], (self.weight * factor)[first], desired[first]
        weighted = weight[:, None] * J
        H = J.T @ weighted
        H = 0.5 * (H + H.T)
        H[np.diag_indices(layout.variables)] += self._damping
        g = -weighted.T @ desired
        error = out["error"][first]
        low, high = self._bounds()
        price = np.where(self._priced, np.minimum(self.p[self._price_at], HIGHEST_PRICE), 1.0)
        on = (self.enabled != 0.0) & (price > 0.0)
        A = np.where(on[:, None], self._A, 0.0)
        if self._reach is not None and self._calm:
            bounds, margin = out["low"][: layout.general_rows], out["margin"][: layout.margin_rows]
            self._reach.brake_for_margins(self._A, bounds, margin, self.p, float(self.dt[0]), self.bound_enabled)
        low_rows = np.where(on, out["low"][: layout.general_rows], -np.inf)
        high_rows = np.where(on, out["high"][: layout.general_rows], np.inf)
        bend = np.where(self._bent, self.bend, 0.0)
        low_rows, high_rows, self._assembled = low_rows + bend, high_rows + bend, bend
        self._usable &= bool(np.isfinite(A).all() and (low_rows < INFINITE).all() and (high_rows > -INFINITE).all())
        low_rows[low_rows <= -INFINITE], high_rows[high_rows >= INFINITE] = -np.inf, np.inf
        self._sides = low_rows, high_rows
        low_rows, high_rows = np.where(self._soft, -np.inf, low_rows), np.where(self._soft, np.inf, high_rows)
        self._curvature = None
        if (
            self._reach is not None
            and (self._calm or self.curving[0])
            and not self.plain[0]
            and self._usable
            and layout.leading
        ):
            equal = _unit_equalities(low, high, low_rows, high_rows, A, self._dof_scales)
            firm = self._reach.firm(A, self._sides[0] == self._sides[1], factor)
            given = self.q, self.p, equal, firm, self.bound_enabled, self.stopped
            H, g = self._reach.change(H, J, weight, error, desired, *given)
            self._curvature = self._reach.curvature
        H = H + np.diag(self.shortened / self._dof_scales**2) if self.shortened[0] else H
        give = np.where(price > 0.0, self._row_units**2 / np.where(price > 0.0, price, 1.0), 1.0)
        give = np.where(self._priced & ~self._soft, give, 0.0)
        return QP(H, g, np.concatenate((low, low_rows)), np.concatenate((high, high_rows)), A, give)

    def _report_rows(self) -> None:
        """Errors and margins into the report; no output is NaN."""
        layout, memory = self._layout, self.memory
        for name, size, instead in (
            ("error", layout.task_rows, np.inf),
            ("margin", layout.margin_rows, -np.inf),
            ("margin_factor", layout.margin_rows, 0.0),
        ):
            values = self._out[name][:size]
            self.report[memory[name]] = np.where(np.isnan(values), instead, values)

    def _drop_idle_rows(self, J: Array, desired: Array, factor: Array) -> bool:
        """Task rows without weight leave the problem, whatever their numbers are. False: others are not finite."""
        bad = ~(np.isfinite(J).all(axis=1) & np.isfinite(desired) & np.isfinite(factor))
        J[bad], desired[bad], factor[bad] = 0.0, 0.0, 0.0
        return not bool((bad & (self.weight != 0.0)).any())

    def _bounds(self) -> tuple[Array, Array]:
        """Bound blocks in the order of sacrifice, a later one clipped into what the earlier ones left."""
        nv = self._layout.variables
        low, high = np.full(nv, -np.inf), np.full(nv, np.inf)
        owner_low, owner_high = (self.report[self.memory[n]] for n in ("owner_low", "owner_high"))
        owner_low[:] = owner_high[:] = -1.0
        for b in self._sequence:
            part = slice(b * nv, (b + 1) * nv)
            first, last = self._out["bound_low"][part], self._out["bound_high"][part]
            with np.errstate(invalid="ignore"):
                rounding = (first > last) & (first - last <= TOLERANCE * self._dof_scales)
                middle = 0.5 * (first + last)
            first, last = np.where(rounding, middle, first), np.where(rounding, middle, last)
            on = self.bound_enabled[part] != 0.0
            interval = (first <= last) & (first < INFINITE) & (last > -INFINITE)
            self._usable &= bool((interval | ~on).all())
            on &= interval
            new_low = np.where(on, np.clip(first, low, high), low)
            new_high = np.where(on, np.clip(last, low, high), high)
            owner_low[new_low > low] = b
            owner_high[new_high < high] = b
            low, high = new_low, new_high
        return low, high

    @property
    def usable(self) -> bool:
        """Numbers of the last QP are finite and every simple bound leaves an interval."""
        return self._usable

    def look_ahead(self) -> None:
        """Margins at q (+) v dt, into the report."""
        if self._ahead is not None:
            nv = self._layout.nv
            self._mean[:] = self.report[self.memory["v"]][:nv]
            if self._layout.command != "velocity":
                # the mean velocity until the next tick
                self._mean[:] = self.v_last[:nv] + 0.5 * self.dt[0] * self._mean
            self._ahead.run()
            later = self._later[: self._layout.margin_rows]
            self.report[self.memory["ahead"]] = np.where(np.isnan(later), -np.inf, later)

    def find_lost(self, everything: bool) -> float:
        if self._lost is None:
            return 0.0
        self._lost.run()
        low, high = self._sides
        lost = self._loss[: self._layout.general_rows] + self.bend * self.dt[0]
        if everything:
            # the sides of the rows as they were assembled, and what has been added since
            lost = lost + (self._A @ self.report[self.memory["v"]] - low - self.bend + self._assembled) * self.dt[0]
        lost = np.where(self._bent & (low == high) & np.isfinite(lost), lost, 0.0)
        self.report[self.memory["lost"]] = lost
        return float(np.abs(lost / self._row_units).max(initial=0.0) / self.dt[0])

    def _find_torques(self) -> None:
        if self._torques is not None:
            self._torques.run()
            tau = self.report[self.memory["torque"]]
            tau[~np.isfinite(tau)] = 0.0


def _unit_equalities(low: Array, high: Array, low_rows: Array, high_rows: Array, A: Array, dofs: Array) -> Array:
    """Fixed variables and equality rows, of unit length in v / dofs; rows that v cannot move left out."""
    fixed = np.diag(1.0 / dofs)[low == high]
    rows = A[low_rows == high_rows]
    squares = np.einsum("ij,ij->i", rows * dofs, rows * dofs)
    return np.vstack((fixed, rows[squares > DEAD] / np.sqrt(squares[squares > DEAD])[:, None]))
