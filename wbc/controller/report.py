"""The flat report that every tick writes: names, order and places of its parts (as in ``native/tick.h``)."""

from __future__ import annotations

from functools import cached_property

from wbc.stack.layout import Layout

#: Flags of a tick
SOLVED, RELAXED, BRAKED, CAPPED = 0, 1, 2, 3
#: In the report in place of these: the first of the links of a chain that may have given the answer; braked at its end;
#: braked because the policy wants it
RECOVERED, CHAIN_BRAKED, POLICY_BRAKED = 4, 8, 9
#: Added to what a tick returns, not to what it reports: the certificate fails, or a solver has found no answer
UNSOUND = 4
#: Refusals: nothing was changed
BAD_Q, BAD_UNIT, BAD_V = -1, -2, -3

#: Stand-in for infinity in bounds and in the error bound of a tick without a certificate
INFINITE = 1e30

#: Violations up to this, in row units, are rounding; squared lengths of quaternions may be off by the other
#: (both as in ``native/settings.h``)
TOLERANCE, UNIT_TOLERANCE = 1e-9, 2.00001e-6

#: A certificate fails where a violation is above the first, or where both the bound on the error of v is above the
#: second (a length of the characteristic one counts as 1 rad) and the optimality conditions are off by more than the
#: third; as in ``native/settings.h``
SOUND, KNOWN, OPTIMAL = 1e-6, 1e-3, 1e-9

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
