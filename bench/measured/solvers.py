"""QP solvers on one set of problems, each in its own process.

Some plugins of ``casadi.conic`` crash, hang, or call a wrong answer solved. A child process keeps that
from the caller, and the exact minimiser (:mod:`tests.judges.exact_qp`) tells the rest.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.sheet import Sheet
from tests.judges.exact_qp import reference
from tests.qp.samples import sample_set
from wbc.errors import WbcError
from wbc.qp.certificate import certify
from wbc.qp.problem import QP
from wbc.qp.solvers import available_solvers, make_solver
from wbc.qp.solvers.backend import Backend


def parts() -> dict[str, Sheet | str]:
    """Every solver that takes them on 48 feasible and 40 infeasible problems."""
    columns = ("solver", "solved", "largest error [rad/s]", "infeasible refused", "median us")
    rows = [
        (f["solver"], f"{f['solved']} of {f['problems']}", f"{f['error']:.1e}", f"{f['refused']} of {f['infeasible']}",
         f"{f['microseconds']:.0f}")
        for f in survey(available_solvers(experimental=True)) if "note" not in f
    ]  # fmt: skip
    return {"survey": Sheet("", columns, rows)}


def measure(name: str, count: int) -> dict[str, Any]:
    """What one solver does, in this process, with ``count`` problems of every size and weight.

    Largest |x - x*| [rad/s] and certified bound of those that it calls solved; infeasible problems that it does not
    call solved; median time of a call, preparation of equality rows included [us].
    """
    solvers: dict[tuple[int, int], tuple[Backend, Backend]] = {}
    errors, bounds, times = [], [], []
    problems = refused = infeasible = 0
    for _, qp in sample_set(count):
        key = (qp.n, qp.m)
        if key not in solvers:
            solvers[key] = make_solver(name, *key), make_solver("daqp", *key)
        solver, guess = solvers[key]
        problems += 1
        began = time.perf_counter()
        answer = solver.solve(qp)
        times.append(time.perf_counter() - began)
        if answer.solved:
            errors.append(float(np.abs(answer.x - reference(qp, guess.solve(qp)).x).max()))
            bounds.append(certify(qp, answer).error_bound)
        if qp.m:
            infeasible += 1
            refused += not solver.solve(_contradict(qp)).solved
    return {
        "solver": name, "problems": problems, "solved": len(errors), "error": max(errors, default=0.0),
        "bound": max(bounds, default=0.0), "refused": refused, "infeasible": infeasible,
        "microseconds": 1e6 * float(np.median(times)),
    }  # fmt: skip


def survey(names: Sequence[str], count: int = 2, timeout: float = 300.0) -> list[dict[str, Any]]:
    """:func:`measure` in a child process a solver; a crash, a hang and a missing plugin become a "note"."""
    found = []
    for name in names:
        command = [sys.executable, "-m", "bench.measured.solvers", name, str(count)]
        try:
            child = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
            end = f"ended with code {child.returncode}"
            found.append(
                {"solver": name, "note": end} if child.returncode else json.loads(child.stdout.splitlines()[-1])
            )
        except subprocess.TimeoutExpired:
            found.append({"solver": name, "note": f"not done after {timeout:g} s"})
    return found


def _contradict(qp: QP) -> QP:
    """The same problem with one row that its simple bounds cannot reach."""
    out = qp.copy()
    out.lower[-1], out.upper[-1] = 50.0, 60.0
    return out


if __name__ == "__main__":
    try:
        answered = measure(sys.argv[1], int(sys.argv[2]))
    except WbcError as error:
        answered = {"solver": sys.argv[1], "note": str(error)}
    print(json.dumps(answered))
