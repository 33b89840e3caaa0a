"""The soak with seed 0; what is done is kept, so that a run that was ended goes on."""

from __future__ import annotations

import os

from rich.progress import Progress

from bench.pool import ROOT
from bench.sheet import Sheet
from bench.soak.__main__ import conflicts, failures, sheet, sizes_of
from bench.soak.jobs import Kept, measure, parts_of


def parts() -> dict[str, Sheet | str]:
    """How ticks ended, what gave way, what was wrong."""
    kept = Kept(ROOT / "build" / "bench" / "soak.jsonl")
    with Progress() as progress:
        found, interrupted = measure(parts_of(0, sizes_of(1.0, None), True), kept, os.cpu_count() or 1, progress)
    if interrupted:
        raise KeyboardInterrupt
    bad = failures(found)
    wrong = "Nothing was wrong in this run." if not bad else f"Runs with something wrong: {'; '.join(bad)}."
    return {"ends": sheet(found), "conflicts": conflicts(found), "wrong": wrong}
