"""Pairs of task and constraint coordinates: a tick, the adviser, and how good the best pair is."""

from __future__ import annotations

import wbc.coordinates as coordinates
from bench.pair_ticks import pair_ticks
from bench.sheet import Sheet, us

#: Configurations of a survey, and pairs that the adviser's time is of
COUNT, TIMED = 5000, 5
ARMS = ("ssrms", "spdm_arm", "spdm")


def parts() -> dict[str, Sheet | str]:
    """Two tables."""
    ticks = [(pair, us(1e6 * whole), us(1e6 * bare)) for pair, (whole, bare) in pair_ticks("ssrms").items()]
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
    return {
        "ticks": Sheet("", ("pair of the SSRMS", "command and tick [us]", "of these the controller [us]"), ticks),
        "survey": Sheet("", columns, rows),
    }
