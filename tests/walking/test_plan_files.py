"""Plans as files: written, read, and carried out again as they are; what is not possible is refused with its reason."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.test_commands import run
from wbc.errors import StructureFileError, UnknownNameError
from wbc.robots import Walker
from wbc.walking import Structure, cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.follow import follow_plan
from wbc.walking.planner.plan import NoPlanError, Plan, differences, read_plan
from wbc.walking.planner.planner import plan_walk

INCH = 0.0254


@pytest.fixture(scope="module")
def made(machine: Walker, structure: Structure) -> Plan:
    return plan_walk(machine, structure, grid_path([(13, 9), (14, 13, 0.2)], 4 * INCH))


@pytest.fixture(scope="module")
def file(made: Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.save(tmp_path_factory.mktemp("plan") / "plan.json")


def test_a_plan_of_a_file_is_walked_again_as_it_was(
    machine: Walker, structure: Structure, stack: WalkStack, made: Plan, file: Path
) -> None:
    again = follow_plan(machine, structure, read_plan(file))
    assert again.rows() == made.rows()
    assert again.chain == made.chain
    assert len(made.regrasps) >= 2
    ends = []
    for plan in (made, again):
        walk = Walk(machine, structure, plan, stack=stack)
        assert walk.run() == "arrived"
        ends.append((walk.time, walk.q))
    assert ends[0][0] == ends[1][0]
    np.testing.assert_allclose(ends[0][1], ends[1][1], atol=1e-6)


@pytest.mark.parametrize("rolls", [("free", 0.05), (4, 0.0)])
def test_rolls_and_branches_come_back(machine: Walker, rolls: tuple[Any, float]) -> None:
    whole = cylinder()
    kinds = replace(whole, holds=tuple(replace(hold, roll=rolls[0], max_tilt=rolls[1]) for hold in whole.holds))
    plan = plan_walk(machine, kinds, grid_path([(13, 9), (13, 13)], 5 * INCH))
    assert plan.regrasps
    bare = replace(plan, grips=None, laws=(), chain=())
    again = follow_plan(machine, kinds, bare)
    assert (again.chain, again.rows()) == (plan.chain, plan.rows())


def first(**changes: Any) -> Callable[[Plan], Plan]:
    """A plan with its first re-grasp changed."""
    return lambda plan: replace(plan, regrasps=(replace(plan.regrasps[0], **changes), *plan.regrasps[1:]))


def taken(plan: Plan) -> Plan:
    step, names = plan.regrasps[0], ["arm1", "arm2", "arm3"]
    return first(target=plan.start[(names.index(step.arm) + 1) % 3])(plan)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (first(target="1,1"), r"regrasps\[0\].*cannot hold it at"),
        (taken, r"regrasps\[0\]: (another hand is there|the arm cannot hold it at)"),
        (first(source="1,1"), r"regrasps\[0\]: the hand is on"),
        (first(lift=0.05, land=0.4), r"regrasps\[0\]: the hand cannot be there in"),
        (first(lift=9.0, land=9.5), r"regrasps\[0\]: the hand cannot be lifted at 9 s"),
        (lambda plan: replace(plan, start=("1,1", *plan.start[1:])), r"plan.start.arm1"),
        (lambda plan: replace(plan, start=(plan.start[1], *plan.start[1:])), r"plan.start"),
        (lambda plan: replace(plan, regrasps=plan.regrasps[:-1]), "no hand can be moved in time"),
    ],
)
def test_what_is_not_possible_is_refused_and_says_why(
    machine: Walker, structure: Structure, made: Plan, change: Callable[[Plan], Plan], reason: str
) -> None:
    with pytest.raises(NoPlanError, match=reason):
        follow_plan(machine, structure, change(made))


def test_holds_that_are_gone_are_named(machine: Walker, structure: Structure, made: Plan) -> None:
    gone = made.regrasps[0].target
    with pytest.raises(UnknownNameError, match=gone):
        follow_plan(machine, structure.without([gone]), made)


def test_files_of_the_version_before_are_read(file: Path, tmp_path: Path) -> None:
    """They have ``way`` where re-grasps have ``curve`` now."""
    good, old = json.loads(file.read_text()), tmp_path / "old.json"
    good["regrasps"] = [{"way" if name == "curve" else name: x for name, x in row.items()} for row in good["regrasps"]]
    assert "way" in good["regrasps"][0]
    old.write_text(json.dumps(good))
    assert read_plan(old).regrasps == read_plan(file).regrasps


def test_files_that_are_no_plans_are_refused(file: Path, tmp_path: Path) -> None:
    good = json.loads(file.read_text())
    step = good["regrasps"][0]
    for change in (
        {"way": {"spacing": 0.05, "poses": [[1.0]]}},
        {"way": None},
        {"regrasps": [{**step, "lift": "soon"}]},
        {"regrasps": [{**step, "land": float("nan")}]},
        {"regrasps": [{**step, "arm": 1}]},
        {"regrasps": [{"arm": "arm1"}]},
        {"start": 3},
        {"reached": "far"},
    ):
        bad = tmp_path / "bad.json"
        bad.write_text(json.dumps({**good, **change}))
        with pytest.raises(StructureFileError, match="not a plan"):
            read_plan(bad)
    with pytest.raises(StructureFileError, match="no such file"):
        read_plan(tmp_path / "none.json")


def test_from_the_command_line(file: Path, made: Plan, tmp_path: Path) -> None:
    bare = ["--rigid", "--no-pictures", "--no-check"]
    code, shown, err = run("walk", "--plan", file, *bare, "--least-time", "--out", tmp_path / "run")
    assert code == 0, err
    least = json.loads((tmp_path / "run" / "summary.json").read_text())["least_time"]
    assert least["least"] < 0.7 * made.path.duration
    joint, part = max(least["binding"].items(), key=lambda item: item[1])
    assert f"{least['least']:.2f} s ({least['factor']:.2f} of the plan; {joint} binds {100 * part:.0f} %)" in shown
    assert differences(made, read_plan(tmp_path / "run" / "plan.json")) == []
    code, _, err = run("walk", "--plan", file, *bare, "--remove-rows", "9-12", "--out", tmp_path / "other")
    assert code == 2
    assert not (tmp_path / "other").exists()
