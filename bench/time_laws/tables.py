"""Records of a run as tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from bench.sheet import Sheet
from tests.trajectory.random_motions import FAMILIES

Record = dict[str, Any]
Parts = dict[str, list[Record]]

#: Limits that are passed by less are kept: by ours, and by the raw libraries where a share of 1 % is forgiven
KEPT, NEARLY = 1.0 + 1e-6, 1.01

OF_RANDOM = {
    "default": "toppra, as it comes (automatic grid, spline output)",
    "constant": "toppra, 1001 points, ParametrizeConstAccel",
    "ours": "wbc time_optimal, with its certificate",
}
OF_TORQUES = {
    "default": "toppra, as it comes (Collocation, spline output)",
    "collocation": "toppra, Collocation, 201 points, ParametrizeConstAccel",
    "interpolation": "toppra, Interpolation, 201 points, ParametrizeConstAccel",
    "ours": "wbc time_optimal",
}


def sheets(parts: Parts) -> list[Sheet]:
    """The tables of those parts that were measured."""
    makers = {
        "random set": random_set, "small moves": small_moves, "torques": torques, "states": states, "ticks": ticks,
    }  # fmt: skip
    return [make(parts[name]) for name, make in makers.items() if parts.get(name)]


def median(values: Iterable[float]) -> float:
    """The median."""
    return float(np.median(list(values)))


def known(records: Iterable[Record], name: str, field: str) -> list[float]:
    """Numbers of a contender, without those of refusals."""
    return [r[name][field] for r in records if r[name][field] is not None]


def grouped(records: Iterable[Record], key: str) -> dict[Any, list[Record]]:
    """Records by one of their fields, in the order in which it comes."""
    out: dict[Any, list[Record]] = {}
    for record in records:
        out.setdefault(record[key], []).append(record)
    return out


def longer(records: Iterable[Record], name: str) -> list[float]:
    """Durations beside those of toppra at 6401 points, as shares."""
    return [r[name]["duration"] / r["reference"] - 1.0 for r in records if r[name]["duration"] and r["reference"]]


def random_set(records: list[Record]) -> Sheet:
    """Velocity and acceleration limits along random splines."""
    rows = []
    for number, some in grouped(records, "waypoints").items():
        for name, text in OF_RANDOM.items():
            ratios, over = known(some, name, "ratio"), longer(some, name)
            rows.append((
                f"{number} waypoints: {text}", f"{median(ratios):.6f}", f"{max(ratios):.6f}",
                _share(sum(r > NEARLY for r in ratios), len(some)),
                f"{_percent(median(over))} / {_percent(max(over))}",
                f"{median(known(some, name, 'ms')):.0f}",
            ))  # fmt: skip
    title = f"Laws of least time: 7 joints, random waypoints and limits ({_each(grouped(records, 'waypoints'))})"
    columns = ("", "exact ratio, median", "worst", "over by 1 %", "longer than toppra at 6401: median / worst", "ms")
    return Sheet(title, columns, rows)


def small_moves(records: list[Record]) -> Sheet:
    """Who returns laws for small moves, and which keep their limits."""
    rows = []
    for exponent, some in grouped(records, "exponent").items():
        raw, ours = known(some, "raw", "ratio"), known(some, "ours", "ratio")
        pairs = [(r["raw"]["duration"], r["ours"]["duration"]) for r in some if r["raw"]["duration"]]
        rows.append((
            f"1e-{exponent}", _share(len(raw), len(some)), _share(sum(r <= NEARLY for r in raw), len(some)),
            f"{median(a / b for a, b in pairs):.3f}" if pairs else "-", _share(sum(r <= KEPT for r in ours), len(some)),
        ))  # fmt: skip
    columns = (
        "size, rad",
        "toppra returns a law",
        "within 1.01 of limits",
        "its duration over ours",
        "wbc, within limits",
    )
    return Sheet("Small moves: two waypoints of 6 joints, toppra over s in [0, 1]", columns, rows)


def torques(records: list[Record]) -> Sheet:
    """Torque limits of random paths."""
    rows = []
    for name, text in OF_TORQUES.items():
        seen = known(records, name, "seen")
        if not seen:
            rows.append((text, "-", "-", "-", _share(len(records), len(records)), "-"))
            continue
        bound, both = known(records, name, "bound"), [r for r in records if r[name]["duration"]]
        over = [r[name]["duration"] / r["ours"]["duration"] for r in both]
        rows.append((
            text, f"{median(seen):.4f}", f"{max(seen):.4f}", f"{max(bound):.4f}",
            _share(len(records) - len(seen), len(records)), f"{median(known(records, name, 'ms')):.0f}",
            f"{median(over):.4f}",
        ))  # fmt: skip
    columns = ("", "ratio seen, median", "worst", "worst with bound", "refused", "ms", "duration over ours")
    return Sheet(f"Torque limits: UR5, 5 random waypoints ({len(records)} paths)", columns, rows)


def states(records: list[Record]) -> Sheet:
    """Random states and those near rest."""
    rows = []
    for family, some in grouped(sorted(records, key=lambda r: FAMILIES.index(r["family"])), "family").items():
        total, raw, ours = (sum(r[key] for r in some) for key in ("states", "raw", "ours"))
        worst = (f"{max(r[key] for r in some):.1e}" for key in ("excess", "off"))
        rows.append((family, f"{total}", f"{raw} ({_percent(raw / total)})", f"{ours}", *worst))
    titles = ("states", "ruckig raises", "wbc raises", "excess of limits", "error of states")
    columns = ("3 joints, synchronised in time", *titles)
    return Sheet("From state to state", columns, rows)


def ticks(records: list[Record]) -> Sheet:
    """The online filter."""
    rows = []
    for course, some in grouped(records, "course").items():
        spent = {name: np.concatenate([r[name] for r in some]) for name in ("raw", "ours")}
        count = len(spent["raw"])
        rows += [
            (f"{course}: {text}", f"{count}", *(f"{np.percentile(spent[name], p):.1f}" for p in (50, 99, 100)))
            for name, text in (("raw", "Ruckig.update, state as numpy"), ("ours", "wbc online, within position limits"))
        ]
    return Sheet("Online, 7 joints: microseconds of one tick", ("", "ticks", "median", "p99", "max"), rows)


def _each(groups: dict[Any, Sequence[Record]]) -> str:
    return ", ".join(f"{len(some)} of {key}" for key, some in groups.items())


def _share(part: int, whole: int) -> str:
    return f"{part}/{whole}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"
