"""The results as tables: in the terminal, and as Markdown for the README."""

from __future__ import annotations

from typing import Any

from bench import cycle_run as cycles
from bench.code import run as code
from bench.curve_report import NOTES, curve_readme, curve_sheets
from bench.deadlines import run as deadlines
from bench.sheet import Sheet

CALLS = """\
The call is `controller.step(q).v` for wbc, `solve_ik` and `integrate_inplace` for pink and mink, `update_kinematics` \
and `solve(True)` for placo. The peers move their own state within the call, because their kinematics are \
computed there; wbc computes them in `step` and leaves the state to its caller. All get the same description, targets, \
weights and limits, and correct an error within one tick. End error and clearance are of the path that each one took, \
by Pinocchio and Coal; `tests/bench` holds wbc's answers to exact solutions of a QP that Pinocchio and numpy build."""


def sheets(results: dict[str, Any]) -> list[Sheet]:
    """All tables of a run."""
    ticks = [*map(cycles.sheet, results.get("problems", {}).values()), *curve_sheets(results.get("curves", ()))]
    ticks += map(code.sheet, results.get("code", {}).values())
    return [sheet for sheet in (*ticks, deadlines.sheet(results.get("deadlines", {}))) if sheet.rows]


def export_page(results: dict[str, Any]) -> str:
    """The tables of docs/export.md: durations of an exported tick, and what a cap on iterations does."""
    ticked = [
        (row["what"], problem["title"].split(":")[0],
         *(f"{row['ns'][tail]:.0f}" for tail in ("median", "p99", "p99.9")),
         f"{row['counts']['instructions']:.0f}" if "instructions" in row["counts"] else "-")
        for problem in results["code"].values() for row in problem["rows"] if not row["what"].startswith("Python")
    ]  # fmt: skip
    one = Sheet("One tick", ("", "robot", "ns, median", "p99", "p99.9", "instructions"), ticked)
    return "\n\n".join([one.markdown(), deadlines.sheet(results.get("deadlines", {})).markdown()])


def notes(results: dict[str, Any]) -> list[str]:
    """What the reader must know to read the tables."""
    about, versions = results["machine"], results["versions"]
    listed = ", ".join(f"{name} {version}" for name, version in versions.items())
    return [
        f"{about['processor']}, Python {about['python']}; {about['cores']}; load {about['load']}.",
        listed + ".",
        CALLS,
        *((cycles.NOTE,) if results.get("problems") else ()),
        *(NOTES.split("\n\n") if results.get("curves") else ()),
        *((code.note(results["code"]),) if results.get("code") else ()),
        *((deadlines.NOTE,) if results.get("deadlines") else ()),
    ]


def readme(results: dict[str, Any]) -> str:
    """The README's table: medians of ticks of random problems of growing size."""
    lines = [*curve_readme(results["curves"]), "", "![Tick against size](docs/images/bench_curves.png)", ""]
    lines.append("What each call contains, end errors and clearances: [bench/results.md](bench/results.md).")
    return "\n".join(lines)
