"""Work on a moving object: a peg into the hole of a table on a sea."""

from __future__ import annotations

import numpy as np

import wbc
from bench.sheet import Sheet
from wbc.moving_target.knowledge import Knowledge, Measurement
from wbc.moving_target.pictures import LABELS
from wbc.moving_target.study import Outcome, TargetStudy, outcome, peg, trials

COLUMNS = ("the object is known by", "done", "rms, mm", "largest, mm", "time, s", "joint rate / limit")
#: Trials with each knowledge; the exact ones differ little
RUNS, EXACT = 200, 20


def parts() -> dict[str, Sheet | str]:
    """A table of the peg on a sea."""
    panda, sensor = wbc.robots.load("panda"), Measurement()
    sea = peg(panda, "panda_hand_tcp", "sea", 1.5e-3, sensor)
    return {"sea": sheet(sea, {k: RUNS if k in (Knowledge.NONE, Knowledge.ESTIMATED) else EXACT for k in Knowledge})}


def sheet(study: TargetStudy, counts: dict[Knowledge, int]) -> Sheet:
    """A row for each knowledge."""
    return Sheet("", COLUMNS, [row(k, outcome(k, trials(study, n, [k])[k])) for k, n in counts.items()])


def row(kind: Knowledge, found: Outcome) -> tuple[str, ...]:
    """Errors while working; the largest of those that were done."""
    time = f"{found.time[0]:.2f}" if found.successes else "-"
    worst = f"{1e3 * found.worst:.3f}" if np.isfinite(found.worst) else "-"
    return (
        LABELS[kind], f"{found.successes} of {found.done}", f"{1e3 * found.rms:.3f}", worst, time, f"{found.rate:.2f}"
    )  # fmt: skip
