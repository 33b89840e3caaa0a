"""The search of ``native/converge.h`` in Python: for the virtual machine, and for items whose rows are measured."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from time import perf_counter

import numpy as np

from wbc.ik.search import EXHAUSTED, FOUND, OUT_OF_TIME, REFUSED, Query, SearchResult
from wbc.multibody import pin
from wbc.qp.problem import QP
from wbc.stack.codegen import row_units
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.tick.native import CompiledTick
from wbc.tick.solved import SolvedTick
from wbc.validation import Array

#: The constants from here to SEEKING are those of ``native/converge.h``: longest step of a descent [s of the rates]
STRIDE = 1.0
#: Longest step while the stack settles [s of the rates]
SHORT_STRIDE = 0.2
#: Damping of a step, per cost of the goals that are left
EASE = 0.03
#: Steps in a row without progress that end a descent
PATIENCE = 3
#: Factor by which the cost has to fall for a step to be progress
PROGRESS = 0.8
#: Steps of a descent at most
DESCENT = 60
#: Steps of settling at most
SETTLING = 200
#: A robot whose fastest degree of freedom is slower than this has settled [rad/s, characteristic lengths per second]
AT_REST = 1e-7
#: Share of the cost that a step of settling has to gain for another to follow
GAINED = 1e-9
#: Ticks by which goals are brought back after a step of settling
RETURNS = 5
#: Part of the tolerances to which they are brought back
CLOSELY = 0.01
#: Part of the time that the search for the goals may take; the rest is for settling
SEEKING = 0.9


class DescentSearch:
    """The search on the buffers of an assembly; ``sense`` measures what items want measured at the tick's q."""

    def __init__(self, assembly: CompiledTick, stack: Declaration, layout: Layout, sense: Callable[[], None]) -> None:
        self._assembly, self._sense = assembly, sense
        self._tick = SolvedTick(assembly, stack, layout, "daqp")
        self._model, self._rows = stack.robot.model, layout.task_rows
        self._places = Memory(layout)
        self._dofs = layout.dof_scales(stack)
        self._units = np.concatenate([self._dofs, np.array(row_units(stack, layout))])
        self._best, self._cost, self._ticks = assembly.q.copy(), np.inf, 0

    @np.errstate(over="ignore", invalid="ignore")
    def run(self, query: Query, seconds: float) -> SearchResult:
        """Search from the tick's q, where the answer then is, for some seconds."""
        begin, tick = perf_counter(), self._tick
        self._cost, self._ticks, descents = np.inf, 0, 0
        if tick.check():
            return SearchResult(REFUSED, 0, 0, perf_counter() - begin, np.inf)
        first, weight = tick.q.copy(), tick.weight.copy()
        self._best, ending = first, EXHAUSTED
        tick.weight[:] = query.seeking
        self._assembly.plain[0] = 1.0
        for start in itertools.chain((None,), query.starts):
            if start is not None:
                tick.q[:] = np.where(query.chosen != 0.0, start, first)
            ending = self._descend(query, begin + SEEKING * seconds)
            if ending == OUT_OF_TIME:
                break
            descents += 1
            if ending == FOUND:
                break
        if ending != FOUND and self._cost < np.inf:
            ending = self._settle(query, ending, begin + seconds)
        if ending == FOUND and query.secondary:
            ending = self._settle(query, ending, begin + seconds)
        self._assembly.plain[0] = 0.0
        tick.q[:], tick.weight[:] = self._best, weight
        tick.reset()
        return SearchResult(ending, self._ticks, descents, perf_counter() - begin, self._cost)

    def _descend(self, query: Query, end: float) -> int:
        least, idle = np.inf, 0
        self._tick.reset()
        for _ in range(DESCENT):
            if perf_counter() >= end:
                return OUT_OF_TIME
            qp = self._qp()
            cost, met = self._squares(query)
            if not (self._assembly.usable and cost < np.inf):
                return EXHAUSTED
            allowed = self._may_rest(qp, query.room)
            if allowed and cost < self._cost:
                self._cost, self._best = cost, self._tick.q.copy()
            if met and allowed:
                return FOUND
            if cost < PROGRESS * least:
                least, idle = cost, 0
            else:
                idle += 1
                if idle > PATIENCE:
                    return EXHAUSTED
            self._step(qp, EASE * cost, STRIDE)
            self._move_on()
        return EXHAUSTED

    def _corrected(self, query: Query, found: bool, end: float) -> tuple[float, bool]:
        """Cost of the goals or, where they were found, of the secondary tasks, after ticks that bring the goals back;
        and whether the goals are met.
        """
        self._assembly.plain[0] = 1.0
        self._tick.weight[:] = query.seeking
        for _ in range(RETURNS):
            if perf_counter() >= end:
                break
            qp = self._qp()
            if not self._assembly.usable:
                break
            cost, met = self._squares(query, share=CLOSELY if found else 1.0)
            if self._may_rest(qp, query.room) and (met or not found):
                return (self._squares(query, secondary=True)[0] if found else cost), met
            self._step(qp, 0.0, SHORT_STRIDE)
            self._move_on()
        return np.inf, False

    def _settle(self, query: Query, ending: int, end: float) -> int:
        """On to where the stack rests; strides that bring nothing are taken back and shortened."""
        found, stride, tick = ending == FOUND, SHORT_STRIDE, self._tick
        tick.q[:] = self._best
        least, _ = self._corrected(query, found, end)
        for _ in range(SETTLING):
            if perf_counter() >= end or least == np.inf:
                break
            self._assembly.plain[0] = 0.0
            tick.reset()
            tick.q[:], tick.weight[:] = self._best, query.settling if found else query.seeking
            self._step(self._qp(), 0.0, stride)
            largest = float(np.abs(self._v() / self._dofs).max(initial=0.0))
            if largest <= AT_REST:
                break
            self._move_on()
            cost, met = self._corrected(query, found, end)
            if cost < least:
                enough, least = least - cost <= GAINED * least, cost
                self._best, stride = tick.q.copy(), min(2.0 * stride, SHORT_STRIDE)
                if not found:
                    self._cost = cost
                    if met:
                        return FOUND
                if enough:
                    break
            else:
                stride = 0.25 * min(stride, largest)
                if stride <= AT_REST:
                    break
        return ending

    def _qp(self) -> QP:
        self._sense()
        self._ticks += 1
        return self._assembly.qp()

    def _squares(self, query: Query, *, secondary: bool = False, share: float = 1.0) -> tuple[float, bool]:
        """Weighted square of the errors of goals or secondary tasks; whether all are within a share of tolerance."""
        weight = query.settling if secondary else query.seeking
        error = self._tick.report[self._places["error"]]
        those = ((query.tolerance < 0.0) == secondary) & (weight != 0.0)
        size = np.abs(error[those])
        return float(weight[those] @ size**2), bool((size <= share * query.tolerance[those]).all())

    def _may_rest(self, qp: QP, room: float) -> bool:
        """Whether standing still keeps all rows and bounds."""
        return bool((qp.lower <= room * self._units).all() and (qp.upper >= -room * self._units).all())

    def _step(self, qp: QP, damped: float, stride: float) -> None:
        """Solve the QP, damped and within a stride."""
        nv, most = len(self._dofs), stride * self._dofs
        qp.H[np.diag_indices(nv)] += damped / self._dofs**2
        qp.lower[:nv] = np.clip(qp.lower[:nv], -most, most)
        qp.upper[:nv] = np.clip(qp.upper[:nv], -most, most)
        self._tick.finish(qp)

    def _v(self) -> Array:
        return self._tick.report[self._places["v"]]

    def _move_on(self) -> None:
        self._tick.q[:] = pin.integrate(self._model, self._tick.q, self._v())
