"""Plans between configurations under the constraints of a stack."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import count
from math import sqrt
from time import perf_counter, process_time
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.controller.handles import Handles
from wbc.errors import InfeasibleError
from wbc.plan.coordinates import PlanningCoordinates
from wbc.plan.goals import Goal, TargetGoal, goals_of
from wbc.plan.native import NativePlanner
from wbc.plan.path import PlannedPath
from wbc.plan.rows import PlanningRows, RowsBuilder
from wbc.plan.scene import OPEN, PlanningScene
from wbc.plan.stand_in import without_distances
from wbc.stack.artifact import compile_stack
from wbc.stack.declaration import Declaration
from wbc.stack.tables import stops
from wbc.tasks import Fixed
from wbc.trajectory.paths.joint_paths import joint_polyline
from wbc.validation import Array

#: Samples between two looks at the clock and at Ctrl-C
SLICE = 50
#: Distances are kept longer by this while a path is searched [m], less where the start or the goal is nearer; after
#: every search that ends without a path a quarter of it
PAD = 2e-3
#: and no less than this [m]. Where start or goal have less than twice the first, an edge leads to more room
LEAST_PAD = 1e-5
#: Samples of the first search; one that ends without a path is followed by one of twice as many
FIRST = 2000
#: Searches without a path before it is looked for a proof that there is none
PROOF = 1
#: Length of the longest edges against the diagonal of the space
RANGE = 0.2
#: and against that in one search after the other: some spaces want short ones, some long ones
RANGES = (1.0, 0.5, 2.0)
#: Descents to configurations that meet a target
DESCENTS = 100
#: The first search is the last where its path is longer than the straight line to its goal by no more than this share
DETOUR = 0.3
#: and each one behind it where the shortest is by so much more: the longer it is, the more others may be shorter
MORE_DETOUR = 0.1
#: Where the first of them took more samples than this, both are less by as much
EASY = 300
#: Samples of searches for another path, against those of the first
MORE = 2
#: Rounds at most in which corners of a path are pulled in and cut off
ROUNDS = 4
#: Goals of one target at most: those nearest to the start
BRANCHES = 4
#: Goals nearer to each other than this are one [rad, or characteristic lengths]
APART = 0.05
#: Coordinates without limits are searched this far from start and goals [rad, or characteristic lengths]
BEYOND = np.pi
#: Equalities of start and goals hold within this [m, rad]
MET = 1e-5


@dataclass(frozen=True)
class PlanningOptions:
    """How paths are searched.

    Attributes:
        seed: of the samples. The path is a function of it, of start, goal and run-time values where the time does not
            end the search.
        seconds: after which it is over [s].
        paths: searched at most before the shortest is returned; fewer where one leads nearly straight to the goal.
        cuts: tries to cut a path short, for each of them.
        range: edges of the trees are no longer [rad, or characteristic lengths]; None: a share of the space.
        step: of edges that are projected onto equality rows [rad, or characteristic lengths].

    Raises:
        RangeError, ShapeError, NotFiniteError: a number that is none of these.
    """

    seed: int = 0
    seconds: float = 10.0
    paths: int = 4
    cuts: int = 20
    range: float | None = None
    step: float = 0.1

    def __post_init__(self) -> None:
        validation.integer("seed", self.seed)
        validation.integer("paths", self.paths, 1)
        validation.integer("cuts", self.cuts)
        for name in ("seconds", "range", "step"):
            given, unit = getattr(self, name), "s" if name == "seconds" else ""
            if given is not None or name != "range":
                object.__setattr__(self, name, validation.scalar(name, given, low=0.0, open_low=True, unit=unit))


#: Options where none are given
USUAL = PlanningOptions()


class NoPathError(InfeasibleError):
    """No path was found in the time.

    Attributes:
        nearest: configuration that was reached from the start, nearest to a goal [nq].
        distance: its distance from that goal [rad, or characteristic lengths].
    """

    nearest: Array
    distance: float


class MotionPlanner(Handles):
    """A planner of a stack, kept for many queries. Made by :meth:`wbc.Stack.planner`.

        planner = stack.planner()
        planner["shelf"].pose = pose                     # run-time values, as of a controller
        path = planner.plan(q0, {"hand": target})        # or a configuration, or a list of goals
        law = path.law()

    Two trees grow towards each other over the joints. An edge is free where the distance of every pair of bodies is
    proven between samples, and where the equalities (holds, loops, kept tasks) and margins (boxes, cones, planes,
    regions) of the stack hold; onto these configurations are projected by Newton steps. docs/plan.md

    Attributes:
        stack: whose constraints hold. kept: names of tasks whose errors stay 0 on every path.
        coordinates: in which paths are planned.

    Args:
        keep: tasks whose errors stay 0 on the whole path: a level cup, a tray between two hands.

    Raises:
        UnknownNameError: no such task. UnsupportedJointError: a joint without a symbolic model.
        CompileError: no compiler, and nothing was compiled ahead.
    """

    _changing = ("coordinates",)

    def __init__(self, stack: Declaration, keep: Iterable[str] = ()) -> None:
        from wbc import __version__

        declared = validation.instance("stack", stack, Declaration, "a wbc Stack").commanding("velocity")
        names = [entry.name for entry in declared.tasks]
        wanted = (keep,) if isinstance(keep, str) else validation.strings("keep", keep)
        self.kept = tuple(validation.one_of("keep", name, names) for name in wanted)
        self.stack = declared
        light = without_distances(declared)
        self._controller = CompiledStack(light, compile_stack(light, "vm", __version__), "daqp")
        self._core = core_of(self._controller)
        super().__init__(self._core.handles, light)
        self._idle = frozenset(names) - set(self.kept)
        self._stops = stops(declared, self._core.layout)
        self._places = PlanningScene.places_of(self._core)
        self._scene: PlanningScene | None = None
        self._use(PlanningCoordinates.of(declared.robot, declared.length))

    def plan(self, q0: Any, goal: Any, options: PlanningOptions | None = None, **changes: Any) -> PlannedPath:
        """A path from a configuration to a goal, on which every hard row of the stack holds.

        Args:
            q0: where it begins [nq]; run-time values that nobody set are taken from it, as by a controller.
            goal: a configuration [nq]; targets by task, ``{"hand": pose}``, of which all branches are goals; or a
                list of these, of which one is to be reached.
            options, changes: see :class:`PlanningOptions`; ``planner.plan(q0, goal, seed=1, seconds=2.0)``.

        Raises:
            UnknownNameError, ShapeError, NotFiniteError, RotationError, RangeError: bad input.
            CommandError: hard rows on velocities that are not those of a base which turns in place and drives.
            InfeasibleError: start or goal break a constraint (which pair and by how much, or which row), or no
                configuration that meets the goal was found.
            NoPathError: none was found in the time; it has the nearest configuration that was reached.
        """
        search = self._search(q0, goal, options, changes)
        search.check_start()
        search.find_goals()
        points, length = search.paths()
        rolling = self.coordinates.rolling
        path = PlannedPath(
            coordinates=self.coordinates,
            native=search.native,
            stack=self.stack,
            corners=points if rolling is None else rolling.rolled(points, self._wheels),
            length=length,
            seconds=perf_counter() - search.begin,
            shortening=search.shortening,
            nodes=search.nodes,
        )
        # Wheels that are not round, or have limits
        if self._wheels and path.length > 0.0 and (fault := path.fault(joint_polyline(path.corners))) is not None:
            raise InfeasibleError("path", *fault)
        return path

    def branches(self, q0: Any, goal: Any, options: PlanningOptions | None = None, **changes: Any) -> Array:
        """Free configurations that meet a goal, those nearest to q0 first, in the planner's coordinates [m, n].

        Args:
            q0, goal, options, changes: as of :meth:`plan`.

        Raises:
            as :meth:`plan`; InfeasibleError: there is none.
        """
        search = self._search(q0, goal, options, changes)
        search.find_goals()
        return np.array(search.goals)

    def _use(self, coordinates: PlanningCoordinates) -> None:
        self.coordinates = coordinates
        #: of wheels that follow a base
        self._wheels = [k for k, scale in enumerate(coordinates.scale) if np.isinf(scale)]
        self._limits = coordinates.limits(self._stops.lower, self._stops.upper)
        self._builder = RowsBuilder(self._core, coordinates, self.kept)
        self._rows: dict[tuple[bytes, tuple[str, ...]], PlanningRows] = {}
        self._native: NativePlanner | None = None
        every, self._fixed = np.arange(self.stack.robot.nv), dict[str, list[int]]()
        for entry in self.stack.constraints:
            if isinstance(entry.item, Fixed):
                dofs = [every[self.stack.robot.dofs(name)] for name in entry.item.joints]
                self._fixed[entry.name] = np.flatnonzero(np.isin(coordinates.dofs, np.concatenate(dofs))).tolist()

    def _search(self, q0: Any, goal: Any, options: PlanningOptions | None, changes: dict[str, Any]) -> _Search:
        for name in changes:
            validation.one_of("options", name, PlanningOptions.__dataclass_fields__)
        given = validation.instance(
            "options", USUAL if options is None else options, PlanningOptions, "PlanningOptions"
        )
        chosen = replace(given, **changes) if changes else given
        q = self.stack.robot.configuration("q0", q0)
        goals = goals_of(self._core, goal)
        # Of tasks that count for nothing no value is taken
        idle = self._idle.difference(*(goal.names for goal in goals if isinstance(goal, TargetGoal)))
        self._core.initialise({slot: name for slot, name in self._core.first.items() if name not in idle}, q)
        self._core.waiting = {}
        rolling = self._builder.rolling(self._switches)
        if rolling != self.coordinates.rolling or not self.coordinates.suits(q):
            self._use(PlanningCoordinates.of(self.stack.robot, self.stack.length, q, rolling))
        return _Search(self, q, goals, chosen)

    @property
    def values(self) -> Array:
        """All run-time values, as :meth:`rows` take them."""
        return self._core.tick.p

    def scene(self, coordinates: PlanningCoordinates | None = None) -> PlanningScene:
        """The bodies that are kept apart, at the present run-time values; moved by other coordinates where given."""
        moved_by, key = coordinates or self.coordinates, self._core.tick.p[self._places].tobytes() + self._switches
        if self._scene is None or self._scene.key != key or self._scene.coordinates is not moved_by:
            self._scene = PlanningScene.of(self._core, moved_by, key)
        return self._scene

    def rows(self, goals: tuple[str, ...] = ()) -> PlanningRows:
        """Rows of every configuration of a path, and of tasks that are met at its end besides."""
        key = (self._switches, goals)
        if key not in self._rows:
            self._rows[key] = self._builder.rows(goals)
        return self._rows[key]

    @property
    def _switches(self) -> bytes:
        """What is enabled."""
        return bytes([handle.enabled for handle in self._core.handles.values()])

    def native(self, q: Array) -> NativePlanner:
        """What is kept of the scene and the rows; made again where their run-time values have changed."""
        scene = self.scene()
        if self._native is None or self._native.scene.key != scene.key:
            self._native = NativePlanner(scene, self.rows(), self._core.tick.p, self._limits)
        if self._fixed:
            low, high = (side.copy() for side in self._limits)
            fixed = [k for name, numbers in self._fixed.items() if self._core.handles[name].enabled for k in numbers]
            low[fixed] = high[fixed] = self.coordinates.of_configuration(q)[fixed]
            self._native.limit(low, high)
        return self._native


class _Search:
    """One query."""

    def __init__(self, planner: MotionPlanner, q: Array, wanted: tuple[Goal, ...], options: PlanningOptions) -> None:
        self.planner, self.wanted, self.options, self.native = planner, wanted, options, planner.native(q)
        # What is compiled once for many queries is no part of the time of one
        for goal in wanted:
            _ = planner.rows(goal.names).compiled if isinstance(goal, TargetGoal) else None
        self.rows, self.begin = self.native.path_rows, perf_counter()
        self.end = self.begin + options.seconds
        self.native.pad(LEAST_PAD)
        self.native.begin(options.seed)
        self.native.set(step=options.step)
        self.q0, self.start, self.goals = q, planner.coordinates.of_configuration(q), list[Array]()
        #: near start and goals, with room on all sides
        self.first, self.last = self.start, list[Array]()
        self.nodes, self.pad, self.shortening, self.drawn = (0, 0), PAD, 0.0, 0
        #: whether joints without end may turn the other way, too: where no path was found the short way
        self.rounds = False

    def check_start(self) -> None:
        """Refuse a start that breaks a constraint."""
        if reason := self.fault(self.start, self.q0):
            raise InfeasibleError("q0", *reason)
        self.first = self.native.away(self.start, 2.0 * PAD)

    def fault(self, x: Array, q: Array | None = None) -> tuple[float, str] | None:
        """(by how much, which constraint) x breaks most, or q, of which it was made; None: none."""
        native, coordinates = self.native, self.planner.coordinates
        beyond = np.maximum(native.low - x, x - native.high)
        worst = int(np.argmax(beyond))
        if beyond[worst] > MET:
            limit = native.low[worst] if x[worst] < native.low[worst] else native.high[worst]
            what = f"{coordinates.names[worst]} is beyond its limit of {limit:.4g} {coordinates.units[worst]}"
            return float(x[worst]), what
        np.minimum(np.maximum(x, native.low), native.high, out=x)
        if q is not None and abs((coupled := coordinates.uncoupled(q))[0]) > MET:
            return coupled
        if (rows := self.rows).count:
            values, off = rows.off(x, self.planner.values)
            worst = int(np.argmax(off))
            if not off[worst] <= MET:
                return float(values[worst]), f"{rows.labels[worst]} does not hold, off by {off[worst]:.3g}"
            if native.broken(x) > 1e-8 and (fixed := native.projected(x)) is not None:
                x[:] = fixed
        if native.margin(x) < -OPEN and (nearest := native.scene.nearest(x)) is not None:
            where = f"{nearest.first} and {nearest.second} are {1e3 * nearest.distance:.2f} mm apart"
            return nearest.distance, f"{where}, {1e3 * nearest.required:.2f} mm required"
        return None

    def find_goals(self) -> None:
        """Free configurations of all goals that are wanted."""
        faults = list[tuple[float, str]]()
        for goal in self.wanted:
            if isinstance(goal, TargetGoal):
                self._widen(self.start)
                faults += self._descend(goal)
                continue
            x = self.planner.coordinates.of_configuration(goal, self.start)
            x[self.planner._wheels] = self.start[self.planner._wheels]
            self._widen(x)
            if reason := self.fault(x, goal):
                faults.append(reason)
            else:
                self.goals.append(x)
        if not self.goals:
            raise InfeasibleError("goal", *faults[0])
        self.last = [self.native.away(x, 2.0 * PAD) for x in self.goals]
        room = min(self.native.margin(self.first), max(map(self.native.margin, self.last)))
        self.pad = max(LEAST_PAD, min(PAD, 0.5 * (room + OPEN)))

    def _widen(self, x: Array) -> None:
        """Samples of coordinates without limits are drawn about start and goals."""
        native = self.native
        if native.bounded:
            return
        scale = self.planner.coordinates.scale
        reach = BEYOND * np.where(np.isfinite(scale), scale, 0.0)
        low, high = np.minimum(self.start, x) - reach, np.maximum(self.start, x) + reach
        native.sample_low[:] = np.where(np.isfinite(native.low), native.low, low)
        native.sample_high[:] = np.where(np.isfinite(native.high), native.high, high)

    def _descend(self, goal: TargetGoal) -> list[tuple[float, str]]:
        """Add free configurations that meet a goal; else what is wrong with it."""
        native, values, rows = self.native, self.planner.values, self.planner.rows(goal.names)
        before, names = values.copy(), ", ".join(goal.names)
        missed, colliding, free = reached = (list[Array](), list[Array](), list[Array]())
        try:
            for slot, numbers in goal.numbers:
                values[slot.span] = numbers
            native.use("goal", rows)
            for k in range(DESCENTS):
                if k % SLICE == SLICE - 1 and perf_counter() > self.end:
                    break
                how, x = native.reach(None if k else self.start)
                if how < 2 or all(native.distance(x, other) >= APART for other in free):
                    reached[how].append(x)
            off = [float(rows.off(x, values)[1][: rows.equalities].max()) for x in missed if not free]
        finally:
            values[:] = before
        self.goals += sorted(free, key=lambda x: native.distance(x, self.start))[:BRANCHES]
        if free:
            return []
        if colliding := colliding[:BRANCHES]:
            worst = [self.fault(x) for x in colliding]
            least, what = max((w for w in worst if w is not None), default=(0.0, "not within limits"))
            return [(least, f"none of {len(colliding)} configurations that meet {names} is free; of the best {what}")]
        at_best = f"at the nearest a row of the goal is off by {min(off):.3g}"
        return [(min(off), f"no configuration that meets {names} was found in {DESCENTS} descents; {at_best}")]

    def paths(self) -> tuple[Array, float]:
        """The shortest of some paths, and its length."""
        native, options = self.native, self.options
        best: Array | None = None
        shortest, samples, searched, ease = np.inf, FIRST, 0, 1.0
        for attempt in count():
            if searched >= options.paths or (attempt and perf_counter() > self.end):
                break
            points = self._one(attempt, samples, shortest)
            if points is None and best is None:
                if attempt == PROOF and all(
                    reasons := [native.scene.separation(native.low, native.high, self.start, x) for x in self.goals]
                ):
                    raise self._nothing(f"no path leads to any of {len(reasons)} goals: {'; '.join(set(reasons))}")
                samples *= 2
                self.rounds = True
                self.pad = max(LEAST_PAD, 0.25 * self.pad)
                continue
            searched += 1
            if points is not None and (length := native.length(points)) < shortest:
                if best is None and self.drawn:
                    samples, ease = MORE * self.drawn, min(1.0, EASY / self.drawn)
                best, shortest = points, length
            assert best is not None
            enough = 1.0 + ease * (DETOUR + MORE_DETOUR * (searched - 1))
            if not self.drawn or shortest <= enough * native.distance(best[0], best[-1]):
                break
        if best is None:
            raise self._nothing()
        return best, shortest

    def _one(self, attempt: int, samples: int, shortest: float) -> Array | None:
        """A path of one search, made shorter."""
        native, options = self.native, self.options
        native.pad(self.pad)
        native.go_round(self.rounds)
        native.begin(options.seed + 7919 * attempt)
        reach = RANGE * native.distance(native.sample_low, native.sample_high)
        longest_edge = reach if options.range is None else options.range
        # Of uniform samples about the same share is so near at any number of coordinates
        domain = reach * max(0.5, 2.0 - 2.7 / sqrt(len(native.low)))
        native.set(longest=shortest, range=longest_edge * RANGES[attempt % len(RANGES)], near_enough=domain)
        native.root(0, self.first)
        roots = [k for k, x in enumerate(self.last) if native.free(x)]
        for k in roots:
            native.root(1, self.last[k])
        if attempt == 0 and not self.rows.count:
            for k in roots:
                if len(way := native.way(self.first, self.last[k])) > 1:
                    return self._ended(way, k)
        for self.drawn in range(SLICE, samples + SLICE, SLICE):
            met = native.grow(SLICE)
            if met or perf_counter() > self.end:
                break
        self.nodes = native.nodes
        if met != 1:
            return None
        points = native.path()
        end = min(roots, key=lambda k: native.distance(points[-1], self._turned(k, points[-1])[0]))
        begin = process_time()
        points = native.shortened(self._ended(points, end), options.cuts, ROUNDS)
        self.shortening += process_time() - begin
        return points

    def _ended(self, points: Array, goal: int) -> Array:
        """A path between what is near start and goal, with both."""
        whole = [points] if self.first is self.start else [self.start[None], points]
        if self.last[goal] is not self.goals[goal]:
            whole.append(self._turned(goal, points[-1])[1][None])
        return np.concatenate(whole)

    def _turned(self, goal: int, x: Array) -> tuple[Array, Array]:
        """What is near a goal, and the goal, as joints without end came round to them at x."""
        off, period = x - self.last[goal], self.native.period
        turns = period * np.round(np.divide(off, period, out=np.zeros_like(off), where=period > 0.0))
        return self.last[goal] + turns, self.goals[goal] + turns

    def _nothing(self, reason: str = "") -> NoPathError:
        tree, goals = self.native.node(0), self.last
        scale = self.planner.coordinates.scale
        ends = (self._turned(k, tree)[0] for k in range(len(goals)))
        off = np.array([np.linalg.norm((tree - x) / scale, axis=1) for x in ends])
        goal, node = np.unravel_index(int(off.argmin()), off.shape)
        distance = float(off[goal, node])
        searched = (
            f"no path was found in {self.options.seconds:.3g} s, with {self.nodes[0]} configurations reached from the "
            f"start and {self.nodes[1]} from {len(goals)} goals; the nearest is {distance:.3g} rad off a goal"
        )
        error = NoPathError("goal", distance, reason or searched)
        error.nearest, error.distance = self.planner.coordinates.configuration(tree[node]), distance
        return error
