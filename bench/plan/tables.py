"""What planners made of the problems, as tables."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Any

import numpy as np

CONTENDERS = ("wbc", "ompl", "roboplan")


def table(rows: list[dict[str, Any]], contenders: Sequence[str]) -> str:
    """Solved, median time and median length by robot and scene, then of all."""
    heads = ("robot", "scene", "problems", *(f"{c}: solved, ms, length" for c in contenders))
    lines = [f"| {' | '.join(heads)} |", f"|{' --- |' * len(heads)}"]
    groups = {
        (r["robot"], r["scene"]): [x for x in rows if (x["robot"], x["scene"]) == (r["robot"], r["scene"])]
        for r in rows
    }
    for (robot, scene), some in [*groups.items(), (("all", ""), rows)]:
        cells = [robot, scene, str(len(some))]
        for name in contenders:
            good = [r[name] for r in some if r[name]["length"] is not None and not r[name]["fault"]]
            times = 1e3 * statistics.median(r[name]["seconds"] for r in some)
            lengths = statistics.median(r["length"] for r in good) if good else float("nan")
            broken = sum(bool(r[name]["fault"]) for r in some)
            cells.append(f"{len(good)}{f' ({broken} broken)' if broken else ''}, {times:.1f}, {lengths:.2f}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def ratios(rows: list[dict[str, Any]], peers: Sequence[str]) -> str:
    """What counts against the peers."""

    def fine(r: dict[str, Any], name: str) -> bool:
        return r[name]["length"] is not None and not r[name]["fault"]

    lines = []
    median = {c: statistics.median(r[c]["seconds"] for r in rows) for c in ("wbc", *peers)}
    for name in peers:
        both = [r for r in rows if fine(r, name) and fine(r, "wbc")]
        only = sum(fine(r, name) and not fine(r, "wbc") for r in rows)
        longer = statistics.median(r["wbc"]["length"] / r[name]["length"] for r in both) if both else float("nan")
        share = median["wbc"] / median[name]
        lines.append(f"{name}: {only} solved by it alone; time {share:.3f} of it; length {longer:.3f} of it")
    if all("search" in r[c] for r in rows if fine(r, "wbc") for c in ("wbc", *peers)):
        search = {c: statistics.median(r[c]["search"] for r in rows if "search" in r[c]) for c in ("wbc", *peers)}
        parts = ", ".join(f"{1e3 * search[c]:.2f} ms by {c}" for c in search)
        law = statistics.median(r["wbc"]["law"] for r in rows if "law" in r["wbc"])
        proven = f"a law with rounded corners, proven: {1e3 * law:.1f} ms"
        lines.append(f"search alone, without shortening: median {parts}; {proven}")
    best = []
    for r in rows:
        lengths = [r[name]["length"] for name in peers if fine(r, name)]
        if lengths and fine(r, "wbc"):
            best.append(r["wbc"]["length"] / min(lengths))
    if best:
        near = np.mean(np.array(best) <= 1.02)
        lines.append(f"length against the best peer: median {statistics.median(best):.3f}, {near:.0%} within 1.02")
    return "\n".join(lines)


def page(data: Any) -> str:
    """Table and ratios of a file that ``python -m bench.plan --write`` wrote."""
    rows = data["rows"]
    peers = tuple(name for name in CONTENDERS[1:] if name in rows[0])
    lines = "\n".join(f"* {line}" for line in ratios(rows, peers).splitlines() if peers)
    return f"{table(rows, ('wbc', *peers))}\n\n{lines}"
