"""The benchmark of walks: every part gives records that its table and goals read; runs are kept and go on."""

from __future__ import annotations

import gc
import json
from pathlib import Path

import numpy as np
import pytest
from rich.progress import Progress

import wbc
from bench.kept import Kept
from bench.records import measure
from bench.walk import __main__ as command
from bench.walk import courses, fits, layouts, patches, planning, planning_tables, tables, trenches
from bench.walk.layout_tables import layout_goals, layout_sheet
from bench.walk.machine import Job, Machine, Record
from bench.walk.parts import records
from bench.walk.reference import Verdict
from bench.walk.reference.verdict import Kind
from wbc.errors import RangeError
from wbc.walking import cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.log.recorder import versions
from wbc.walking.loop.body_command import pose_function
from wbc.walking.loop.closed_chain import chain_function
from wbc.walking.loop.hand_command import aim_function
from wbc.walking.loop.stack import WalkStack
from wbc.walking.planner.swings.swings import ESTIMATE
from wbc.walking.run.mode import compiled_stack

#: A course of a few seconds
SHORT = ((13, 12), (13, 13))
INCH = 0.0254


class Says:
    """A reference that has made up its mind; the real one has its own tests."""

    def __init__(self, kind: Kind) -> None:
        self._verdict = Verdict(kind, (), (), "", 0.0, 0)

    def judge(self, *_: object) -> Verdict:
        """Always the same."""
        return self._verdict


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
    late = {goal.text: goal.met for goal in tables.course_goals([{**course, "kept": 0.9}])}
    assert late["courses of 1 on which 0.98 of 6 in/s is not kept"] is False


def test_a_violation_is_no_kept_speed(course: Record) -> None:
    bad = {**course, "kept": 1.0, "violations": ["drift: 3 at 1.0 s, arm1"]}
    assert courses.keeps({**course, "kept": 1.0})
    assert not courses.keeps(bad)
    assert courses.binding(bad) == "drift: 3 at 1.0 s, arm1"


def test_the_highest_speed_is_bisected(course: Record) -> None:
    def walk(speed: float) -> Record:
        return {**course, "asked": speed, "kept": 1.0 if speed <= 4.33 else 0.5, "plan_limit": "arm1 waits"}

    found = courses.highest(walk, 6.0, 12.0, 0.1)
    assert 4.23 <= found["highest"] <= 4.33 < found["above"] <= 4.43
    assert found["limit"].startswith("0.500 of the speed: arm1 waits")
    assert courses.highest(walk, 6.0, 12.0, 0.1)["asked"] == found["highest"]


def test_where_no_speed_is_kept_the_bisection_ends(course: Record) -> None:
    found = courses.highest(lambda speed: {"planned": False, "reason": "no way"}, 6.0, 12.0, 0.1)
    assert found["highest"] == 0.0
    assert found["limit"] == "no way"


def test_what_belongs_to_the_robot_is_loaded_once(it: Machine) -> None:
    def parts() -> list[object]:
        return [chain_function(it.walker), pose_function(), aim_function(), versions()]

    gc.unfreeze()
    try:
        compiled_stack(it.walker, it.structure, "vm")
        assert [*map(id, parts())] == [*map(id, parts())]
        other = Machine(it.walker, it.stack)
        assert other.loading is None
        other.load()
        assert other.loading is not None
        assert gc.get_freeze_count() > len(gc.get_objects())
    finally:
        gc.unfreeze()


def test_a_turn_keeps_its_rate(it: Machine) -> None:
    found = courses.spin(it, 0.15, angle=0.3)
    assert found["arrived"]
    assert found["asked_turn_rate"] == pytest.approx(0.15, rel=0.05)
    assert 0.9 < found["kept"] < 1.01
    assert tables.spin_sheet([found]).rows[0][1] == "0.15"


def test_a_trench_that_cannot_be_crossed_is_refused_with_holds(it: Machine) -> None:
    there = {f"{t},{a}" for t in range(12, 15) for a in (5, 6, 7, 8, 17, 18, 19)}
    islands = it.structure.without([hold for hold in it.structure.ids if hold not in there])
    it.reference = Says("impossible")
    found = trenches.trench(it, "8 rows", islands, (13, 7), (13, 17))
    assert found["verdict"] == "impossible"
    assert not found["planned"]
    assert found["separating"]
    assert not trenches.crossed(found)
    assert tables.trench_sheet([found]).rows[0][1:3] == ("impossible", "refused")
    mute = tables.trench_goals([{**found, "separating": []}])
    assert [goal.met for goal in mute] == [True, True, False]


def test_trenches_are_three_to_eight_rows_and_columns_and_diagonals() -> None:
    whole = cylinder(rigid=True)
    there = trenches.places(whole)
    assert [name for name, *_ in there][:6] == [f"{rows} rows" for rows in range(3, 9)]
    gone = [len(whole) - len(left) for name, left, *_ in there if name.endswith("rows")]
    assert gone == [25 * rows for rows in range(3, 9)]
    for _, left, start, goal in there:
        assert {f"{start[0]},{start[1]}", f"{goal[0]},{goal[1]}"} <= set(left.ids)


def test_a_layout_is_judged_and_walked(it: Machine) -> None:
    it.reference = Says("possible")
    asked = layouts.Layout(0, 0.2, layouts.layout(0, it.structure).structure, (13, 12), (13, 13))
    found = layouts.judged(it, asked, True)
    assert found["verdict"] == "possible"
    assert found["violations"] == []
    assert layout_sheet([found]).rows[0][1:6] == ("1", "0", "0", "1", "0")
    assert all(goal.met for goal in layout_goals([found]))
    refused = {**found, "planned": False, "separating": [], "verdict": "impossible", "reason": "no way"}
    assert not all(goal.met for goal in layout_goals([refused]))


def test_a_plan_in_slices_is_timed(it: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(courses.COURSES, "+A", SHORT)
    monkeypatch.setattr(planning, "REPEATS", 2)
    found = planning.planned(it, "+A", 6.0)
    assert found["arrived"]
    assert len(found["first_ms"]) == 2
    assert 0.0 < sum(found["slices_ms"]) < 1e4
    assert len(planning_tables.planning_sheet([found]).rows[0]) == len(planning_tables.COLUMNS)
    assert "longest slice, processor time" in [goal.text for goal in planning_tables.planning_goals([found])]


def test_a_driven_body_answers_commands(it: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "COMMANDS", planning.COMMANDS[:2])
    monkeypatch.setattr(planning, "EACH", 0.5)
    found = planning.driven(it)
    assert found["arrived"]
    assert len(found["first_ms"]) == len(found["first_cpu_ms"]) == 2
    assert len(planning_tables.planning_sheet([found]).rows[0]) == len(planning_tables.COLUMNS)


def test_patches_are_counted_by_their_difference(it: Machine) -> None:
    found = patches.compared(it, 1)
    assert found["planned"] == found["fewest"] == 0
    more = {**found, "seed": 7, "planned": 2, "fewest": 1}
    none = {**found, "seed": 8, "planned": None}
    rows = planning_tables.patch_sheet([found, more, none]).rows
    assert rows[0] == ("+1", "1", "7")
    assert ("refused, though there is a way", "1", "8") in rows
    assert planning_tables.patch_goals([found, more, none])[0].value == 2


def test_an_ended_run_goes_on_from_what_is_kept(tmp_path: Path) -> None:
    done: list[int] = []

    def one(k: int, ends: bool) -> Record:
        if ends and k == 2:
            raise KeyboardInterrupt
        done.append(k)
        return {"k": k}

    def run(ends: bool) -> tuple[dict[str, list[Record]], str | None]:
        kept = Kept(tmp_path / "walk.jsonl", {"sources": "1"})
        jobs = [Job(str(k), lambda k=k: one(k, ends)) for k in range(4)]
        return measure({"part": (4, records("part", jobs, kept))}, Progress(disable=True))

    assert run(True) == ({"part": [{"k": 0}, {"k": 1}]}, "part")
    assert run(False) == ({"part": [{"k": k} for k in range(4)]}, None)
    assert done == [0, 1, 2, 3]
    with pytest.raises(ValueError, match="other sources"):
        Kept(tmp_path / "walk.jsonl", {"sources": "2"})


def test_the_command_writes_tables_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["--parts", "patches", "--patches", "1", "--output", str(tmp_path)]
    command.main(asked)
    first = json.loads((tmp_path / "walk.json").read_text())
    assert first["parts"]["patches"][0]["seed"] == 0
    assert "Re-grasps over 1 patches" in (tmp_path / "walk.md").read_text()
    assert "826c69aef4cf" in capsys.readouterr().out
    monkeypatch.setattr(patches, "compared", lambda it, seed: {**first["parts"]["patches"][0], "seed": seed})
    asked[3] = "2"
    command.main([*asked, "--resume"])
    again = json.loads((tmp_path / "walk.json").read_text())["parts"]["patches"]
    assert [r["seed"] for r in again] == [0, 1]
    # What an earlier run left of parts that are not asked for is shown too
    command.main(["--parts", "layouts", "--layouts", "0", "--output", str(tmp_path), "--resume"])
    assert len(json.loads((tmp_path / "walk.json").read_text())["parts"]["patches"]) == 2


def test_other_data_are_not_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(command, "WALKER_DIGEST", "0" * 12)
    with pytest.raises(RangeError, match=r"walker\.toml.*000000000000 only"):
        command.main(["--parts", "patches", "--output", str(tmp_path)])
    assert list(tmp_path.iterdir()) == []


def test_the_estimate_is_fitted_to_swings() -> None:
    rng = np.random.default_rng(0)
    drawn = [(float(a), float(b)) for a, b in rng.uniform(0.2, 1.5, (30, 2))]
    parts, off = fits.fitted([fits.Swung(1.1 + 0.6 * a + 0.5 * b, a, b, 0) for a, b in drawn])
    assert parts == pytest.approx([1.1, 0.6, 0.5])
    assert np.abs(off).max() < 1e-9
    walker, whole = wbc.robots.walker(), cylinder()
    found = list(fits.swings_of(walker, whole, grid_path([(13, 6), (13, 18)], 4 * INCH)))
    assert len(found) > 20
    # The estimate is low: it drops no swing that would do
    off = fits.missed(found, ESTIMATE)
    assert (off < 0.25).all()
    assert -0.8 < np.median(off) < 0.0
