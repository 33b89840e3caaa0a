"""The table of layouts, and their goals."""

from __future__ import annotations

from bench.goals import Goal
from bench.sheet import Sheet
from bench.walk.machine import Record

KINDS = ("possible", "impossible", "undecided")
COLUMNS = (
    "", *KINDS, "planned", "ways round", "refused", "with separating holds", "walked", "clean", "plan, s", "why"
)  # fmt: skip


def layout_goals(records: list[Record]) -> list[Goal]:
    """Possible layouts are planned, impossible ones refused with the holds that separate start and goal."""
    kinds = {kind: [r for r in records if r["verdict"] == kind] for kind in KINDS}
    walked = [r for r in records if "arrived" in r]
    wrong = [r for r in kinds["impossible"] if r["planned"] or not r["separating"]]
    goals = [
        Goal("possible layouts that are refused", sum(not r["planned"] for r in kinds["possible"]), 0, ""),
        Goal("impossible layouts that are planned, or refused without separating holds", len(wrong), 0, ""),
        Goal("part of the layouts that stay undecided", len(kinds["undecided"]) / len(records), 0.05, ""),
    ]
    if walked:
        bad = sum(not _clean(r) for r in walked)
        goals.append(Goal(f"layouts of {len(walked)} walked that do not arrive or violate a check", bad, 0, ""))
    return goals


def layout_sheet(records: list[Record]) -> Sheet:
    """Shares by what is removed, then every layout that is not simply possible and planned."""
    rows = [_share(f"all: {len(records)}", records)]
    for low in range(10, 60, 10):
        some = [r for r in records if low <= 100 * r["fraction"] < low + 10]
        if some:
            rows.append(_share(f"{low} to {low + 10} % removed: {len(some)}", some))
    for r in records:
        if r["verdict"] != "possible" or not r["planned"] or ("arrived" in r and not _clean(r)):
            place = f"{r['from'][0]},{r['from'][1]} to {r['to'][0]},{r['to'][1]}"
            holds = f" [{' '.join(r['separating'])}]" if r.get("separating") else ""
            text = r["reason"] + holds if not r["planned"] else "; ".join([r.get("end", ""), *r.get("violations", ())])
            name = f"seed {r['seed']}, {100 * r['fraction']:.0f} %, {place}"
            rows.append((*_share(name, [r], marks=True)[:-1], text))
    return Sheet("Layouts with holds removed at random", COLUMNS, rows)


def _share(name: str, some: list[Record], marks: bool = False) -> tuple[str, ...]:
    """Counts; of one layout marks."""
    refused, walked = [r for r in some if not r["planned"]], [r for r in some if "arrived" in r]
    counts = [sum(r["verdict"] == kind for r in some) for kind in KINDS]
    counts += [len(some) - len(refused), sum(bool(r.get("detour")) for r in some), len(refused)]
    counts += [sum(bool(r["separating"]) for r in refused), len(walked), sum(map(_clean, walked))]
    shown = ["x" if n else "" for n in counts] if marks else [str(n) for n in counts]
    return name, *shown, f"{sum(r['plan_s'] for r in some) / len(some):.1f}", ""


def _clean(record: Record) -> bool:
    return bool(record["arrived"] and not record["violations"])
