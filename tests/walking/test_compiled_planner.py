"""The planner's compiled inner loops do what its numpy does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wbc.clearance import TriangleMesh
from wbc.robots import Walker
from wbc.shapes import Box, Capsule, Cylinder, Sphere
from wbc.walking import Obstacle, Structure, cylinder, plane
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.holds.built_in import grid_pose
from wbc.walking.native import compiled
from wbc.walking.planner.around import around
from wbc.walking.planner.detours.cell_grips import CellGrips, cell_grips
from wbc.walking.planner.detours.cells import CellSpacing, cells_about
from wbc.walking.planner.grips.conflicts import ArmClearance
from wbc.walking.planner.grips.table import Grips, find_grips
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.swings.curve import ALTERNATIVES
from wbc.walking.planner.swings.least_time import speeds
from wbc.walking.planner.swings.move import Chosen, Move, Swing
from wbc.walking.planner.swings.swings import Swings
from wbc.walking.planner.swings.tracks import TrackRequests, Tracks, tracks

Both = Callable[[Callable[[], Any]], tuple[Any, Any]]
COUNT, N = 120, 25


def shapes() -> tuple[Obstacle, ...]:
    """One of each shape, among the holds of the path."""
    corners = np.array([[1.0, 0, -0.7], [-1, 0, -0.7], [0, 1, 0.7], [0, -1, 0.7]]) * 0.15
    mesh = TriangleMesh(corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]], solid=True)
    kinds = Box((0.1, 0.2, 0.3)), Cylinder(0.06, 0.3), Capsule(0.05, 0.4), Sphere(0.1), mesh
    where = [(11, 8), (12, 11), (14, 9), (15, 11.5), (12.5, 7)]
    return tuple(
        Obstacle(f"thing {k}", kind, grid_pose(*at, 2.7) * pin.SE3(pin.utils.rotate("x", 0.4), np.zeros(3)))
        for k, (kind, at) in enumerate(zip(kinds, where, strict=True))
    )


SHAPES = shapes()


@pytest.fixture(scope="module")
def path() -> BodyPath:
    return grid_path([(12, 9), (13.5, 11, 0.3)], 0.15)


@pytest.fixture(scope="module")
def grips(machine: Walker, structure: Structure, path: BodyPath) -> Grips:
    return find_grips(machine, structure, path)


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> Both:
    """A result by compiled code, and by numpy."""

    def results(work: Callable[[], Any]) -> tuple[Any, Any]:
        assert compiled.library() is not None
        first = work()
        with monkeypatch.context() as patch:
            patch.setattr(compiled, "library", lambda: None)
            return first, work()

    return results


def drawn(grips: Grips, path: BodyPath) -> tuple[TrackRequests, Any, Any]:
    """Swings of one arm each between grips at random."""
    rng = np.random.default_rng(4)
    source, target = (rng.integers(0, len(grips), 20 * COUNT) for _ in range(2))
    fits = (grips.arm[source] == grips.arm[target]) & (grips.hold[source] != grips.hold[target])
    source, target = source[fits][:COUNT], target[fits][:COUNT]
    lift = rng.integers(0, len(path), len(source))
    last = np.minimum(lift + rng.integers(5, 60, len(source)), len(path) - 1)
    least = rng.uniform(0.0, 3.0, len(source))
    asked = TrackRequests(grips.arm[source], source, target, lift + 2.0, last, least)
    return asked, lift, rng.integers(0, len(grips), len(source))


def test_swings_are_the_same(machine: Walker, structure: Structure, path: BodyPath, grips: Grips, both: Both) -> None:
    swings, arms = Swings(machine, structure, path, grips), ArmClearance(machine, grips)
    asked, lift, others = drawn(grips, path)
    found = set()
    for which in range(len(ALTERNATIVES)):
        curve = swings.curve(asked.arms, asked.source, asked.target, lift, which)
        fast, slow = both(lambda c=curve: c.at(np.linspace(0.0, 1.0, 40)))
        np.testing.assert_allclose(fast, slow, rtol=0.0, atol=1e-12)
        one: Tracks
        other: Tracks
        one, other = both(lambda c=curve: tracks(machine, arms.shapes, path, grips, c, asked, N))
        assert one.possible.tolist() == other.possible.tolist()
        fits = one.possible
        for name in ("duration", "samples", "points"):
            np.testing.assert_allclose(getattr(one, name)[fits], getattr(other, name)[fits], rtol=1e-9, atol=1e-9)
        ends, bodies = grips.hold[np.stack([asked.source, asked.target], axis=1)], path.blended(one.samples)
        there = [structure, replace(plane(), holds=structure.holds), replace(structure, obstacles=SHAPES)]
        for what in there[: 1 if which else 3]:
            some = slice(0, 25 if what.obstacles else COUNT)
            given = asked.arms[some], one.points[some], bodies[some], ends[some]
            fast, slow = both(lambda w=what, g=given: around(machine, w).swings(*g))
            assert fast.tolist() == slow.tolist()
            found |= {("structure", x) for x in fast.tolist()}
        fast, slow = both(lambda t=one: arms.stay_clear(t.points, t.samples, others, 0.004))
        assert fast.tolist() == slow.tolist()
        found |= {("others", x) for x in fast.tolist()} | {("possible", x) for x in fits.tolist()}
    # Every check has said yes and no
    assert len(found) == 6


def test_chosen_curves_are_the_same(machine: Walker, structure: Structure, path: BodyPath, both: Both) -> None:
    """Also of hands that must not roll, and where swings were corrected."""
    rolls = [replace(hold, roll=("free", 4)[k % 2]) for k, hold in enumerate(structure.holds)]
    some = replace(structure, holds=tuple(rolls))
    grips = find_grips(machine, some, path)
    asked, lift, others = drawn(grips, path)
    columns = zip(asked.arms, asked.source, asked.target, lift, asked.last, strict=True)
    swings = [
        Swing(*map(int, row[:4]), int(row[4]) + 60, (int(other),), int(row[3]) + 20 * (k % 4))
        for k, (row, other) in enumerate(zip(columns, others, strict=True))
    ]

    def chosen() -> list[Chosen | None]:
        search = Swings(machine, some, path, grips)
        search.prepare(swings)
        first = [search.choose(swing) for swing in swings]
        for swing, found in zip(swings[::2], first[::2], strict=True):
            if found is not None:
                move = Move(*swing[:4], swing.lift + 40, found.duration, 0.0, found.curve)
                search.correct(move, 4.0, found.duration < 2.5)
        search.prepare(swings)
        return first + [search.choose(swing) for swing in swings]

    one: list[Chosen | None]
    other: list[Chosen | None]
    one, other = both(chosen)
    assert [c and c.curve for c in one] == [c and c.curve for c in other]
    times = [[c.duration for c in many if c] for many in (one, other)]
    np.testing.assert_allclose(times[0], times[1], rtol=1e-9, atol=1e-9)
    assert len({c.curve for c in one if c}) > 1
    assert None in one
    assert 4.0 in times[0]


def test_laws_and_arms_are_the_same(
    machine: Walker, structure: Structure, path: BodyPath, grips: Grips, both: Both
) -> None:
    swings, arms = Swings(machine, structure, path, grips), ArmClearance(machine, grips)
    asked, lift, _ = drawn(grips, path)
    curve = swings.curve(asked.arms, asked.source, asked.target, lift, 0)
    samples = np.minimum(lift[:, None] + np.linspace(0.0, 30.0, N), len(path) - 1.0)
    for bends in (2, 3):
        wrists = np.linspace(-0.4, 0.9, N)[:, None] + 0.1 * np.arange(bends)
        bent = np.repeat(wrists[None], len(lift), axis=0)
        one, other = both(lambda b=bent: speeds(machine, asked.arms, path, curve, samples, lambda _: b))
        assert one.possible.tolist() == other.possible.tolist()
        fits = one.possible
        assert set(fits.tolist()) == {True, False}
        for name in ("angles", "rate", "time"):
            np.testing.assert_allclose(getattr(one, name)[fits], getattr(other, name)[fits], rtol=1e-9, atol=1e-9)
    postures = grips.postures[np.random.default_rng(1).integers(0, len(grips.postures), 4000)]
    points = [both(lambda k=k, q=q: arms.shapes.points(k, q)) for k, q in enumerate(np.split(postures, 2))]
    for fast, slow in points:
        np.testing.assert_allclose(fast, slow, rtol=0.0, atol=1e-14)
    fast, slow = both(lambda: arms.shapes.near(points[0][0], points[1][0]))
    assert fast.tolist() == slow.tolist()
    assert set(fast.tolist()) == {True, False}


def test_plans_are_the_same(machine: Walker, structure: Structure, both: Both) -> None:
    way = grid_path([(13, 9), (13.5, 12)], 0.15)
    one: Plan
    other: Plan
    one, other = both(lambda: plan_walk(machine, structure, way))
    assert (one.start, one.regrasps) == (other.start, other.regrasps)
    assert one.regrasps


def test_postures_in_cells_are_the_same(machine: Walker, structure: Structure, path: BodyPath, both: Both) -> None:
    there = replace(structure, obstacles=SHAPES)
    cells = cells_about(path, there, CellSpacing(0.2, 0.3, 1, (0.0, 0.1), 5))
    one: CellGrips
    other: CellGrips
    one, other = both(lambda: cell_grips(machine, there, cells))
    for name in ("arm", "hold"):
        assert getattr(one, name).tolist() == getattr(other, name).tolist()
    rows, others = (np.unique(np.stack([there.grip, there.cell]), axis=1) for there in (one, other))
    assert rows.tolist() == others.tolist()
    assert rows.shape[1] == len(one.grip) > len(cells)


@pytest.mark.parametrize("rigid", [True, False])
def test_grips_and_their_conflicts_are_the_same(machine: Walker, path: BodyPath, both: Both, rigid: bool) -> None:
    structure = cylinder(rigid=rigid)
    one: Grips
    other: Grips
    one, other = both(lambda: find_grips(machine, structure, path))
    for name in ("arm", "hold", "branch", "first", "last", "offset", "ends", "roll"):
        assert getattr(one, name).tolist() == getattr(other, name).tolist()
    np.testing.assert_allclose(one.postures, other.postures, rtol=0.0, atol=1e-10)
    # Grips end for several reasons
    assert len(set(one.ends.tolist())) > 3
    pairs = np.random.default_rng(2).integers(0, len(one), (300, 2)).tolist()
    pairs = [(a, b) for a, b in pairs if one.arm[a] != one.arm[b]]

    def conflicts() -> list[int]:
        arms = ArmClearance(machine, one)
        arms.prepare(pairs)
        return [arms.first_conflict(a, b, sample) for a, b in pairs for sample in (0, 40)]

    fast, slow = both(conflicts)
    assert fast == slow
    assert len(set(fast)) > 3
