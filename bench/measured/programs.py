"""The ten programs beside those written with pink and mink: lines of code, and what each says at its end."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from bench.pool import ROOT
from bench.programs import PROGRAMS, results
from bench.sheet import Sheet

PEERS = ROOT / ".venv-peers" / "bin" / "python"


def parts() -> dict[str, Sheet | str]:
    """One table; ``make bench`` makes the peers' environment."""
    with TemporaryDirectory() as folder:
        sheet = results(str(PEERS), Path(folder))
    linked = [
        (f"[{row[0]}](../examples/{p.name}.py)", *row[1:3], f"[{row[3]}](../bench/programs/{p.theirs.name})", *row[4:])
        for p, row in zip(PROGRAMS, sheet.rows, strict=True)
    ]
    return {"programs": Sheet("", sheet.columns, linked)}
