"""QP solvers on one set of problems, by conditioning, and with equality rows that nearly depend on each other."""

from __future__ import annotations

import numpy as np

from bench.conditioning import sheet as by_conditioning
from bench.qp.samples import whole_body
from bench.qp.survey import survey
from bench.sheet import Sheet
from wbc.qp import QP, make_solver
from wbc.qp.solvers import available_solvers

#: Problems of each kind, states of each weight
PROBLEMS, STATES = 40, 60
DISTANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


def parts() -> dict[str, Sheet | str]:
    """Three tables."""
    return {"survey": surveyed(), "conditioning": by_conditioning(STATES), "equalities": equalities()}


def surveyed() -> Sheet:
    """Every solver on 48 feasible and 40 infeasible problems."""
    columns = ("solver", "solved", "largest error [rad/s]", "median", "largest bound", "> 1e-6", "infeasible refused",
               "median us")  # fmt: skip
    rows = []
    for f in survey(available_solvers(experimental=True)):
        numbers = (f"{f.solved} of {f.problems}", f"{f.error[0]:.1e}", f"{f.error[1]:.1e}", f"{f.bound:.1e}",
                   str(f.wrong), f"{f.refused} of {f.infeasible}", f"{f.microseconds:.0f}")  # fmt: skip
        rows.append((f.solver, *([f.note, *[""] * 6] if f.note else numbers)))
    return Sheet("", columns, rows)


def equalities() -> Sheet:
    """Feasible problems with six equality rows, one of them at a relative distance from the span of the others."""
    rows = []
    for n, tasks in ((7, 3), (38, 27)):
        for weight in (1.0, 1e-4, 1e-8):
            refused = [refusals(n, tasks, weight, distance, prepared=False) for distance in DISTANCES]
            prepared = sum(refusals(n, tasks, weight, distance, prepared=True) for distance in DISTANCES)
            rows.append((f"{n}, {weight:.0e}", *map(str, refused), str(prepared)))
    columns = ("n, posture weight", *(f"{d:.0e}" for d in DISTANCES), "any of these, prepared")
    return Sheet("", columns, rows)


def refusals(n: int, tasks: int, weight: float, distance: float, prepared: bool) -> int:
    """How many of these DAQP calls infeasible."""
    rng, count = np.random.default_rng(0), 0
    for _ in range(PROBLEMS):
        qp = whole_body(rng, n, tasks, 6, 0, weight)
        inside = 0.5 * (qp.lower[:n] + qp.upper[:n])
        mixed = rng.normal(size=5) @ qp.A[:5]
        aside = rng.normal(size=n)
        aside -= qp.A[:5].T @ np.linalg.lstsq(qp.A[:5].T, aside, rcond=None)[0]
        A = qp.A.copy()
        A[5] = mixed + distance * np.linalg.norm(mixed) / np.linalg.norm(aside) * aside
        at = A @ inside
        bounds = [np.concatenate((side[:n], at)) for side in (qp.lower, qp.upper)]
        close = QP(qp.H, qp.g, bounds[0], bounds[1], A)
        count += make_solver("daqp", n, 6, prepared=prepared).solve(close, warm=False).flag == "infeasible"
    return count
