"""The table of layouts, and their goals."""

from __future__ import annotations

from typing import Any

from bench.goals import Goal
from bench.sheet import Sheet

Record = dict[str, Any]


def layout_goals(records: list[Record]) -> list[Goal]:
    """Possible layouts are planned, impossible ones refused with the holds that separate start and goal."""
    kinds = {kind: [r for r in records if r["verdict"] == kind] for kind in ("possible", "impossible", "undecided")}
    walked = [r for r in records if "arrived" in r]
    wrong = [r for r in kinds["impossible"] if r["planned"] or not r["separating"]]
    goals = [
        Goal("possible layouts that are refused", sum(not r["planned"] for r in kinds["possible"]), 0, ""),
        Goal("impossible layouts that are planned, or refused without separating holds", len(wrong), 0, ""),
        Goal("part of the layouts that stay undecided", len(kinds["undecided"]) / len(records), 0.05, ""),
    ]
    if walked:
        bad = sum(not r["arrived"] or bool(r["violations"]) for r in walked)
        goals.append(Goal(f"layouts of {len(walked)} walked that do not arrive or violate a check", bad, 0, ""))
    return goals


def layout_sheet(records: list[Record]) -> Sheet:
    """Shares by what is removed, then every layout that is not simply possible and planned."""
    rows = []
    for low in range(10, 60, 10):
        some = [r for r in records if low <= 100 * r["fraction"] < low + 10]
        if some:
            count = [sum(r["verdict"] == kind for r in some) for kind in ("possible", "impossible", "undecided")]
            planned = [r for r in some if r["planned"]]
            took = sum(r["plan_s"] for r in some) / len(some)
            numbers = *map(str, count), str(len(planned)), str(sum(r["detour"] for r in planned)), f"{took:.1f}"
            rows.append((f"{low} to {low + 10} % removed: {len(some)}", *numbers, ""))
    for r in records:
        if r["verdict"] != "possible" or not r["planned"] or not r.get("arrived", True) or r.get("violations"):
            place = f"{r['from'][0]},{r['from'][1]} to {r['to'][0]},{r['to'][1]}"
            text = r["reason"] if not r["planned"] else "; ".join([r.get("end", ""), *r.get("violations", ())])
            marks = ["x" if r["verdict"] == kind else "" for kind in ("possible", "impossible", "undecided")]
            planned, detour = "x" if r["planned"] else "", "x" if r.get("detour") else ""
            name = f"seed {r['seed']}, {100 * r['fraction']:.0f} %, {place}"
            rows.append((name, *marks, planned, detour, f"{r['plan_s']:.1f}", text))
    columns = ("", "possible", "impossible", "undecided", "planned", "detours", "plan, s", "why")
    return Sheet("Layouts with holds removed at random", columns, rows)
