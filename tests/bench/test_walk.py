"""The benchmark of walks: every part gives records that its table reads."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import wbc
from bench.walk import __main__ as command, courses, planning, planning_tables, tables
from bench.walk.machine import Job, Machine, Record
from wbc.errors import RangeError
from wbc.walking import cylinder
from wbc.walking.loop.stack import WalkStack

#: A course of a few seconds
SHORT = ((13, 12), (13, 13))


@pytest.fixture(scope="module")
def it() -> Machine:
    """The walker, on a controller that other tests compile, too."""
    walker = wbc.robots.walker()
    return Machine(walker, WalkStack(walker, cylinder(rigid=True), collisions=False))


@pytest.fixture(scope="module")
def course(it: Machine) -> Record:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(courses.COURSES, "+A", SHORT)
        return courses.course(it, "+A", 6.0)


def test_a_course_is_walked_measured_and_checked(course: Record) -> None:
    assert course["arrived"]
    assert course["violations"] == []
    assert course["speed"] == pytest.approx(course["kept"] * course["asked_speed"])
    assert 0.9 < course["kept"] < 1.01
    assert course["real_time_planned"] < course["real_time"]
    assert 0.0 < course["rate"] <= 1.0
    cells = tables.course_sheet([course]).rows[0]
    assert cells[:2] == ("+A", "6")
    assert "clean" in cells
    assert not courses.keeps({**course, "kept": 0.9})


def test_a_violation_is_no_kept_speed(course: Record) -> None:
    bad = {**course, "kept": 1.0, "violations": ["drift: 3 at 1.0 s, arm1"]}
    assert courses.keeps({**course, "kept": 1.0})
    assert not courses.keeps(bad)
    assert courses.binding(bad) == "drift: 3 at 1.0 s, arm1"


def test_the_highest_speed_is_bisected(course: Record) -> None:
    def walk(speed: float) -> Record:
        return {**course, "asked": speed, "kept": 1.0 if speed <= 4.33 else 0.5}

    found = courses.highest(walk, 6.0, 12.0, 0.1)
    assert 4.23 <= found["highest"] <= 4.33 < found["above"] <= 4.43
    assert found["limit"].startswith("0.500 of the speed")
    assert courses.highest(walk, 6.0, 12.0, 0.1)["asked"] == found["highest"]


def test_where_no_speed_is_kept_the_bisection_ends(course: Record) -> None:
    found = courses.highest(lambda speed: {"planned": False, "reason": "no way"}, 6.0, 12.0, 0.1)
    assert found["highest"] == 0.0
    assert found["limit"] == "no way"


def test_a_turn_keeps_its_rate(it: Machine) -> None:
    found = courses.spin(it, 0.15, angle=0.3)
    assert found["arrived"]
    assert found["asked_turn_rate"] == pytest.approx(0.15, rel=0.05)
    assert 0.9 < found["kept"] < 1.01
    assert tables.spin_sheet([found]).rows[0][1] == "0.15"


def test_a_plan_in_slices_is_timed(it: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(courses.COURSES, "+A", SHORT)
    monkeypatch.setattr(planning, "REPEATS", 2)
    found = planning.planned(it, "+A", 6.0)
    assert found["arrived"]
    assert len(found["first_ms"]) == 2
    assert 0.0 < sum(found["slices_ms"]) < 1e4
    assert len(planning_tables.planning_sheet([found]).rows[0]) == len(planning_tables.COLUMNS)


def test_a_driven_body_answers_commands(it: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "COMMANDS", planning.COMMANDS[:2])
    monkeypatch.setattr(planning, "EACH", 0.5)
    found = planning.driven(it)
    assert found["arrived"]
    assert len(found["first_ms"]) == len(found["first_cpu_ms"]) == 2
    assert len(planning_tables.planning_sheet([found]).rows[0]) == len(planning_tables.COLUMNS)


def test_the_command_writes_tables_and_records(
    course: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    part = replace(command.PARTS["courses"], jobs=lambda it: [Job("+A", lambda: course)])
    monkeypatch.setitem(command.PARTS, "courses", part)
    command.main(["--parts", "courses", "--output", str(tmp_path)])
    assert json.loads((tmp_path / "walk.json").read_text())["parts"]["courses"] == [course]
    assert "Courses of the source" in (tmp_path / "walk.md").read_text()
    assert "826c69aef4cf" in capsys.readouterr().out


def test_other_data_are_not_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(command, "WALKER_DIGEST", "0" * 12)
    with pytest.raises(RangeError, match=r"walker\.toml.*000000000000 only"):
        command.main(["--parts", "courses", "--output", str(tmp_path)])
    assert list(tmp_path.iterdir()) == []
