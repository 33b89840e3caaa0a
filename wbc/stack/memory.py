"""The flat report that every tick writes: names, order and places of its parts (as in ``native/tick.h``)."""

from __future__ import annotations

from functools import cached_property

from wbc.stack.layout import Layout

#: What is reported of each level, and of the least velocity after them
LEVEL_NUMBERS = (
    "rank",
    "free",
    "singular",
    "damping",
    "disturbance",
    "stationarity",
    "complementarity",
    "error",
    "solved",
)


class ReportLayout:
    """Slices of the report of one layout."""

    def __init__(self, layout: Layout) -> None:
        nv, rows = layout.variables, layout.general_rows
        sizes = {
            "v": nv,
            "flag": 1,
            "iterations": 1,
            "stationarity": 1,
            "violation": 1,
            "complementarity": 1,
            "error_bound": 1,
            "error": layout.task_rows + 1,
            "factor": layout.task_rows + 1,
            "margin": layout.margin_rows + 1,
            "margin_factor": layout.margin_rows + 1,
            "ahead": layout.margin_rows + 1,
            "multipliers": nv + rows + 1,
            "slack": rows + 1,
            "owner_low": nv,
            "owner_high": nv,
        }
        if layout.cascade:
            sizes |= {
                "missed": layout.task_rows + 1,
                "share": layout.task_rows + 1,
                "dropped": rows + 1,
                "pushes": nv + rows + 1,
                "levels": len(LEVEL_NUMBERS) * (len(layout.levels) + 1),
            }
        padding = {"error": 1, "factor": 1, "margin": 1, "margin_factor": 1, "ahead": 1, "multipliers": 1, "slack": 1}
        padding |= {"missed": 1, "share": 1, "dropped": 1, "pushes": 1}
        self.slices: dict[str, slice] = {}
        start = 0
        for name, size in sizes.items():
            self.slices[name] = slice(start, start + size - padding.get(name, 0))
            start += size
        self.size = start

    def __getitem__(self, name: str) -> slice:
        return self.slices[name]

    @cached_property
    def flag(self) -> int:
        """Index of the flag."""
        return int(self.slices["flag"].start)
