"""Solvers behind ``casadi.conic``: qpoases, and others that are experimental.

One solver object is kept and called through its buffers. CasADi reports the verdict in the buffer's
statistics; an answer that the plugin does not call a success is never passed on.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import casadi as ca
import numpy as np

from wbc.errors import SolverError, UnknownNameError
from wbc.qp.problem import QP, Solution
from wbc.qp.solvers.backend import Backend, answer, refusal
from wbc.validation import Array

#: Plugins and their options. All but qpoases are experimental: docs/solvers.md lists their measured errors.
PLUGINS: dict[str, dict[str, Any]] = {
    "qpoases": {"printLevel": "none"},
    "proxqp": {"proxqp": {"eps_abs": 1e-9, "eps_rel": 0.0, "max_iter": 200}},
    "piqp": {"piqp": {"eps_abs": 1e-12, "eps_rel": 1e-13, "max_iter": 250}},
    "qrqp": {"print_iter": False, "print_header": False, "print_info": False},
    "ipqp": {"print_iter": False, "print_header": False, "print_info": False},
    "highs": {"highs": {"output_flag": False}},
    "superscs": {"superscs": {"verbose": 0, "eps": 1e-9}},
    "fatrop": {"fatrop": {"print_level": 0}},
    "hpipm": {},
}
EXPERIMENTAL = tuple(name for name in PLUGINS if name != "qpoases")

_INFEASIBLE = ("infeasib", "Infeasib", "INFEASIB")


@contextmanager
def quiet_stdout() -> Iterator[None]:
    """Send file descriptor 1, on which C libraries print, to the null device meanwhile, with all that others print."""
    sys.stdout.flush()
    try:
        saved = os.dup(1)
    except OSError:  # standard output is closed: nothing can be printed
        yield
        return
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 1)
        yield
    finally:
        os.dup2(saved, 1)
        os.close(saved)
        os.close(null)


class Conic(Backend):
    """A kept ``casadi.conic`` object with dense patterns.

    Raises:
        UnknownNameError: a plugin that is not in :data:`PLUGINS`.
        SolverError: the plugin is not in this CasADi, or cannot take problems of this form.
    """

    def __init__(self, n: int, m: int, plugin: str) -> None:
        super().__init__(n, m)
        if plugin not in PLUGINS:
            raise UnknownNameError("plugin", plugin, PLUGINS)
        if not ca.has_conic(plugin):
            raise SolverError("plugin", plugin, "this CasADi has no such plugin")
        self.name = plugin
        self._function = self._made()
        # FunctionBuffer keeps addresses, not references: these dictionaries keep the arrays alive
        self._in = {name: np.zeros(max(1, self._function.nnz_in(name))) for name in self._function.name_in()}
        self._out = {name: np.zeros(max(1, self._function.nnz_out(name))) for name in self._function.name_out()}
        self._in["lba"][:], self._in["uba"][:] = -np.inf, np.inf
        self._bind()

    def _made(self) -> ca.Function:
        n, m, plugin = self.n, self.m, self.name
        # without any row the qpOASES plugin ignored the bounds of one variable: one free row of zeros stands in
        patterns = {"h": ca.Sparsity.dense(n, n), "a": ca.Sparsity.dense(max(m, 1), n)}
        try:
            with quiet_stdout():
                return ca.conic("qp", plugin, patterns, {**PLUGINS[plugin], "error_on_fail": False})
        except RuntimeError as error:
            raise SolverError("plugin", plugin, str(error).strip().splitlines()[-1]) from error

    def reset(self) -> None:
        """Make the solver anew: a function hands memory objects out again that still know their last problem."""
        self._function = self._made()
        self._bind()

    def _bind(self) -> None:
        with quiet_stdout():  # qpOASES prints a banner whenever a solver object is made
            buffer: tuple[Any, Any] = self._function.buffer()
        self._buffer, self._call = buffer
        for i, name in enumerate(self._function.name_in()):
            self._buffer.set_arg(i, memoryview(cast("Any", self._in[name])))
        for i, name in enumerate(self._function.name_out()):
            self._buffer.set_res(i, memoryview(cast("Any", self._out[name])))
        for name in ("x0", "lam_x0", "lam_a0"):
            self._in[name][:] = 0.0
        self._fresh = True

    def _solve(self, qp: QP, warm: bool) -> Solution:
        self._load(qp)
        solution = None
        if warm and not self._fresh:
            solution = self._attempt(qp)
        if solution is None or not solution.solved:  # a refusal must not come from a bad start
            if not self._fresh:
                self.reset()
            solution = self._attempt(qp)
        return solution

    def _load(self, qp: QP) -> None:
        n, m = self.n, self.m
        self._in["h"][:] = qp.H.ravel()
        self._in["g"][:] = qp.g
        self._in["lbx"][:], self._in["ubx"][:] = qp.lower[:n], qp.upper[:n]
        if m:
            self._in["a"][:] = qp.A.ravel(order="F")
            self._in["lba"][:], self._in["uba"][:] = qp.lower[n:], qp.upper[n:]

    def _attempt(self, qp: QP) -> Solution:
        n, m = self.n, self.m
        for out in self._out.values():
            out[:] = np.nan
        self._fresh = False
        self._call()
        stats = self._buffer.stats()
        iterations = max(0, int(stats.get("iter_count", 0)))
        if not stats.get("success", False):
            self.reset()
            said = f"{stats.get('return_status', '')} {stats.get('unified_return_status', '')}"
            verdict = any(word in said for word in _INFEASIBLE)
            return refusal(qp, "infeasible" if verdict else "failed", iterations)
        multipliers = np.concatenate((self._out["lam_x"][:n], self._out["lam_a"][:m]))
        solution = answer(qp, self._out["x"].copy(), multipliers, iterations)
        self._remember(solution)
        return solution

    def _remember(self, solution: Solution) -> None:
        if not solution.solved:
            self.reset()
            return
        multipliers: Array = solution.multipliers
        self._in["x0"][:] = solution.x
        self._in["lam_x0"][:] = multipliers[: self.n]
        if self.m:
            self._in["lam_a0"][:] = multipliers[self.n :]
