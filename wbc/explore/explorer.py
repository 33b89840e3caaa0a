"""What else could the robot have done: in a tick, by self-motion at one target, and along a path."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import groupby, pairwise, product
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import InfeasibleError, RangeError, ShapeError
from wbc.explore.rows import StackRows
from wbc.multibody import mass_matrix
from wbc.resolvers.fsp import Criterion, SolutionSpace, best, orthogonal
from wbc.stack.declaration import Declaration
from wbc.trajectory import Law, time_optimal
from wbc.validation import Array

#: Step of a trace [rad or m]
STEP = 0.05
#: Steps of a trace each way, at most
MOST = 2000
#: How often a step is halved before the curve ends
HALVINGS = 8
#: A change of branch is looked at in steps of a joint of so much [rad or m]
CLEAR = 0.1
#: Configurations of a population differ by this at least [rad or m]
APART = 0.02
#: Distance beside a configuration at which others are looked for [rad or m]
BESIDE = 0.15


@dataclass(frozen=True, eq=False)
class Choices:
    """All rates of a tick that do the goals.

    Attributes:
        space: see :class:`wbc.resolvers.fsp.SolutionSpace`. optima: name of a criterion -> the best rates by it [nv].
        values: (name, name) -> value of the first criterion at the optimum of the second.
        lower, upper: least and largest rate of every joint in the space within the limits of speed and of position
            over ``dt`` [nv]; NaN where no rates keep all of them.
    """

    space: SolutionSpace
    optima: Mapping[str, Array]
    values: Mapping[tuple[str, str], float]
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False)
class Piece:
    """A curve of self-motion: configurations that all meet the goals.

    Attributes:
        q: in order [count, nq]. closed: whether it comes back to its first.
        ends: what stops it at its first and last configuration: a limit or margin, ``singular`` or ``long``; empty
            where it is closed.
        broken: of every configuration the limit or margin that does not hold, empty where all do. Beyond limits, full
            turns of joints are not counted.
        free: how many directions of self-motion there are: with more than one the curve is one of many.
    """

    q: Array
    closed: bool
    ends: tuple[str, str]
    broken: tuple[str, ...]
    free: int

    @property
    def windows(self) -> tuple[tuple[int, int, str], ...]:
        """(first, last, limit or margin) of the stretches of q where one does not hold."""
        runs = [list(run) for _, run in groupby(range(len(self.q)), key=self.broken.__getitem__)]
        return tuple((run[0], run[-1], self.broken[run[0]]) for run in runs if self.broken[run[0]])


@dataclass(frozen=True, eq=False)
class Resolution:
    """Configurations along a path.

    Attributes:
        s, q: path coordinates [count] and configurations there [count, nq]. changes: indices at which the branch
            changes: there the configuration before has the same s. cost: sum of squared steps, with what changes cost.
        nodes: configurations that were compared.
    """

    s: Array
    q: Array
    changes: tuple[int, ...]
    cost: float
    nodes: int

    def law(self, velocity: Any, acceleration: Any) -> Law:
        """The fastest law of motion, see :func:`wbc.trajectory.time_optimal`; where the branch changes it is at rest
        before and after, and goes straight in the joints.

        Raises:
            WbcError: limits that are none.
        """
        cuts, parts = [0, *self.changes, len(self.q)], list[Array]()
        for first, last in pairwise(cuts):
            parts += [self.q[first - 1 : first + 1]] * (first > 0) + [self.q[first:last]] * (last > first + 1)
        laws = [time_optimal(part, velocity, acceleration) for part in parts]
        return reduce(lambda before, after: before.then(after), laws)


class Explorer:
    """The solutions of a stack's goals.

        explorer = Explorer(stack, q)
        explorer.tick(q).optima["least norm"]
        explorer.pieces(q)

    Args:
        stack: its goals, margins and the robot's position limits. q: targets that are not given are where it has them.
        goals, values: see :class:`StackRows`.

    Raises:
        WbcError: bad input.
    """

    def __init__(
        self,
        stack: Declaration,
        q: Any,
        goals: Iterable[str] | None = None,
        values: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> None:
        validation.instance("stack", stack, Declaration, "a wbc.Stack")
        self.rows = StackRows(stack, q, goals, values or {})
        self.robot = stack.robot

    def tick(
        self, q: Any, rates: Any = None, criteria: Mapping[str, Criterion] | None = None, dt: float = 0.01
    ) -> Choices:
        """The solution space of a tick, the optimum by each criterion, and how far each joint could have gone.

        Args:
            q: [nq]. rates: of the goals' rows; None: what the tick asks for, -gain e. dt: of the position limits [s].
            criteria: by name; None: least norm, and least kinetic energy where the robot has masses.

        Raises:
            InfeasibleError: the goals contradict each other. WbcError: bad input.
        """
        q = self.robot.configuration("q", q)
        J = self.rows.errors(q)[1]
        x = self.rows.rates(q, rates)
        space = orthogonal(J, x, free=True)
        if criteria is None:
            criteria = {"least norm": Criterion()}
            inertia = mass_matrix(self.robot.model, self.robot.model.createData(), q)
            if np.linalg.eigvalsh(inertia)[0] > 1e-9:
                criteria["least energy"] = Criterion(inertia)
        optima = {name: best(space, c).v for name, c in criteria.items()}
        values = {(a, b): criteria[a](optima[b]) for a in criteria for b in criteria}
        return Choices(
            space, optima, values, *self._ranges(space, q, validation.scalar("dt", dt, low=0.0, open_low=True))
        )

    def trace(self, q: Any, *, step: float = STEP, through: bool = False, along: Any = None) -> Piece:
        """The curve of self-motion through the configuration nearest to q that meets the goals, both ways.

        Args:
            step: of the joints together [rad or m]. through: on beyond limits and margins, which are the windows then.
            along: where it sets out with several directions of self-motion [nv]; it turns as little as it can.

        Raises:
            InfeasibleError: no configuration near q meets the goals. RangeError: there is no self-motion.
        """
        rows = self.rows
        step = validation.scalar("step", step, low=0.0, open_low=True)
        start = rows.correct(self.robot.configuration("q", q))
        if start is None:
            raise InfeasibleError("q", q, "no configuration near it meets the goals")
        ways = rows.self_motions(start)
        if not len(ways):
            raise RangeError("q", q, "the goals leave no self-motion here")
        wanted = (
            np.ones(self.robot.nv) if along is None else validation.ordinary_array("along", along, (self.robot.nv,))
        )
        heading = ways[0] if len(ways) == 1 else ways.T @ (ways @ wanted)
        if np.linalg.norm(heading) < 1e-9:
            heading = ways[0]
        halves, ends = list[list[Array]](), list[str]()
        for sign in (1.0, -1.0):
            found, end = self._half(start, sign * heading / np.linalg.norm(heading), step, len(ways), through)
            halves.append(found)
            ends.append(end)
            if end == "closed":
                q_all = np.array([start, *found])
                return Piece(q_all, True, ("", ""), self._all_broken(q_all), len(ways))
        q_all = np.array([*halves[1][::-1], start, *halves[0]])
        return Piece(q_all, False, (ends[1], ends[0]), self._all_broken(q_all), len(ways))

    def pieces(
        self, q: Any, *, seeds: int = 40, seed: int = 0, step: float = STEP, through: bool = False
    ) -> tuple[Piece, ...]:
        """Connected pieces of the self-motion: the one of q, and those that random configurations lead to.

        With more than one direction of self-motion each is a curve of a surface, and two may lie on one surface. That
        these are all is what the seeds say, and no proof.

        Raises:
            RangeError: there is no self-motion. WbcError: bad input.
        """
        rng, rows = np.random.default_rng(validation.integer("seed", seed)), self.rows
        starts = [
            self.robot.configuration("q", q),
            *(rows.random(rng) for _ in range(validation.integer("seeds", seeds))),
        ]
        out: list[Piece] = []
        for first in starts:
            found = rows.correct(first)
            if found is not None and rows.broken(found):
                found = rows.turned(found)
            if found is None or (not through and rows.broken(found)):
                continue
            if any(self._apart(piece.q, found) < 1.5 * step for piece in out):
                continue
            out.append(self.trace(found, step=step, through=through))
        if not out:
            raise InfeasibleError("q", q, "no configuration was found that meets the goals within the limits")
        return tuple(out)

    def best(self, pieces: Sequence[Piece], criterion: Callable[[Array], float] | None = None) -> tuple[Array, float]:
        """(configuration, value) where a function of q is largest on the pieces, limits and margins kept.

        ``criterion``: None: the distance from position limits, as a share of half the range.

        Raises:
            InfeasibleError: no configuration keeps them.
        """
        value = self.rows.room if criterion is None else criterion
        held = [q for piece in pieces for q, broken in zip(piece.q, piece.broken, strict=True) if not broken]
        kept = [self.rows.turned(q) if self.rows.broken(q) else q for q in held]
        if not kept:
            raise InfeasibleError("pieces", len(pieces), "no configuration of them keeps limits and margins")
        values = [float(validation.called("criterion", value, q)) for q in kept]
        k = int(np.argmax(values))
        return kept[k], values[k]

    def along(
        self,
        targets: Mapping[str, Sequence[Any]],
        q0: Any,
        *,
        s: Any = None,
        anywhere: bool = False,
        change: float | None = None,
        nodes: int = 60,
        step: float = 0.3,
        seed: int = 0,
        criterion: Callable[[Array], float] | None = None,
    ) -> Resolution:
        """The least sum of squared steps along a path over all self-motions, by dynamic programming.

        At every target a population of configurations that keep limits and margins: those before, carried on, others
        beside them by self-motion, and random ones; then the cheapest chain with no joint moving more than ``step``.

        Args:
            targets: goal -> a target for each path coordinate. q0: where it starts, corrected to the first target.
            anywhere: it may start in any configuration, on another branch too; else in q0's.
            change: what it costs to change the branch on the way [rad^2, m^2]: at a target the arm leaves the path and
                comes back to it in another configuration, straight in the joints within limits and margins. None: it
                may not.
            nodes: of the population. step: longest of a joint between targets [rad or m].
            criterion: cost of a configuration, added to the squared steps.

        Raises:
            InfeasibleError: no chain; ``value`` is the number of the first target that none reaches.
        """
        names = list(validation.mapping("targets", targets))
        counts = {len(targets[name]) for name in names}
        if len(counts) != 1 or not min(counts):
            raise ShapeError("targets", sorted(counts), "expected as many targets for each goal")
        count = counts.pop()
        places = np.linspace(0.0, 1.0, count) if s is None else validation.ordinary_array("s", s, (count,))
        price = np.inf if change is None else validation.scalar("change", change, low=0.0)
        nodes, step = validation.integer("nodes", nodes, 1), validation.scalar("step", step, low=0.0, open_low=True)
        rng, start = np.random.default_rng(validation.integer("seed", seed)), self.robot.configuration("q0", q0)
        before, costs, total = start[None], np.zeros(1), 0
        #: of each target the population, whom each comes from, those that go on, and which of it they change from
        layers = list[tuple[Array, Any, Any, Any]]()
        for k in range(count):
            for name in names:
                self.rows.aim(name, targets[name][k])
            scatter = change is not None if k else anywhere
            others = self._population(list(before), rng, nodes if k or anywhere else 1, scatter)
            if not len(others):
                raise InfeasibleError("targets", k, "no configuration meets this target within limits and margins")
            own = np.array([0.0 if criterion is None else validation.called("criterion", criterion, q) for q in others])
            parent = np.zeros(len(others), dtype=int)
            if k:
                ways = self._ways(before, others)
                steps = np.where(np.abs(ways).max(axis=2) <= step, (ways**2).sum(axis=2), np.inf) + costs
                parent, costs = np.argmin(steps, axis=1), steps.min(axis=1)
            costs = costs + own if k else own
            source, best = np.arange(len(others)), int(np.argmin(costs))
            for j in np.flatnonzero(costs > costs[best] + price + own):
                if self._clear(others[best], others[j]):
                    costs[j], source[j] = costs[best] + price + own[j], best
            kept = np.flatnonzero(np.isfinite(costs))
            if not len(kept):
                raise InfeasibleError("targets", k, f"no step of {step:g} or less leads to this target")
            layers.append((others, parent, kept, source))
            before, costs, total = others[kept], costs[kept], total + len(others)
        at, chain = int(np.argmin(costs)), list[tuple[int, Array]]()
        for k, (others, parent, kept, source) in reversed(list(enumerate(layers))):
            here = kept[at]
            chain += [(k, others[j]) for j in dict.fromkeys((here, source[here]))]
            at = parent[source[here]]
        numbers = np.array([k for k, _ in chain[::-1]])
        changes = tuple((1 + np.flatnonzero(np.diff(numbers) == 0)).tolist())
        return Resolution(places[numbers], np.array([q for _, q in chain[::-1]]), changes, float(costs.min()), total)

    def _clear(self, a: Array, b: Array) -> bool:
        """Whether the straight way of the joints keeps limits and margins."""
        way = self.rows.between(a, b)
        shares = np.linspace(0.0, 1.0, 2 + int(np.abs(way).max() / CLEAR))
        return not any(self.rows.broken(self.rows.moved(a, share * way)) for share in shares)

    def step_by_step(self, targets: Mapping[str, Sequence[Any]], q0: Any, *, step: float = 0.3) -> tuple[Array, str]:
        """(configurations, what stopped them): the least step to each target in turn, as a pseudo-inverse goes."""
        q, out = self.robot.configuration("q0", q0), list[Array]()
        for k in range(len(next(iter(targets.values())))):
            for name, values in targets.items():
                self.rows.aim(name, values[k])
            found = self.rows.correct(q)
            if found is None:
                return np.array(out), f"target {k}: not reached"
            broken = self.rows.broken(found)
            if broken or (out and np.abs(self.rows.between(q, found)).max() > step):
                return np.array(out), f"target {k}: {broken or 'a step too long'}"
            q = found
            out.append(q)
        return np.array(out), ""

    def _population(self, seeds: list[Array], rng: np.random.Generator, nodes: int, scatter: bool) -> Array:
        """Configurations at the present targets, apart from each other: from those before, random ones if scattered,
        and, while there are too few, beside those that were found, by self-motion.
        """
        rows, out = self.rows, list[Array]()

        def take(first: Array) -> None:
            found = rows.correct(first)
            if scatter and found is not None and rows.broken(found):
                found = rows.turned(found)
            if found is not None and not rows.broken(found) and (not out or self._apart(np.array(out), found) > APART):
                out.append(found)

        # Of a scattered population a half at least is new
        for first in [
            *seeds[: nodes // 2 if scatter else nodes],
            *(rows.random(rng) for _ in range(2 * nodes * scatter)),
        ]:
            if len(out) < nodes:
                take(first)
        for k in range(3 * (nodes - len(out)) if nodes > 1 else 0):
            if not out or len(out) >= nodes:
                break
            q = out[int(rng.integers(len(out)))]
            ways = rows.self_motions(q)
            take(rows.moved(q, rng.normal(size=len(ways)) @ ways * BESIDE * (1 + k % 3)))
        return np.array(out).reshape(-1, self.robot.nq)

    def _all_broken(self, q: Array) -> tuple[str, ...]:
        """What does not hold at configurations, in whichever turn of the joints most does."""
        return tuple(self.rows.broken(x) and self.rows.broken(self.rows.turned(x)) for x in q)

    def _half(self, start: Array, heading: Array, step: float, free: int, through: bool) -> tuple[list[Array], str]:
        rows, q, out, length = self.rows, start, list[Array](), step
        for k in range(MOST):
            ways = rows.self_motions(q)
            if len(ways) != free:
                return out, "singular"
            turned = ways.T @ (ways @ heading)
            size = float(np.linalg.norm(turned))
            if size < 0.5:
                return out, "singular"
            for _ in range(HALVINGS):
                ahead = rows.correct(rows.moved(q, length * turned / size))
                if ahead is not None and np.linalg.norm(rows.between(q, ahead)) < 1.5 * length:
                    break
                length *= 0.5
            else:
                return out, "singular"
            broken = "" if through else rows.broken(ahead)
            if broken:
                return self._to_limit(q, ahead, broken, out)
            heading, q = turned / size, ahead
            length = min(step, 2.0 * length)
            out.append(q)
            if k > 2 and self._apart(start[None], q) < 0.75 * step:
                return out, "closed"
        return out, "long"

    def _to_limit(self, inside: Array, outside: Array, broken: str, out: list[Array]) -> tuple[list[Array], str]:
        """By halves to where the limit is met."""
        rows, way = self.rows, self.rows.between(inside, outside)
        low, high = 0.0, 1.0
        last = inside
        for _ in range(30):
            middle = 0.5 * (low + high)
            found = rows.correct(rows.moved(inside, middle * way))
            if found is None:
                break
            if rows.broken(found):
                high, broken = middle, rows.broken(found)
            else:
                low, last = middle, found
        out.append(last)
        return out, broken

    def _apart(self, many: Array, q: Array) -> float:
        """Distance of the nearest of many, full turns of turning joints not counted."""
        ways = many - q if self.robot.nq == self.robot.nv else np.array([self.rows.between(a, q) for a in many])
        turns = np.array([unit == "rad" for unit in self.robot.dof_units])
        ways[:, turns] = (ways[:, turns] + np.pi) % (2.0 * np.pi) - np.pi
        return float(np.linalg.norm(ways, axis=1).min())

    def _ways(self, before: Array, after: Array) -> Array:
        """Tangents from each of some configurations to each of others [after, before, nv]."""
        if self.robot.nq == self.robot.nv:
            return np.asarray(after[:, None] - before)
        return np.array([[self.rows.between(a, b) for a in before] for b in after])

    def _ranges(self, space: SolutionSpace, q: Array, dt: float) -> tuple[Array, Array]:
        """Least and largest rate of each joint: two linear programs a joint."""
        from wbc.linear_program import OPTIMAL, UNBOUNDED, least

        limits, D = self.robot.limits, space.directions
        low, high = -limits.velocity, limits.velocity.copy()
        at = self.robot.position_index >= 0
        place = q[self.robot.position_index[at]]
        low[at] = np.maximum(low[at], np.minimum(0.0, (limits.position_lower[at] - place) / dt))
        high[at] = np.minimum(high[at], np.maximum(0.0, (limits.position_upper[at] - place) / dt))
        g, nv = space.vectors[0], len(low)
        out = np.full((2, nv), np.nan)
        if not len(D):
            out[:] = g if (g >= low - 1e-9).all() and (g <= high + 1e-9).all() else np.nan
            return out[0], out[1]
        A, b = np.vstack((D.T, -D.T)), np.concatenate((high - g, g - low))
        A, b = A[np.isfinite(b)], b[np.isfinite(b)]
        for k, side in product(range(nv), range(2)):
            sign = 1.0 - 2.0 * side
            found = least(sign * D.T[k], A if len(A) else None, b if len(A) else None)
            if found.status == OPTIMAL:
                out[side, k] = g[k] + sign * found.fun
            elif found.status == UNBOUNDED:
                out[side, k] = -sign * np.inf
        return out[0], out[1]
