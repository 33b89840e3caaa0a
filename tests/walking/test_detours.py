"""Detours: routes of the body that the reference search confirms, and refusals that name holds."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np
import pytest

import wbc
from tests.judges.fewest_along import fewest_along
from tests.repeats import ALL, MORE
from wbc.robots import Walker
from wbc.walking import Structure, plane, remove_columns, remove_rows
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath, grid_path, straight_path
from wbc.walking.planner.detours import CellSpacing, beside, cell_grips as gripping, find_route, route
from wbc.walking.planner.detours.cell_graph import CellGraph
from wbc.walking.planner.detours.cell_grips import CellGrips, cell_grips
from wbc.walking.planner.detours.cells import BESIDE, NARROW as CLOSE, WIDE, Cells, cells_about
from wbc.walking.planner.follow import follow_plan
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.planner import plan_slices, plan_walk, rest_of
from wbc.walking.planner.slices import Allowance, drained
from wbc.walking.planner.swings.curve import ALTERNATIVES
from wbc.walking.run.places import over_holds

INCH = 0.0254
#: One height, and as few poses as will do
COARSE = CellSpacing(0.14, 0.2, 5, (0.0,), 24)
#: Along the path alone, at its height and a little lower
NARROW = CellSpacing(0.14, 0.0, 0, (0.0, 0.1), 12)


def ends(path: BodyPath) -> np.ndarray:
    return path.poses[[0, -1]]


def confirm(machine: Walker, structure: Structure, path: BodyPath, every: int) -> None:
    """Exact breadth-first search over all grips along the poses finds one: arms clear, joints within their limits."""
    assert fewest_along(machine, structure, path.poses[::every]) is not None


def test_over_a_trench_the_body_turns_or_goes_down(machine: Walker, structure: Structure) -> None:
    trench = remove_rows(structure, "12-15")
    path = grid_path([(13, 9), (13, 18)], 2 * INCH)
    route = find_route(machine, trench, path)
    assert route.path is not None
    assert route.separating == ()
    np.testing.assert_allclose(ends(route.path), ends(path), atol=1e-9)
    confirm(machine, trench, route.path, 20)
    # All poses are over the line of the path, which is at x = 0; where the body turns and goes on, it does so in an arc
    assert np.abs(route.path.poses[:, 0, 3]).max() < 0.01


def test_over_a_wide_trench_hands_wait_where_they_go_with_the_body(machine: Walker, structure: Structure) -> None:
    trench = remove_rows(structure, "12-17")
    path = grid_path([(13, 6), (13, 20)], 1.5 * INCH, height=52 * INCH)
    plan = plan_walk(machine, trench, path, objective="destination", detour=True)
    assert plan.complete
    np.testing.assert_allclose(ends(plan.path), ends(path), atol=1e-9)
    waits = [one for one in zip(plan.regrasps, plan.laws, strict=True) if one[0].curve >= len(ALTERNATIVES)]
    assert waits
    latch, (_, radius, height) = machine.arm_data.latch_time, limb_of(machine).waiting[0]
    for step, law in waits:
        assert law.possible
        base = next(arm.base.homogeneous for arm in machine.arms if arm.name == step.arm)
        rides = np.linspace(0.45, 0.55, 5) * law.duration
        frames = plan.path.blended((step.lift + latch + rides) / plan.path.spacing) @ base
        places = np.array([law.at(time).position for time in rides]) - frames[:, :3, 3]
        hands = np.einsum("nji,nj->ni", frames[:, :3, :3], places)
        np.testing.assert_allclose(np.hypot(hands[:, 0], hands[:, 1]), radius, atol=2e-3)
        np.testing.assert_allclose(hands[:, 2], height, atol=2e-3)


def test_a_detour_changes_its_velocity_gradually(machine: Walker, structure: Structure) -> None:
    path = grid_path([(13, 9), (13, 18)], 2 * INCH)
    route = find_route(machine, remove_rows(structure, "12-15"), path)
    assert route.path is not None
    velocities = np.diff(route.path.poses[:, :3, 3], axis=0) / route.path.spacing
    # At first and last it is as fast as the path at once; in between it takes at least 0.3 s
    change = np.linalg.norm(np.diff(velocities, axis=0), axis=1)[1:-1]
    assert change.max() < 0.4 * np.linalg.norm(velocities, axis=1).max()


def test_round_a_hole_the_body_goes_beside_its_path(machine: Walker) -> None:
    whole = plane(max_tilt=0.0)
    gone = [f"{t},{a}" for t in range(1, 9) for a in range(10, 17)]
    holes = whole.without(gone)
    path = straight_path(over_holds(whole, ["8,6", "8,20"], 52 * INCH), 2 * INCH)
    route = find_route(machine, holes, path, mesh=COARSE)
    assert route.path is not None
    np.testing.assert_allclose(ends(route.path), ends(path), atol=1e-9)
    # At 52 in above the plane throughout, and to the side
    np.testing.assert_allclose(route.path.poses[:, 2, 3], 52 * INCH, atol=1e-6)
    assert 0.15 < np.abs(route.path.poses[:, 1, 3] - path.poses[0, 1, 3]).max() <= 1.0 + 1e-9
    confirm(machine, holes, route.path, 60)


def test_two_islands_are_refused_with_the_holds_that_separate_them(machine: Walker, structure: Structure) -> None:
    first = {f"{t},{a}" for t in range(12, 15) for a in range(4, 10)}
    second = {f"{t},{a}" for t in range(12, 15) for a in range(20, 24)}
    islands = structure.without([hold for hold in structure.ids if hold not in first | second])
    path = grid_path([(13, 7), (13, 21.5)], 2 * INCH)
    with pytest.raises(NoPlanError, match="beside the path there is no route beyond") as caught:
        plan_walk(machine, islands, path, objective="destination", width=4, detour=True)
    assert caught.value.separating
    assert set(caught.value.separating) <= first


def test_a_start_without_holds_is_refused_with_those_in_reach(machine: Walker, structure: Structure) -> None:
    few = structure.without([hold for hold in structure.ids if hold not in ("13,6", "13,20", "14,20", "12,20")])
    with pytest.raises(NoPlanError, match="no hold is in reach") as caught:
        plan_walk(machine, few, grid_path([(13, 8), (13, 9)], 2 * INCH), detour=True)
    assert set(caught.value.separating) <= {"13,6"}


def plain_cells(machine: Walker, structure: Structure, path: BodyPath, sides: int = 1) -> Cells:
    return cells_about(path, structure, CellSpacing(0.14, 0.2, sides, (0.0, 0.1), 24))


def grips_at(cells: Cells, *of_arms: list[np.ndarray]) -> CellGrips:
    """Of each arm grips that hold at some cells each."""
    whole = [(arm, there) for arm, mine in enumerate(of_arms) for there in mine]
    rows = [np.full(len(there), k, dtype=np.int32) for k, (_, there) in enumerate(whole)]
    arms = np.array([arm for arm, _ in whole])
    there = np.concatenate([there for _, there in whole]).astype(np.int32)
    return CellGrips(arms, np.arange(len(whole)), len(cells), np.concatenate(rows), there)


def graph_of(cells: Cells, grips: CellGrips, arms: int, pace: float = 0.05) -> CellGraph:
    return CellGraph(cells, grips, arms, lambda change: route._seconds(change, pace, 0.1))


def test_a_body_goes_on_where_its_arms_have_a_grip_at_both_cells(machine: Walker, structure: Structure) -> None:
    """Which grip it is may change at every cell; one arm at most has none, where there is no other way."""
    cells = plain_cells(machine, structure, grid_path([(13, 9), (13, 13)], 2 * INCH))
    station, side, *_ = np.unravel_index(np.arange(len(cells)), cells.shape)
    numbers, last = np.arange(len(cells)), cells.shape[0] - 1
    first, then, later = (numbers[flags] for flags in (station <= 2, station >= 2, station >= 3))
    assert graph_of(cells, grips_at(cells, [first, then], [numbers]), 2).shortest() is not None
    # Two arms that have no grip in common from the third station to the fourth
    graph = graph_of(cells, grips_at(cells, [first, later], [first, later]), 2)
    assert graph.shortest() is None
    assert graph.furthest().tolist() == [0, 2]
    # One arm alone is left without, or goes where it has a grip: beside the path
    gap = grips_at(cells, [first, later], [numbers], [numbers])
    chain = graph_of(cells, gap, 3).shortest()
    assert chain is not None
    assert station[chain].tolist() == list(range(last + 1))
    beside = grips_at(cells, [first, later, numbers[side == 2]], [numbers], [numbers])
    chain = graph_of(cells, beside, 3).shortest()
    assert chain is not None
    assert {2, 3} <= set(station[[cell for cell in chain if side[cell] == 2]].tolist())


def test_a_chain_of_cells_is_the_quickest_one(machine: Walker, structure: Structure) -> None:
    """The body turns and goes down while it goes on, as that takes no longer; and on beyond a whole turn."""
    path = grid_path([(13, 9), (13, 12)], 2 * INCH)
    cells = plain_cells(machine, structure, path)
    chain = graph_of(cells, grips_at(cells, [np.arange(len(cells))]), 1, pace=2 * INCH).shortest()
    assert chain is not None
    assert len(chain) == cells.shape[0]
    # In the middle it must be lower, and turned by two steps in the other sense
    station, _, lower, turned = np.unravel_index(np.arange(len(cells)), cells.shape)
    between = (station == cells.shape[0] // 2) & ~((lower == 1) & (turned == 22))
    two = grips_at(cells, [np.flatnonzero(~between)], [np.flatnonzero(~between)])
    chain = graph_of(cells, two, 2, pace=2 * INCH).shortest()
    assert chain is not None
    assert len(chain) == cells.shape[0]
    assert (lower[chain[cells.shape[0] // 2]], turned[chain[cells.shape[0] // 2]]) == (1, 22)


def test_chains_keep_away_from_steps_and_cells(machine: Walker, structure: Structure) -> None:
    cells = plain_cells(machine, structure, grid_path([(13, 9), (13, 13)], 2 * INCH))
    everywhere = np.arange(len(cells))
    few = np.flatnonzero(np.unravel_index(everywhere, cells.shape)[1] != 0)
    graph = graph_of(cells, grips_at(cells, [everywhere, few], [everywhere]), 2)
    first = graph.shortest()
    assert first is not None
    graph.close([(first[2], first[1])])
    second = graph.shortest()
    assert second is not None
    assert (first[1], first[2]) not in set(pairwise(second))
    for _ in range(20):
        graph.avoid([second[2]], [0])
    third = graph.shortest()
    assert third is not None
    assert second[2] not in third


@pytest.mark.parametrize("arms", range(2, 7))
def test_an_arm_has_the_grips_that_the_first_one_has_where_the_body_is_turned(
    structure: Structure, monkeypatch: pytest.MonkeyPatch, arms: int
) -> None:
    machine = wbc.robots.walker(arms, (8 + 3 * arms) * INCH)
    mesh = CellSpacing(0.2, 0.2, 0, (0.0,), 12).of(limb_of(machine), arms)
    cells = cells_about(grid_path([(13, 9), (13, 10)], 2 * INCH), structure, mesh)
    assert all(gripping._turned(gripping.around(machine, structure), cells, arm) is not None for arm in range(arms))
    quick = cell_grips(machine, structure, cells)
    monkeypatch.setattr(gripping, "_turned", lambda *_given: None)
    slow = cell_grips(machine, structure, cells)
    rows = [
        set(zip(g.arm[g.grip].tolist(), g.hold[g.grip].tolist(), g.cell.tolist(), strict=True)) for g in (quick, slow)
    ]
    assert rows[0] == rows[1]
    assert {arm for arm, *_ in rows[0]} == set(range(arms))


@pytest.mark.parametrize("arms", range(2, 7) if MORE >= ALL else (2, 5))
def test_bodies_with_two_to_six_arms_look_for_detours(structure: Structure, arms: int) -> None:
    """As many hands as must hold do, of any number of arms; and where holds end, all of them are refused."""
    machine = wbc.robots.walker(arms, (8 + 3 * arms) * INCH)
    path = grid_path([(13, 9), (13, 12)], 2 * INCH)
    route = find_route(machine, remove_rows(structure, "10-11"), path, mesh=NARROW)
    assert route.path is not None, route.text
    np.testing.assert_allclose(ends(route.path), ends(path), atol=1e-9)
    few = structure.without([hold for hold in structure.ids if int(hold.split(",")[1]) > 11])
    refused = find_route(machine, few, grid_path([(13, 9), (13, 22)], 2 * INCH), mesh=NARROW)
    assert refused.path is None
    assert refused.separating


@pytest.mark.parametrize("touches", [True, False])
def test_cells_are_closer_only_where_the_body_touches_something_between_them(
    machine: Walker, structure: Structure, monkeypatch: pytest.MonkeyPatch, touches: bool
) -> None:
    looked = list[CellSpacing]()

    def variations(*args: Any) -> Generator[route.BodyRoute, Any, bool]:
        looked.append(args[3])
        yield route.BodyRoute(None, (), "none")
        return touches and args[3] == WIDE

    monkeypatch.setattr(route, "_variations", variations)
    assert all(one.path is None for one in route.find_routes(machine, structure, grid_path([(13, 9), (13, 10)], 0.1)))
    assert looked == ([BESIDE, WIDE, CLOSE] if touches else [BESIDE, WIDE])


def test_over_six_columns_the_body_turns_as_it_goes(machine: Walker, structure: Structure) -> None:
    trench = remove_columns(structure, "12-17")
    path = grid_path([(9, 12), (20, 12)], 1.5 * INCH, height=52 * INCH)
    plan = plan_walk(machine, trench, path, objective="destination", detour=True)
    assert plan.complete
    np.testing.assert_allclose(ends(plan.path), ends(path), atol=1e-9)
    # At 1 in/s of 1.5 in/s and more
    assert plan.path.duration + plan.delay < 1.5 * path.duration


def test_detours_that_take_long_come_after_those_among_other_cells(
    machine: Walker, structure: Structure, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = grid_path([(13, 9), (13, 10)], 0.1)
    slow = straight_path(list(path.poses[[0, -1]]), 0.005)
    asked = list[tuple[str, int | None]]()

    def variations(*args: Any) -> Generator[route.BodyRoute, Any, bool]:
        way, name = (slow, "slow") if args[3] == BESIDE else (path, "quick")
        for count in range(2):
            asked.append((f"{name} {count}", (yield route.BodyRoute(way, (), f"{name} {count}"))))
        return False

    monkeypatch.setattr(route, "_variations", variations)
    routes = route.find_routes(machine, structure, path)
    found = [next(routes).text]
    for ended in range(1, 4):
        found.append(routes.send(ended).text)
    assert found == ["quick 0", "quick 1", "slow 0", "slow 1"]
    # Each is told where the plan along it ended
    assert asked == [(name, ended) for ended, name in enumerate(found[:-1], start=1)]


def test_refusals_end_when_their_work_is_done(
    machine: Walker, structure: Structure, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same every time, and the reason says so."""
    trench = remove_rows(structure, "10-17")
    path = grid_path([(13, 8), (13, 19.5)], 2 * INCH)
    monkeypatch.setattr(route, "MESHES", (NARROW,))
    monkeypatch.setattr(beside, "WORK", 1.0)
    reasons = set[str]()
    for _ in range(2):
        with pytest.raises(NoPlanError, match="would take too long") as caught:
            plan_walk(machine, trench, path, objective="destination", width=4, detour=True)
        reasons.add(str(caught.value))
    assert len(reasons) == 1


def test_a_plan_that_ends_near_the_end_is_gone_on_with_by_a_wider_search(machine: Walker, structure: Structure) -> None:
    """From some re-grasps before its end, as long as each leads further; the kept ones stay as they were."""
    path = grid_path([(13, 8), (13, 19.5)], 2 * INCH)
    whole = plan_walk(machine, structure, path, objective="destination")
    asked = list[tuple[int, int | None]]()

    def go_on(plan: Plan, kept: int, width: int | None, _work: Allowance | None) -> Plan:
        asked.append((kept, width))
        return whole if len(asked) == 2 else replace(plan, reached=plan.reached + 1.0)

    ends = whole.cut([arm.name for arm in machine.arms], len(whole.regrasps), 0.7 * path.duration)
    search = beside.Search(lambda *_: ends, go_on, 16, None)
    assert search.along(path, None) is whole
    assert asked == [(len(whole.regrasps) - beside.BACK, 40)] * 2
    # One that ends early is left, and one that leads no further
    asked.clear()
    early = replace(ends, reached=0.5 * path.duration)
    assert beside.Search(lambda *_: early, go_on, 16, None).along(path, None) is early
    assert not asked
    assert beside.Search(lambda *_: ends, lambda plan, *_: plan, 16, None).along(path, None) is ends


def test_what_is_gone_on_with_begins_with_the_same_regrasps(machine: Walker, structure: Structure) -> None:
    path = grid_path([(13, 8), (13, 19.5)], 2 * INCH)
    whole = plan_walk(machine, structure, path, objective="destination")
    kept = len(whole.regrasps) - beside.BACK
    search = partial(plan_slices, machine, structure)
    again = drained(rest_of(machine, search, whole, kept, tries=[(inf, 16)]))
    assert again.complete
    assert again.start == whole.start
    assert again.regrasps[:kept] == whole.regrasps[:kept]
    # And can be carried out as a whole
    assert follow_plan(machine, structure, again).regrasps == again.regrasps
