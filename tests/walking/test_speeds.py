"""The speed and turn rate that are asked for: bounds of every motion of the body, and no condition of a stance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.repeats import repeats
from wbc.robots import Walker
from wbc.walking import Structure, plane, remove_columns, remove_rows
from wbc.walking.body_path import BodyPath, grid_path, straight_path
from wbc.walking.checker import check_walk
from wbc.walking.planner import planner
from wbc.walking.planner.detours import find_route
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.slower import check_stance
from wbc.walking.report.folder import rules_of
from wbc.walking.run.path_mode import PathMode
from wbc.walking.run.places import over_holds
from wbc.walking.run.request import PathRequest, Site
from wbc.walking.run.session import perform


@pytest.mark.parametrize("seed", range(repeats(8)))
def test_detours_are_no_faster_than_was_asked(machine: Walker, structure: Structure, seed: int) -> None:
    """Down, round and aside: of random trenches and holes at random rates."""
    rng = np.random.default_rng(seed)
    rates = {"speed": rng.uniform(0.01, 0.2), "turn_rate": rng.uniform(0.01, 0.1)}
    first, kind = int(rng.integers(12, 14)), seed % 3
    if kind == 0:
        ground = remove_rows(structure, f"{first}-{first + 3}")
        path = grid_path([(13, 9), (13, 18)], **rates)
    elif kind == 1:
        ground = remove_columns(structure, f"{first}-{first + 4}")
        path = grid_path([(9, 12), (20, 12)], **rates)
    else:
        ground = plane(max_tilt=0.0)
        path = straight_path(over_holds(ground, ["8,6", "8,20"], 52 * 0.0254), **rates)
        ground = ground.without([f"{t},{a}" for t in range(1, 9) for a in range(10, 10 + first - 7)])
    route = find_route(machine, ground, path)
    if route.path is None:
        assert route.separating
        return
    fastest = np.array(route.path.largest_rates()) / (rates["speed"], rates["turn_rate"])
    assert fastest.max() < 1.001
    # It takes its time for nothing: somewhere on it one of the two is used
    assert fastest.max() > 0.9


def test_rates_of_a_path_that_says_none_are_its_own() -> None:
    path = grid_path([(13, 9), (13, 11, 0.1)], 0.05, 0.02)
    own = BodyPath(path.poses, path.spacing)
    assert (path.speed, path.turn_rate) == (0.05, 0.02)
    ahead, turned = own.largest_rates()
    assert (own.speed, own.turn_rate) == (max(ahead, 1.5 * turned), max(turned, ahead / 1.5))
    slower = path.slower(4)
    assert slower.duration == pytest.approx(4.0 * path.duration)
    np.testing.assert_array_equal(slower.poses[::4], path.poses)
    np.testing.assert_allclose(np.array(slower.largest_rates()) * 4.0, path.largest_rates(), rtol=0.01)
    assert (slower.speed, slower.turn_rate) == (0.0125, 0.005)


def test_a_path_that_is_only_too_fast_for_the_joints_is_walked_slower(machine: Walker, structure: Structure) -> None:
    """At 0.8 m/s no stance lasts; half of that goes, and whoever may not go slower is told so."""
    path = grid_path([(13, 9), (13, 13)], 0.8)
    plan = plan_walk(machine, structure, path, objective="destination", detour=True)
    assert plan.complete
    assert plan.path.duration == pytest.approx(2.0 * path.duration)
    assert plan.note == "at 0.78 m/s a joint would turn too fast; at 0.39 m/s it goes"
    long = grid_path([(13, 9), (13, 20)], 0.6)
    with pytest.raises(NoPlanError, match=r"; at 0\.59 m/s joint \d would turn too fast; at 0\.3 m/s it goes"):
        plan_walk(machine, structure, long, objective="destination")
    slower = plan_walk(machine, structure, long, objective="destination", detour=True)
    assert slower.complete
    assert slower.path.largest_rates()[0] < 0.301


def test_what_has_no_stance_is_refused_before_detours(
    machine: Walker, structure: Structure, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_given: object, **_more: object) -> None:
        raise AssertionError("no detour, and no lower speed, helps")

    monkeypatch.setattr(planner, "plan_beside", never)
    monkeypatch.setattr(planner, "plan_slower", never)
    few = structure.without([hold for hold in structure.ids if int(hold.split(",")[1]) > 14])
    for path, where in (
        (grid_path([(13, 9), (13, 20)], 0.1), "end"),
        (grid_path([(13, 20), (13, 9)], 0.1), "beginning"),
    ):
        with pytest.raises(NoPlanError, match=f"no hold is in reach at the {where} of the path"):
            plan_walk(machine, few, path, objective="destination", detour=True)


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_a_stance_does_not_depend_on_speed(machine: Walker, structure: Structure, seed: int) -> None:
    """Wherever a plan of a slow path ends, and wherever it begins, the body can stand; with few holds too."""
    rng = np.random.default_rng(seed)
    some = structure.without(rng.choice(structure.ids, size=int(0.3 * len(structure.ids)), replace=False).tolist())
    first = rng.uniform((10.0, 8.0), (16.0, 12.0))
    path = grid_path([(*first, rng.uniform(-3.0, 3.0)), (*(first + rng.uniform(-1.0, 1.0, 2)), 0.0)], 0.05, 0.05)
    try:
        plan = plan_walk(machine, some, path, objective="destination")
    except NoPlanError:
        if seed < 6:
            raise
        return  # too few holds along the path
    assert plan.complete
    for pose in path.poses[[0, -1]]:
        check_stance(machine, some, pose, "middle")
    held = dict(zip([arm.name for arm in machine.arms], plan.start, strict=True))
    check_stance(machine, some, path.poses[0], "beginning", (held, {}, {}))


def test_the_summary_says_that_a_walk_was_slower(machine: Walker, tmp_path: Path) -> None:
    request = PathRequest(Site(rigid=True), "13,9", ("13,10",), 0.8, objective="destination")
    run = perform(PathMode(request, machine), backend="vm")
    assert run.outcome == "arrived"
    assert [figure.text for figure in run.more if figure.key == "slower"] == [run.plan.note if run.plan else ""]
    assert run.log is not None
    assert check_walk(run.log, machine.urdf(tmp_path / "robot.urdf"), run.structure, rules_of(machine)).ok
