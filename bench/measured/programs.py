"""The ten programs beside those written with pink and mink: lines of code."""

from __future__ import annotations

from bench.programs import PROGRAMS, length
from bench.sheet import Sheet


def parts() -> dict[str, Sheet | str]:
    """One table."""
    rows = [
        (f"[{p.about}](../examples/{p.name}.py)", f"{length(p.ours)}", f"{length(p.theirs)}",
         f"[{p.peer}](../bench/programs/{p.theirs.name})")
        for p in PROGRAMS
    ]  # fmt: skip
    return {"programs": Sheet("", ("program", "lines here", "lines there", "with"), rows)}
