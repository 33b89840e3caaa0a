"""The benchmark of the published walker: every part gives records that its table reads."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bench.climb import walker
from bench.climb.walker import INCH, RADIUS, Case
from wbc.climb.grids import cylinder_grid, grid_pose

Record = dict[str, Any]


@pytest.fixture(scope="module")
def short() -> Case:
    return Case("short", cylinder_grid(), [grid_pose(13, a, RADIUS) for a in (9, 14)], 6 * INCH)


@pytest.fixture(scope="module")
def record(short: Case) -> Record:
    return walker.walked(short)


def test_a_walk_is_measured_and_checked(record: Record) -> None:
    assert walker.keeps(record)
    assert record["kept"] < 1.01
    assert record["regrasps"] > 0
    cells = walker.walk_sheet("courses", [record]).rows[0]
    assert (cells[0], cells[2], cells[-1]) == ("short", str(record["regrasps"]), "clean")
    bad = {**record, "violations": ["drift: 3 at 1.0 s, arm1"]}
    assert not walker.keeps(bad)
    assert walker.ended(bad) == "drift: 3 at 1.0 s, arm1"


def test_the_highest_speed_is_bisected(short: Case, record: Record) -> None:
    def walk(case: Case) -> Record:
        return {**record, "kept": 1.0 if case.speed <= 7.33 * INCH else 0.5}

    best = walker.highest(short, walk)
    assert 7.2 * INCH <= best["highest"] <= 7.33 * INCH < best["above"] <= 7.43 * INCH
    slow = walker.highest(short, lambda case: {**record, "planned": False, "reason": "no way"})
    assert slow["highest"] == 0.0


@pytest.mark.parametrize("part", walker.PARTS)
def test_every_part_has_cases(part: str) -> None:
    if part not in ("driven", "highest"):
        some = list(walker.cases(part, 3, 4))
        assert len(some) == {"courses": 8, "rows": 7, "columns": 6, "demo": 1, "spins": 1}.get(part, 3)
        assert len({case.name for case in some}) == len(some)


def test_what_is_refused_says_why(short: Case) -> None:
    kept = [foothold.id for foothold in short.scene.footholds[:20]]
    few = short.scene.without(*(foothold.id for foothold in short.scene.footholds if foothold.id not in kept))
    refused = walker.walked(replace(short, scene=few))
    assert not refused["planned"]
    assert walker.walk_sheet("courses", [refused]).rows[0][-1].startswith("refused: ")


def test_a_driven_body_answers_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walker, "TWISTS", walker.TWISTS[:2])
    monkeypatch.setattr(walker, "EACH", 1.0)
    driven = walker.driven()
    assert walker.ended(driven) == "clean"
    assert max(driven["answers"]) < 1.0
    assert walker.drive_sheet("driven", [driven]).rows[0][0] == "2 of 2 other rates"


def test_the_command_writes_tables_and_records(record: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walker, "walked", lambda case: record)
    walker.main(["--parts", "demo", "--output", str(tmp_path)])
    written = json.loads((tmp_path / "walker.json").read_text())
    assert written["parts"] == {"demo": [record]}
    assert "of the speed" in (tmp_path / "walker.md").read_text()
    assert "of the speed" in walker.page({"parts": {"courses": [record]}})
