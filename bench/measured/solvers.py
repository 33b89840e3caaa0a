"""QP solvers on one set of problems."""

from __future__ import annotations

from bench.qp.survey import survey
from bench.sheet import Sheet
from wbc.qp.solvers import available_solvers


def parts() -> dict[str, Sheet | str]:
    """Every solver that takes them on 48 feasible and 40 infeasible problems."""
    columns = ("solver", "solved", "largest error [rad/s]", "infeasible refused", "median us")
    rows = [
        (
            f.solver,
            f"{f.solved} of {f.problems}",
            f"{f.error[0]:.1e}",
            f"{f.refused} of {f.infeasible}",
            f"{f.microseconds:.0f}",
        )
        for f in survey(available_solvers(experimental=True))
        if not f.note
    ]
    return {"survey": Sheet("", columns, rows)}
