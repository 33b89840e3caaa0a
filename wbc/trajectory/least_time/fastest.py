"""The fastest timing along a path, on a grid, that satisfies limits at its points."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from wbc import extras
from wbc.errors import InfeasibleError, RangeError, SolverError
from wbc.trajectory.laws.certificate import Check
from wbc.trajectory.laws.limits import MotionLimits
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.least_time.checks import Force, at_rest
from wbc.trajectory.least_time.rows import Grid, PathRows, accelerations, squared_speed
from wbc.trajectory.paths.path import Path
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.trajectory.least_time.reachability import SpeedProgram

#: Intervals of a path, at least
LEAST = 500
#: Intervals for each piece of a path
PER_PIECE = 125
#: Intervals on each piece, at least
LEAST_ON_PIECE = 8

#: Tangents at a knot that differ by less than this share are one tangent
SMOOTH = 1e-9


@dataclass(frozen=True)
class Shrunk:
    """Factors by which limits are made smaller before they are met on the grid."""

    velocity: float = 1.0
    acceleration: float = 1.0
    speed: float = 1.0
    force: float = 1.0


@dataclass(frozen=True, eq=False)
class FastestTask:
    """What is asked: the fastest motion along a path within limits, from one path speed to another.

    Attributes:
        path, limits: as given. speeds, forces: checks of speeds, and of what depends on accelerations.
        start, end: path speeds ds/dt at the ends.
    """

    path: Path
    limits: MotionLimits
    speeds: tuple[Check, ...] = ()
    forces: tuple[Force, ...] = ()
    start: float = 0.0
    end: float = 0.0

    @property
    def checks(self) -> tuple[Check, ...]:
        """All of them."""
        return (*self.speeds, *self.forces)

    @property
    def rests(self) -> bool:
        """Whether it begins and ends at rest."""
        return self.start == 0.0 and self.end == 0.0

    def timing(self, refined: int = 1, count: int | None = None, shrunk: Shrunk | None = None) -> Timing:
        """The fastest timing on a grid that is ``refined`` times as fine as usual, or has ``count`` intervals.

        Raises:
            InfeasibleError: standing still or the end speeds exceed limits. RangeError: nothing limits some interval.
        """
        corners = _corners(self.path)
        pieces = len(self.path.knots) - 1
        total = count or refined * max(LEAST, PER_PIECE * pieces)
        points, speeds = [], []
        for k, (first, last) in enumerate(pairwise(corners)):
            share = (self.path.knots[last] - self.path.knots[first]) / self.path.length
            least = min(LEAST_ON_PIECE * refined, max(2, total // pieces))
            grid = Grid.over(self.path, first, last, max(2, round(total * share)), least)
            start = self.start if k == 0 else 0.0
            end = self.end if last == pieces else 0.0
            speed = self._section(grid, shrunk or Shrunk(), start, end)
            points.append(grid.s if k == 0 else grid.s[1:])
            speeds.append(speed if k == 0 else speed[1:])
        return Timing.accelerations(np.concatenate(points), np.concatenate(speeds))

    def _section(self, grid: Grid, shrunk: Shrunk, start: float, end: float) -> Array:
        """Path speeds at the points of a grid over one smooth section."""
        rows = self._rows(grid, shrunk)
        _limited(grid, rows)
        # toppra brings matplotlib with it, which takes longer than all else that a command loads
        extras.require("laws", "a least-time law", "toppra")
        from wbc.trajectory.least_time.reachability import SpeedProgram

        program = SpeedProgram(grid.s, rows, self._squared(grid, shrunk))
        found = program.fastest(start, end)
        if found.speed is not None:
            return found.speed
        if start == 0.0 and end == 0.0:
            raise SolverError("path", grid.s[[0, -1]].tolist(), "no path speeds were found between these coordinates")
        raise _unreachable(program, start, end)

    def _rows(self, grid: Grid, shrunk: Shrunk) -> list[PathRows]:
        rows = []
        if self.limits.acceleration is not None:
            rows.append(accelerations(self.path, grid, self.limits.acceleration / shrunk.acceleration))
        if self.forces:
            position, first, second = (grid.at_ends(self.path, order) for order in (0, 1, 2))
            flat = [x.reshape(-1, *x.shape[2:]) for x in (position, first, second)]
            for force in self.forces:
                rows.append(self._force_rows(force, grid, flat).shrunk(shrunk.force))
        return rows

    def _force_rows(self, force: Force, grid: Grid, state: list[Array]) -> PathRows:
        position, first, second = state
        rest = at_rest(force, position)
        if rest.max() > 1.0 + 1e-9:
            place, column = (int(k) for k in np.unravel_index(int(rest.argmax()), rest.shape))
            where = float(grid.s[place // 2 + place % 2])
            raise InfeasibleError(
                force.name,
                float(rest.max()),
                f"standing still at s = {where:g} takes {rest.max():.6g} of what is allowed of {force.unit(column)}",
            )
        a = force.ratios(position, np.zeros_like(first), first) - rest
        b = force.ratios(position, first, second) - rest
        shape = (len(grid.piece), 2, -1)
        return PathRows(a.reshape(shape), b.reshape(shape), np.minimum(rest, 1.0).reshape(shape), both=False)

    def _squared(self, grid: Grid, shrunk: Shrunk) -> Array:
        """Upper bounds of the squared path speed at the points of the grid."""
        out = np.full(len(grid.s), np.inf)
        first = grid.at_ends(self.path, 1)
        if self.limits.velocity is not None:
            out = np.minimum(out, squared_speed(first, self.limits.velocity / shrunk.velocity))
        if self.speeds:
            position = grid.at_ends(self.path, 0)
            flat = position.reshape(-1, *position.shape[2:]), first.reshape(-1, first.shape[2])
            for check in self.speeds:
                used = check.ratios(*flat, np.zeros_like(flat[1])).reshape(len(grid.piece), 2, -1)
                out = np.minimum(out, squared_speed(used, np.full(used.shape[2], 1.0 / shrunk.speed)))
        return out


def _corners(path: Path) -> list[int]:
    """Numbers of the knots where the tangent jumps, both ends included: there every motion has to stop."""
    inner = path.knots[1:-1]
    before = path.evaluate(inner, 1, np.arange(len(inner)))
    after = path.evaluate(inner, 1, np.arange(1, len(inner) + 1))
    size = np.maximum(np.abs(before), np.abs(after)).max(axis=1, initial=0.0)
    jump = np.abs(after - before).max(axis=1, initial=0.0)
    return [0, *(int(k) + 1 for k in np.flatnonzero(jump > SMOOTH * size)), len(path.knots) - 1]


def _limited(grid: Grid, rows: list[PathRows]) -> None:
    """Refuses intervals on which no row bounds the path acceleration."""
    bounded = np.zeros(len(grid.piece), dtype=bool)
    for r in rows:
        bounded |= (np.abs(r.a) + np.abs(r.b)).max(axis=(1, 2), initial=0.0) > 0.0
    if not bounded.all():
        k = int(np.flatnonzero(~bounded)[0])
        raise RangeError(
            "path",
            grid.s[k : k + 2].tolist(),
            "between these coordinates it stands still, or moves only what has no limit of acceleration or force",
        )


def _unreachable(program: SpeedProgram, start: float, end: float) -> InfeasibleError:
    """What to say when no motion leads from one path speed to another."""
    reach = program.fastest(start, end).start
    if reach is not None and start > reach[1]:
        return InfeasibleError(
            "start_speed", start, f"the largest path speed that works with this end speed is {_below(reach[1])}"
        )
    back = program.reversed().fastest(end, start).start
    if back is not None:
        return InfeasibleError(
            "end_speed", end, f"the largest path speed that works with this start speed is {_below(back[1])}"
        )
    stops = program.fastest(start, 0.0).start
    most = 0.0 if stops is None else stops[1]
    return InfeasibleError(
        "start_speed", start, f"the largest path speed from which the path can be followed is {_below(most)}"
    )


def _below(speed: float) -> str:
    """A speed in digits that do not round it up, and a little less, so that it works."""
    return f"{speed * (1.0 - 1e-5):.6g}"
