"""Pairs of task and constraint coordinates: how good the best pair is, and what the adviser takes."""

from __future__ import annotations

import wbc.coordinates as coordinates
from bench.sheet import Sheet

#: Configurations of a survey, and pairs that the adviser's time is of
COUNT, TIMED = 5000, 5
ARMS = ("ssrms", "spdm_arm", "spdm")


def parts() -> dict[str, Sheet | str]:
    """The table."""
    rows = []
    for name in ARMS:
        robot, pairs = coordinates.parts(name).robot, coordinates.mode_pairs(name, "M1")
        found = coordinates.survey_pairs(robot, pairs, COUNT)
        shares = [f"{found.quantile(part):.3f}" for part in (0.01, 0.1, 0.5)]
        spent = 1e6 * coordinates.advice_time(coordinates.Adviser(robot, pairs[:TIMED], exact=False))
        rows.append(
            (name, f"{found.ratios[found.worst]:.3f}", *shares, f"{found.tasks[found.worst]:.4f}", f"{spent:.0f}")
        )
    columns = ("robot", "minimum", "1 % below", "10 % below", "half below", "task's own sigma at the minimum",
               f"adviser of {TIMED} pairs [us]")  # fmt: skip
    return {"survey": Sheet("", columns, rows)}
