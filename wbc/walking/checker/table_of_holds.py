"""Check of the log's table of holds against the structure."""

from __future__ import annotations

import numpy as np

from wbc.walking.checker.holds import HoldTable
from wbc.walking.checker.report import Tally
from wbc.walking.checker.rules import Rules
from wbc.walking.holds.hold import FIXED, FREE
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import WalkLog

#: What the numbers of a hold may differ by [m, rad]: a file gives them back within rounding
SAME = 1e-9

KIND = "table of holds"


def declare(tally: Tally, rules: Rules) -> None:
    """The check of this module."""
    tally.declare(KIND, SAME)


def check_table(log: WalkLog, table: HoldTable, structure: Structure | None, tally: Tally) -> None:
    """Every hold of the log is one of the structure, with the same frame, roll and tilt."""
    if structure is None:
        return
    off = np.full(len(log.hold_id), np.inf)
    for k, name in enumerate(log.hold_id):
        if name not in structure:
            continue
        hold = structure[name]
        roll = {FREE: 0, FIXED: 1}.get(str(hold.roll), hold.roll)
        if roll != table.roll[k]:
            continue
        off[k] = max(
            float(np.abs(hold.position - table.position[k]).max()),
            float(np.abs(hold.pose.rotation - table.rotation[k]).max()),
            abs(hold.max_tilt - float(table.max_tilt[k])),
        )
    tally.add(KIND, off, np.full(len(off), log.t[0]), lambda k: f"hold {log.hold_id[k]}")
