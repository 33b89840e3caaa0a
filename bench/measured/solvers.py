"""QP solvers on one set of problems, each in its own process.

Some plugins of ``casadi.conic`` crash, hang, or call a wrong answer solved. A child process keeps that
from the caller, and the exact minimiser (:mod:`tests.judges.exact_qp`) tells the rest.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

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
        (f.solver, f"{f.solved} of {f.problems}", f"{f.error[0]:.1e}", f"{f.refused} of {f.infeasible}",
         f"{f.microseconds:.0f}")
        for f in survey(available_solvers(experimental=True)) if not f.note
    ]  # fmt: skip
    return {"survey": Sheet("", columns, rows)}


@dataclass(frozen=True)
class Finding:
    """What one solver did with the set.

    Attributes:
        solver: its name.
        problems: feasible problems given to it.
        solved: how many it called solved.
        error: largest and median |x - x*| of those, in rad/s.
        bound: largest certified bound of those.
        wrong: how many of those were off by more than 1e-6.
        refused: infeasible problems that it did not call solved, out of ``infeasible``.
        microseconds: median time of a call, preparation of equality rows included.
        note: how the process ended, if not well.
    """

    solver: str
    problems: int = 0
    solved: int = 0
    error: tuple[float, float] = (0.0, 0.0)
    bound: float = 0.0
    wrong: int = 0
    refused: int = 0
    infeasible: int = 0
    microseconds: float = 0.0
    note: str = ""


def measure(name: str, count: int) -> Finding:
    """Run one solver, in this process, on ``count`` problems of every size and weight."""
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
    return Finding(
        name,
        problems,
        len(errors),
        (max(errors, default=0.0), float(np.median(errors)) if errors else 0.0),
        max(bounds, default=0.0),
        sum(error > 1e-6 for error in errors),
        refused,
        infeasible,
        1e6 * float(np.median(times)),
    )


def survey(names: Sequence[str], count: int = 2, timeout: float = 300.0) -> list[Finding]:
    """One child process a solver; a crash, a hang and a missing plugin become notes."""
    found = []
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            result = Path(folder) / "finding.json"
            command = [sys.executable, "-m", "bench.measured.solvers", name, str(result), str(count)]
            try:
                child = subprocess.run(command, capture_output=True, timeout=timeout, check=False)
                end = f"ended with code {child.returncode}"
            except subprocess.TimeoutExpired:
                end = f"not done after {timeout:g} s"
            if result.exists():
                found.append(Finding(**json.loads(result.read_text())))
            else:
                found.append(Finding(name, note=end))
    return found


def _contradict(qp: QP) -> QP:
    """The same problem with one row that its simple bounds cannot reach."""
    out = qp.copy()
    out.lower[-1], out.upper[-1] = 50.0, 60.0
    return out


def _worker(name: str, result: Path, count: int) -> None:
    try:
        finding = measure(name, count)
    except WbcError as error:
        finding = Finding(name, note=str(error))
    result.write_text(json.dumps(asdict(finding)))


if __name__ == "__main__":
    _worker(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))
