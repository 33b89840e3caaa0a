"""The table of plans in slices."""

from __future__ import annotations

import numpy as np

from bench.sheet import Sheet
from bench.walk.machine import Record

#: Processor times in ms, and what the clock says in brackets
COLUMNS = (
    "", "arrived", "first command", "99 %", "longest slice", "planned after, s", "longest tick while planning",
    "over 50 ms", "re-grasps", "whole plan's", "real time",
)  # fmt: skip


def planning_sheet(records: list[Record]) -> Sheet:
    """Times of first commands, slices and ticks."""
    title = "Plans in slices, a body is told to walk: ms of processor time (by the clock)"
    return Sheet(title, COLUMNS, [_row(r) for r in records])


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
