"""The table of plans in slices, and what is asked of them."""

from __future__ import annotations

import numpy as np

from bench.goals import Goal
from bench.sheet import Sheet
from bench.walk.machine import Record
from bench.walk.planning import STALL

#: Processor times in ms, and what the clock says in brackets
COLUMNS = (
    "", "arrived", "first command", "99 %", "longest slice", "planned after, s", "longest tick while planning",
    "over 50 ms", "re-grasps", "whole plan's", "real time",
)  # fmt: skip


def planning_sheet(records: list[Record]) -> Sheet:
    """Times of first commands, slices and ticks."""
    title = "Plans in slices, a body is told to walk: ms of processor time (by the clock)"
    return Sheet(title, COLUMNS, [_row(r) for r in records])


def planning_goals(records: list[Record]) -> list[Goal]:
    """First commands and stalls of all; re-grasps, speeds and real time of walks whose whole plan is known."""
    firsts, spent = ([first for r in records for first in r[key]] for key in ("first_ms", "first_cpu_ms"))
    walks = [r for r in records if "slices_ms" in r]
    whole = [r for r in walks if r["whole"] is not None and r["arrived"]]
    out = [
        Goal("first command of a new plan, median", float(np.median(firsts)), 1e3 * STALL, "ms"),
        Goal("first command of a new plan, 99 %", float(np.percentile(firsts, 99)), 1e3 * STALL, "ms"),
        Goal("the same, processor time, median", float(np.median(spent)), 1e3 * STALL, "ms"),
        Goal("the same, processor time, 99 %", float(np.percentile(spent, 99)), 1e3 * STALL, "ms"),
        Goal("longest tick, planning included", max(r["longest_ms"] for r in records), 1e3 * STALL, "ms"),
        Goal("the same, processor time", max(r["longest_cpu_ms"] for r in records), 1e3 * STALL, "ms"),
        Goal("plans in slices that lead nowhere", sum(not r["arrived"] for r in records), 0, ""),
    ]
    if walks:
        out.append(Goal("longest slice, processor time", max(max(r["slices_ms"]) for r in walks), 1e3 * STALL, "ms"))
    if whole:
        more = sum(max(r["regrasps"] - r["whole"], 0) for r in whole)
        slow = sum(r["kept"] < 0.98 for r in whole)
        out += [
            Goal("re-grasps of plans in slices more than in whole plans", more, 0, ""),
            Goal("plans in slices with which 0.98 of the speed is not kept", slow, 0, ""),
            Goal("one over real time, planner in slices and log", max(1 / r["real_time"] for r in whole), 0.05, ""),
        ]
    return out


def _row(r: Record) -> tuple[str, ...]:
    spent, firsts = r["first_cpu_ms"], r["first_ms"]
    pairs = zip(np.percentile(spent, [50, 99]), np.percentile(firsts, [50, 99]), strict=True)
    head = "yes" if r["arrived"] else f"no: {r['reason']}", *(f"{own:.1f} ({clock:.1f})" for own, clock in pairs)
    longest = f"{r['longest_cpu_ms']:.1f} ({r['longest_ms']:.1f})"
    ticks = longest, f"{r['stalls_cpu']} ({r['stalls']})"
    if "slices_ms" not in r:
        return (f"under way, {r['asked']} other rates", *head, *["-"] * 2, *ticks, *["-"] * 3)
    return (
        f"{r['course']} at {r['asked']:g} in/s",
        *head,
        f"{max(r['slices_ms']):.1f}",
        f"{r['planned_s']:.2f}",
        *ticks,
        str(r["regrasps"]),
        "-" if r["whole"] is None else str(r["whole"]),
        f"{r['real_time']:.1f}",
    )
