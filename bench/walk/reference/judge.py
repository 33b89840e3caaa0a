"""The reference: what is possible, what is not, and the fewest re-grasps on the lattice."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import cached_property

import numpy as np

from bench.walk.reference.arm_table import ArmTable, arm_table
from bench.walk.reference.bridges import Bridges
from bench.walk.reference.flood import Flood
from bench.walk.reference.grid import GridHolds, grid_holds
from bench.walk.reference.lattice import HEIGHTS, GridPose, Ints, Lattice
from bench.walk.reference.links import Links, find_links
from bench.walk.reference.pairs import Pairs, find_pairs
from bench.walk.reference.route import Router
from bench.walk.reference.rules import RELAXED, STRICT, Rules
from bench.walk.reference.search import Outcome, Search, StanceSet
from bench.walk.reference.verdict import Kind, Step, Verdict
from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.robots import Walker, walker
from wbc.walking.holds.structure import Structure

#: Nodes that the strict search expands before, and after, the relaxed search has had its say
FIRST, LIMIT = 4_000, 60_000


class Reference:
    """The tables of one walker and lattice; they are made when they are first asked for and serve every layout.

    Args:
        machine: a body with three arms; default ``wbc.robots.walker()``.
        heights: of the body above the surface [m], increasing.
        strict, relaxed: what proves possible, and impossible.

    Raises:
        ShapeError: another machine. ShapeError, NotFiniteError, RangeError: bad heights. RangeError: relaxed rules
            with collisions or branches.
    """

    def __init__(
        self,
        machine: Walker | None = None,
        heights: tuple[float, ...] = HEIGHTS,
        strict: Rules = STRICT,
        relaxed: Rules = RELAXED,
    ) -> None:
        self.machine = walker() if machine is None else machine
        if len(self.machine.arms) != 3 or self.machine.robot.name != "walker":
            raise ShapeError("machine", self.machine.robot.name, "expected a body with three arms")
        if relaxed.collisions or relaxed.branches:
            raise RangeError("relaxed", relaxed, "expected rules without collisions and branches")
        self.lattice, self.strict, self.relaxed = Lattice(heights), strict, relaxed

    @cached_property
    def strict_tables(self) -> tuple[ArmTable, Pairs, Links]:
        """Arm table, types of pairs and links of the strict rules."""
        table = arm_table(self.machine, self.lattice, self.strict)
        pairs = find_pairs(self.machine, self.lattice, self.strict, table)
        return table, pairs, find_links(pairs)

    @cached_property
    def relaxed_tables(self) -> tuple[Flood, Bridges]:
        """What the relaxed search needs."""
        table = arm_table(self.machine, self.lattice, self.relaxed)
        return Flood(table.fits), Bridges(table.fits, find_pairs(self.machine, self.lattice, self.relaxed, table))

    def judge(
        self, structure: Structure, start: GridPose, goal: GridPose, *, stance: Mapping[str, str] | None = None
    ) -> Verdict:
        """Whether a walker with three hands on holds at one pose can get to another, with three hands on holds there.

        Possible: the strict search found a way. Impossible: the relaxed search proves that there is none. Both look at
        poses of the lattice only.

        Args:
            structure: the published cylinder, or what is left of it.
            start, goal: poses on the lattice; open headings and heights mean any.
            stance: arm name -> hold id, of all arms: the holds at the start; default: any.

        Raises:
            ShapeError, RangeError: another structure, or a pose off the lattice. UnknownNameError: no such arm or hold.
        """
        begin = time.perf_counter()
        holds = grid_holds(structure)
        cells = self.lattice.cells("start", start), self.lattice.cells("goal", goal)
        only = self._only(structure, holds, stance)
        search, starts, goals = self._search(holds, cells, only)
        outcome = search.run(starts, goals, (goal.t, goal.a), FIRST)
        kind: Kind = "possible"
        separating: tuple[str, ...] = ()
        reason = "a way was found"
        if outcome.way is None:
            separating, reason = self._impossible(holds, *cells)
            kind = "impossible"
            if not reason:
                outcome = search.run(starts, goals, (goal.t, goal.a), LIMIT)
                kind, reason = "possible", "a way was found"
            if kind == "possible" and outcome.way is None:
                kind = "undecided"
                reason = f"no way with room to spare among {outcome.expanded} nodes, and no proof that there is none"
        path = self._path(outcome, holds)
        return Verdict(kind, path, separating, reason, time.perf_counter() - begin, outcome.expanded)

    def fewest_regrasps(
        self, structure: Structure, start: GridPose, goal: GridPose, *, stance: Mapping[str, str] | None = None
    ) -> Verdict:
        """The fewest re-grasps between two poses under the strict rules, by breadth-first search.

        Arguments and errors are those of :meth:`judge`. The verdict is ``possible`` with a path of the fewest
        re-grasps, or ``impossible`` under the strict rules: all nodes that can be reached were looked at.
        """
        begin = time.perf_counter()
        holds = grid_holds(structure)
        cells = self.lattice.cells("start", start), self.lattice.cells("goal", goal)
        search, starts, goals = self._search(holds, cells, self._only(structure, holds, stance))
        still = self._still(holds, starts, goals)
        if still is not None:
            return Verdict("possible", still, (), "no hand need move", time.perf_counter() - begin, 0)
        outcome = search.run(starts, goals, None, np.iinfo(np.int64).max)
        kind: Kind = "possible" if outcome.way else "impossible"
        reason = "a way was found" if outcome.way else "no way under these rules"
        path = self._path(outcome, holds)
        return Verdict(kind, path, (), reason, time.perf_counter() - begin, outcome.expanded)

    def _still(self, holds: GridHolds, starts: StanceSet, goals: StanceSet) -> tuple[Step, ...] | None:
        """One step without a re-grasp from start to goal."""
        for begin, end, kinds in starts.common(goals):
            route = self._router.route(begin, end.cell, list(enumerate(kinds)))
            if route is not None:
                return (self._router.step(begin, -1, route, holds),)
        return None

    @property
    def _router(self) -> Router:
        table, pairs, _ = self.strict_tables
        return Router(self.lattice, self.strict, table, pairs)

    def _search(
        self, holds: GridHolds, cells: tuple[Ints, Ints], only: tuple[tuple[int, int], ...] | None
    ) -> tuple[Search, StanceSet, StanceSet]:
        _, pairs, links = self.strict_tables
        search = Search(pairs, links, holds)
        return search, search.stances(cells[0], only), search.stances(cells[1])

    def _only(
        self, structure: Structure, holds: GridHolds, stance: Mapping[str, str] | None
    ) -> tuple[tuple[int, int], ...] | None:
        if stance is None:
            return None
        names = [arm.name for arm in self.machine.arms]
        for name in stance:
            validation.one_of("stance", name, names)
        missing = [name for name in names if name not in stance]
        if missing:
            raise ShapeError("stance", dict(stance), f"expected a hold for each arm; {missing[0]} has none")
        places = holds.places()
        return tuple(places[structure[stance[name]].id] for name in names)

    def _impossible(self, holds: GridHolds, start: Ints, goal: Ints) -> tuple[tuple[str, ...], str]:
        """Separating holds and reason, or an empty reason."""
        flood, bridges = self.relaxed_tables
        places = flood.places(holds)
        ours, theirs = (np.unique(labels[labels >= 0]) for labels in (places.at(start), places.at(goal)))
        if not len(ours) or not len(theirs):
            where, cells = ("start", start) if not len(ours) else ("goal", goal)
            body = np.zeros(places.label.shape, dtype=bool)
            places.mark(body, cells)
            held = bridges.touched_from(body, holds)
            return bridges.names(held, holds), f"three hands have no three holds at the {where}"
        root = bridges.merged(places, holds, ours, theirs)
        reached = np.isin(root, root[ours])
        if reached[theirs].any():
            return (), ""
        # Label -1 is the last entry
        here = np.append(reached, False)[places.label]
        there = np.append(np.isin(root, root[theirs]), False)[places.label]
        cut = bridges.separating(here, there, holds)
        return cut, f"no two hands can carry the body past {', '.join(cut[:4])}{' ...' if len(cut) > 4 else ''}"

    def _path(self, outcome: Outcome, holds: GridHolds) -> tuple[Step, ...]:
        return () if outcome.way is None else self._router.steps(outcome.way, holds)
