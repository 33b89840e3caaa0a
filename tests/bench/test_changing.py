"""The loop whose tier changes: processes in turns, and the tails of all of them together."""

from __future__ import annotations

import pytest

from bench.measured import changing
from bench.sheet import Sheet


def test_tails_are_those_of_all_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, bool]] = []

    def run(name: str, may: bool) -> tuple[str, list[float], list[float]]:
        asked.append((name, may))
        return "native" if may else "vm", [0.1] * 9 + [float(len(asked))], [0.2] * 10

    monkeypatch.setattr(changing, "_run", run)
    sheet = changing.parts()["loops"]
    assert isinstance(sheet, Sheet)
    turn = [(name, may) for name in changing.ROBOTS for may in (True, False)]
    assert asked == turn * changing.PROCESSES
    assert [(row[1], row[3], row[5]) for row in sheet.rows] == [("30", f"{8 + k:.3f}", "0.200") for k in range(1, 5)]
    monkeypatch.setattr(changing, "_run", lambda name, may: ("vm", [0.1], [0.2]))
    with pytest.raises(AssertionError, match="vm"):
        changing.parts()
