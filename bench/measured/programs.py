"""The ten programs beside those written with pink and mink: lines of code."""

from __future__ import annotations

from bench.programs import PROGRAMS, lengths
from bench.sheet import Sheet


def parts() -> dict[str, Sheet | str]:
    """One table."""
    sheet = lengths()
    linked = [
        (f"[{row[0]}](../examples/{p.name}.py)", *row[1:3], f"[{row[3]}](../bench/programs/{p.theirs.name})")
        for p, row in zip(PROGRAMS, sheet.rows, strict=True)
    ]
    return {"programs": Sheet("", sheet.columns, linked)}
