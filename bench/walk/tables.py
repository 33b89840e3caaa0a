"""The tables of a run, and the goals."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.goals import Goal
from bench.sheet import Sheet
from bench.walk.layout_tables import layout_goals, layout_sheet

Record = dict[str, Any]
Parts = dict[str, list[Record]]

WALK = ("arrived", "part of the speed", "re-grasps", "body, mm", "slip, mm", "tick, us", "99 %", "real time", "plan, s")


def sheets(parts: Parts) -> list[Sheet]:
    """A table a part."""
    makers = {
        "courses": _courses,
        "highest": _highest,
        "spins": _spins,
        "trenches": _trenches,
        "planning": _planning,
        "layouts": layout_sheet,
    }
    return [make(parts[name]) for name, make in makers.items() if parts.get(name)]


def goals(parts: Parts) -> list[Goal]:
    """All goals that the parts can speak of."""
    out = []
    if courses := parts.get("courses"):
        for speed in sorted({r["speed"] for r in courses}):
            kept = [r.get("kept", 0.0) if r["arrived"] else 0.0 for r in courses if r["speed"] == speed]
            text = f"courses of {len(kept)} on which 0.98 of {speed:g} in/s is not kept"
            out.append(Goal(text, sum(part < 0.98 for part in kept), 0, ""))
        done = [r for r in courses if r["arrived"]]
        if done:
            out.append(Goal("body off its command", max(r["body_mm"] for r in done), 2.0, "mm"))
            out.append(Goal("hands off their holds", max(r["slip_mm"] for r in done), 2.0, "mm"))
            out.append(Goal("99 % of ticks", max(r["tick_p99_us"] for r in done), 2000.0, "us"))
            out.append(
                Goal("one over real time, planned and simulated", max(1 / r["real_time"] for r in done), 0.05, "")
            )
    if spins := parts.get("spins"):
        out.append(Goal("spins that do not arrive", sum(not r["arrived"] for r in spins), 0, ""))
    if trenches := parts.get("trenches"):
        wanted = [r for r in trenches if r["trench"] in ("4 rows", "5 rows")]
        out.append(Goal("trenches of 4 and 5 rows that are not crossed", sum(not r["arrived"] for r in wanted), 0, ""))
    if planned := [r for r in parts.get("planning", ()) if r["arrived"]]:
        out += _planning_goals(planned)
    if layouts := parts.get("layouts"):
        out += layout_goals(layouts)
    return out


def _planning_goals(planned: list[Record]) -> list[Goal]:
    """Of walks that arrived; re-grasps and speeds of those whose whole plan is known."""
    firsts = [first for r in planned for first in r["first_ms"]]
    fastest = [r for r in planned if r["speed"] == max(r["speed"] for r in planned)]
    whole = [r for r in planned if r["whole"] is not None]
    more = sum(max(r["regrasps"] - r["whole"], 0) for r in whole)
    slower = sum(r["kept"] < 0.98 for r in whole if r["speed"] < 6.0)
    text = f"one over real time at {fastest[0]['speed']:g} in/s, with planner and log"
    return [
        Goal("first command of a new plan, median", float(np.median(firsts)), 50.0, "ms"),
        Goal("first command of a new plan, 99 %", float(np.percentile(firsts, 99)), 50.0, "ms"),
        Goal("longest tick, planning included", max(r["longest_ms"] for r in planned), 50.0, "ms"),
        Goal("99 % of ticks when all is planned", max(r["tick_p99_ms"] for r in planned), 2.0, "ms"),
        Goal("re-grasps of plans in slices more than in whole plans", more, 0, ""),
        Goal("plans in slices with which 0.98 of 3 or 4 in/s is not kept", slower, 0, ""),
        Goal(text, max(1 / r["real_time"] for r in fastest), 0.05, ""),
    ]


def _courses(records: list[Record]) -> Sheet:
    rows = [(f"{r['course']} at {r['speed']:g} in/s", *_walk(r)) for r in records]
    return Sheet("Courses of the source and their reverses", ("", *WALK), rows)


def _highest(records: list[Record]) -> Sheet:
    rows = [(r["course"], f"{r['speed']:.1f}", str(r.get("regrasps", "-")), r["above"]) for r in records]
    return Sheet("Highest speeds that are kept", ("", "in/s", "re-grasps", "above it"), rows)


def _spins(records: list[Record]) -> Sheet:
    rows = [(f"{r['turn']:g} rad/s, three turns", *_walk(r)) for r in records]
    return Sheet("Turning on the spot", ("", *WALK), rows)


def _trenches(records: list[Record]) -> Sheet:
    rows = [(r["trench"], r["verdict"], *_walk(r)) for r in records]
    return Sheet("Trenches at 1 in/s; the body may go lower, turn and go round", ("", "reference", *WALK), rows)


def _planning(records: list[Record]) -> Sheet:
    columns = (
        "",
        "arrived",
        "first command, ms",
        "99 %",
        "planned after, s",
        "ticks while planning, 99 %, ms",
        "longest",
        "over 50 ms",
        "ticks after, 99 %, ms",
        "re-grasps",
        "whole plan's",
        "part of the speed",
        "real time",
    )
    return Sheet("Plans in slices: a standing body is told to walk", columns, [_planned(r) for r in records])


def _planned(r: Record) -> tuple[str, ...]:
    name = f"{r['course']} at {r['speed']:g} in/s"
    return (
        name,
        "yes" if r["arrived"] else f"no: {r['reason']}",
        f"{np.median(r['first_ms']):.1f}",
        f"{np.percentile(r['first_ms'], 99):.1f}",
        f"{r['planned_s']:.2f}",
        f"{r['planning_p99_ms']:.1f}",
        f"{r['longest_ms']:.1f}",
        str(r["stalls"]),
        f"{r['tick_p99_ms']:.2f}",
        str(r["regrasps"]),
        "-" if r["whole"] is None else str(r["whole"]),
        f"{r['kept']:.3f}",
        f"{r['real_time']:.1f}",
    )


def _walk(r: Record) -> tuple[str, ...]:
    if "kept" not in r:
        return (f"no: {r['reason']}", *["-"] * 7, f"{r['plan_s']:.2f}")
    return (
        "yes" if r["arrived"] else f"no: {r['reason']}",
        f"{r['kept']:.3f}",
        str(r["regrasps"]),
        f"{r['body_mm']:.2f}",
        f"{r['slip_mm']:.3f}",
        f"{r['tick_us']:.0f}",
        f"{r['tick_p99_us']:.0f}",
        f"{r['real_time']:.1f}",
        f"{r['plan_s']:.2f}",
    )
