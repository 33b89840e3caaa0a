"""The results as tables: in the terminal, and as Markdown for the README."""

from __future__ import annotations

from typing import Any

from bench.code import tables as code
from bench.curve_report import NOTES, curve_readme, curve_sheets
from bench.deadlines import run as deadlines
from bench.sheet import Sheet, us

#: Contender that ratios are taken to
OURS = "wbc"
TAILS = ("median", "p99", "p99.9", "max")

CALLS = """\
The call is `controller.step(q).v` for wbc, `solve_ik` and `integrate_inplace` for pink and mink, `update_kinematics` \
and `solve(True)` for placo. The three peers move their own state within the call, because their kinematics are \
computed there; wbc computes them in `step` and leaves the state to its caller. The whole cycle is targets, call and, \
for wbc, the next configuration: `controller.step(q, **targets)`, its `v` and `q_next`."""

TERMS = """\
All get the same description, targets, weights and limits, and correct an error within one tick. Obstacles: a barrier \
for each pair in pink, the collision limit in mink, self-collision with links fixed in the world in placo, whose \
constraint has no rate."""

ERRORS = """\
End error and clearance are of the path that each one took, by Pinocchio. Solver error: largest difference between \
the velocity returned and an exact solution of the QP that the package itself built; placo does not show its QP. With \
`calm=False` wbc's QP is the one that Pinocchio and numpy build from the problem, which `tests/bench` checks."""


def sheets(results: dict[str, Any]) -> list[Sheet]:
    """All tables of a run."""
    out = []
    for problem in results["problems"].values():
        out += [ticks(problem), answers(problem)]
    out += curve_sheets(results.get("curves", ()))
    return [*out, *code_sheets(results), startup(results["startup"])]


def code_sheets(results: dict[str, Any]) -> list[Sheet]:
    """The exported tick, and caps on iterations."""
    out = [code.sheet(measured) for measured in results.get("code", {}).values()]
    return out + [deadlines.sheet(name, course) for name, course in results.get("deadlines", {}).items()]


def code_notes(results: dict[str, Any]) -> list[str]:
    """What these two need."""
    out = [code.note(results["code"])] if results.get("code") else []
    return out + ([deadlines.NOTE] if results.get("deadlines") else [])


def export_page(results: dict[str, Any]) -> str:
    """The tables of docs/export.md: durations of an exported tick, and what a cap on iterations does."""
    ticked = [
        (row["what"], problem["title"].split(":")[0],
         *(f"{row['ns'][tail]:.0f}" for tail in ("median", "p99", "p99.9")),
         f"{row['counts']['instructions']:.0f}" if "instructions" in row["counts"] else "-")
        for problem in results["code"].values() for row in problem["rows"] if not row["what"].startswith("Python")
    ]  # fmt: skip
    capped = [
        (name, "none" if row["cap"] is None else str(row["cap"]),
         *(us(row["times"][tail]) for tail in ("p99", "p99.9")), us(row["least"]["max"]),
         f"{100.0 * row['shares'].get('capped', 0.0):.2f}", f"{1e3 * row['error']:.1f}")
        for name, course in results.get("deadlines", {}).items() for row in course["rows"]
    ]  # fmt: skip
    sheets = (
        Sheet("One tick", ("", "robot", "ns, median", "p99", "p99.9", "instructions"), ticked),
        Sheet(
            "A cap on iterations",
            ("robot", "cap", "us, p99", "p99.9", "longest, least of turns", "capped, %", "error, mm"),
            capped,
        ),
    )
    return "\n\n".join(sheet.markdown() for sheet in sheets if sheet.rows)


def ticks(problem: dict[str, Any]) -> Sheet:
    """Durations of the user's call."""
    ours = problem["contenders"][OURS]["durations"]["call"]["median"]
    rows = []
    for name, measured in problem["contenders"].items():
        durations = measured["durations"]
        ratio = "1" if name == OURS else f"{durations['call']['median'] / ours:.2f}"
        around = [us(durations[part]["median"]) for part in ("aim", "cycle")]
        rows.append((name, *_tails(durations["call"]), ratio, *around))
        if "native" in durations:
            rows.append(("  native call alone", *_tails(durations["native"]), "", "", ""))
    columns = ("one tick [us]", *TAILS, "x wbc", "set targets", "whole cycle")
    return Sheet(f"{problem['title']} ({problem['ticks']} ticks each)", columns, rows)


def answers(problem: dict[str, Any]) -> Sheet:
    """What the calls achieved."""
    rows = []
    for name, measured in problem["contenders"].items():
        found = measured["tracking"]
        rows.append((
            name, _scaled(found["position"], 1e3, ".3f"), _scaled(found["rotation"], 1e3, ".3f"),
            _scaled(found["clearance"], 1e3, ".2f"), _scaled(found["solver_error"], 1.0, ".0e"),
        ))  # fmt: skip
    columns = ("", "end error [mm]", "[mrad]", "least clearance [mm]", "solver error [rad/s]")
    return Sheet("The same job", columns, rows)


def startup(measured: dict[str, Any]) -> Sheet:
    """Import, compilation, memory."""
    rows = [(f"import {package}", f"{seconds:.3f} s") for package, seconds in measured["import"].items()]
    for name, spent in measured["compile"].items():
        for kind, label in (("first", "empty cache"), ("cached", "cached")):
            text = f"{spent[kind]:.3g} s ({spent[f'{kind} cpu']:.3g} s of processor time)"
            rows.append((f"{name}: stack.compile(), {label}", text))
    rows += [(f"memory of a Panda process, {n}", f"{peak / 1e6:.0f} MB") for n, peak in measured["memory"].items()]
    return Sheet("Before the first tick", ("", "measured"), rows)


def notes(results: dict[str, Any]) -> list[str]:
    """What the reader must know to read the tables."""
    about, versions = results["machine"], results["versions"]
    listed = ", ".join(f"{name} {version}" for name, version in versions.items())
    return [
        f"{about['processor']}, Python {about['python']}; {about['cores']}; load {about['load']}.",
        f"Garbage collector {about['garbage collector']}; {about['threads']}.",
        listed + ".",
        CALLS,
        TERMS,
        ERRORS,
        *(NOTES.split("\n\n") if results.get("curves") else ()),
        *code_notes(results),
    ]


def readme(results: dict[str, Any]) -> str:
    """The README's table: medians of ticks of random problems of growing size."""
    lines = [*curve_readme(results["curves"]), "", "![Tick against size](docs/images/bench_curves.png)", ""]
    lines.append("What each call contains, percentiles and compile times: [bench/results.md](bench/results.md).")
    return "\n".join(lines)


def _tails(durations: dict[str, float]) -> list[str]:
    return [us(durations[tail]) for tail in TAILS]


def _scaled(value: float | None, factor: float, style: str) -> str:
    return "-" if value is None else format(value * factor, style)
