"""A tick whose QP is solved by a Python-level solver: the virtual machine, or another solver than the native one."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from wbc.controller.report import BRAKED, INFINITE, RELAXED, SOLVED, ReportLayout
from wbc.qp.certificate import certify
from wbc.qp.problem import QP, Solution
from wbc.qp.relax import Relaxation
from wbc.qp.solvers import make_solver
from wbc.stack.codegen import row_orders, row_units
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.validation import Array


class Assembly(Protocol):
    """Buffers and the QP at their values."""

    q: Array
    v_last: Array
    v_in: Array
    use_v: Array
    p: Array
    dt: Array
    weight: Array
    enabled: Array
    bound_enabled: Array
    report: Array

    def check(self) -> int:
        """0, or the flag of refused inputs."""

    def qp(self) -> QP:
        """The QP."""

    def look_ahead(self) -> None:
        """Margins after the step."""


class SolvedTick:
    """Assembly, then a kept solver with its relaxation, then the certificate; see ``native/tick.c``."""

    def __init__(self, assembly: Assembly, stack: Declaration, layout: Layout, solver: str) -> None:
        self._assembly = assembly
        for name in ("q", "v_last", "v_in", "use_v", "p", "dt", "weight", "enabled", "bound_enabled", "report"):
            setattr(self, name, getattr(assembly, name))
        self._nv = layout.nv
        self._places = ReportLayout(layout)
        self._solver = make_solver(solver, layout.nv, layout.general_rows)
        self._relaxation = Relaxation(layout.nv, layout.general_rows, self._solver)
        self._orders = np.array(row_orders(layout), dtype=np.int_)
        self._units = np.array(row_units(stack, layout), dtype=np.float64)

    q: Array
    v_last: Array
    v_in: Array
    use_v: Array
    p: Array
    dt: Array
    weight: Array
    enabled: Array
    bound_enabled: Array
    report: Array

    def reset(self) -> None:
        self._solver.reset()

    def qp(self) -> QP:
        return self._assembly.qp()

    def step(self) -> int:
        refused = self._assembly.check()
        if refused:
            return refused
        qp = self._assembly.qp()
        answer = self._relaxation.solve(qp, self._orders, self._units)
        flag = {"solved": SOLVED, "relaxed": RELAXED}.get(answer.flag, BRAKED)
        n, places, report = self._nv, self._places, self.report
        v = answer.x
        if flag == BRAKED:
            with np.errstate(invalid="ignore"):
                v = np.clip(0.0, qp.lower[:n], qp.upper[:n])
            v = np.where(np.isfinite(v), v, 0.0)
        multipliers = answer.multipliers if flag != BRAKED else np.zeros(qp.lower.size)
        final = qp
        if flag == RELAXED:
            final = qp.copy()
            final.lower[n:] -= answer.slack
            final.upper[n:] += answer.slack
        certificate = certify(final, Solution(v, multipliers, "solved"))
        bound = certificate.error_bound if flag != BRAKED and np.isfinite(certificate.error_bound) else INFINITE
        report[places["v"]] = v
        report[places["flag"]] = flag
        report[places["iterations"]] = answer.iterations
        report[places["stationarity"]] = certificate.stationarity
        report[places["violation"]] = certificate.violation
        report[places["complementarity"]] = certificate.complementarity
        report[places["error_bound"]] = bound
        report[places["multipliers"]] = multipliers
        report[places["slack"]] = np.where(answer.relaxed, answer.slack, 0.0)
        self._assembly.look_ahead()
        self.v_last[:] = v
        return flag
