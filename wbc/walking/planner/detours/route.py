"""A body path round what cannot be passed: from cell to cell, as a path."""

from __future__ import annotations

import heapq
import itertools
import time
from collections.abc import Collection, Generator, Mapping
from dataclasses import dataclass
from math import ceil, pi

import numpy as np
import pinocchio as pin

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.around import NONE_MET, Around, around
from wbc.walking.planner.detours.cell_grips import cell_grips
from wbc.walking.planner.detours.cell_search import CellNode, CellSearch, Outcome
from wbc.walking.planner.detours.cells import ALONG, BESIDE, NARROW, WIDE, Cells, CellSpacing, Ints, cells_about
from wbc.walking.planner.slices import Allowance

#: How fast the body goes down [m/s] and turns [rad/s]
DOWN_SPEED, TURN_SPEED = 0.05, 0.1
#: Half of the time over which its velocity changes [s]
CORNER = 0.3
#: Least speed beside the path [m/s]
SLOW = 0.01
#: What a cell off the path costs for each m beside, m lower and rad turned; a step along the path costs 1
DEAR = np.array([0.1, 0.2, 0.1])
#: What each of the ways costs in which a cell differs from the next one
CHANGE = 0.1

#: How many detours of a mesh are tried, each away from where plans along those before ended: cells next to that cost so
#: much more
VARIATIONS, STUCK = 4, 3.0
#: Detours that take so many times as long as the path, and so much longer [s], come after those among other cells
LONG, LONGER = 1.7, 30.0
#: Postures in cells, and landings, that count as much as a slice of work
ROWS, LANDINGS = 2000, 2
#: Where less work is left, cells are not looked at
CELLS = 300.0
#: Room that the body has beyond its clearance at the cells that are looked at first [m]
ROOMY = 0.06
#: Cells that are looked at, in the order of trying: higher, lower and turned, then beside the path too, at first not
#: far; the body may touch something between them on every route, and pass between closer ones (NARROW)
MESHES = (ALONG, BESIDE, WIDE)


@dataclass(frozen=True, eq=False)
class BodyRoute:
    """What was found.

    Attributes:
        path: of the body; None if there is none.
        complete: the search looked at all that it can reach, so there is none among its cells.
        separating: ids of the holds at which it ends; empty if there is one.
        text: how far the body goes off its path, or why there is none.
    """

    path: BodyPath | None
    complete: bool
    separating: tuple[str, ...]
    text: str


#: Takes the sample at which a plan along the route ends, and yields another route
Routes = Generator[BodyRoute, int | None, None]
#: The same; returns whether the body touches something between its cells on each
Variations = Generator[BodyRoute, int | None, bool]


def find_route(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    *,
    mesh: CellSpacing = ALONG,
    start: Mapping[int, int] | None = None,
    deadline: float | None = None,
) -> BodyRoute:
    """A detour from a path's beginning to its end, along it, beside it, lower and turned.

    Args:
        mesh: how far beside the path, how low, and how closely it is looked.
        start: arm -> hold (rows) of hands that hold at the beginning. deadline: of ``time.perf_counter``.
    """
    return next(_variations(walker, structure, path, mesh, start, deadline))


def find_routes(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    start: Mapping[int, int] | None = None,
    deadline: float | None = None,
    allowance: Allowance | None = None,
) -> Routes:
    """Detours, those near the path first, each with :data:`VARIATIONS`, and then such as take much longer than the
    path (:data:`LONG`); the next one is looked for on demand.

    Args:
        start, deadline: of :func:`find_route`. allowance: work that may be done; when it is spent no other detour is
            looked for.
    """
    limb, closed, late = limb_of(walker), False, list[tuple[float, Variations, BodyRoute]]()
    for mesh in MESHES:
        if allowance is not None and allowance.left < CELLS:
            allowance.left = min(allowance.left, 0.0)
        if _over(deadline, allowance):
            return
        routes = _variations(walker, structure, path, mesh.of(limb), start, deadline, allowance)
        first = next(routes)
        usual = max(LONG * path.duration, path.duration + LONGER)
        if first.path is not None and first.path.duration > usual:
            late.append((first.path.duration, routes, first))
        else:
            closed = yield from _from(first, routes)
    for _, routes, first in sorted(late, key=lambda one: one[0]):
        yield from _from(first, routes)
    if closed and not _over(deadline, allowance):
        yield from _variations(walker, structure, path, NARROW.of(limb), start, deadline, allowance)


def _over(deadline: float | None, allowance: Allowance | None) -> bool:
    """Whether no time or no work is left."""
    late = deadline is not None and time.perf_counter() > deadline
    return late or (allowance is not None and allowance.spent)


def _from(route: BodyRoute, routes: Variations) -> Variations:
    """A route that was found, and those that follow it."""
    while True:
        ended = yield route
        try:
            route = routes.send(ended)
        except StopIteration as stop:
            return bool(stop.value)


def _variations(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    mesh: CellSpacing,
    start: Mapping[int, int] | None,
    deadline: float | None,
    allowance: Allowance | None = None,
) -> Variations:
    """Detours of one mesh: the quickest one, then such as have room, and keep away from where plans ended. Returns
    whether there are some among its cells, but the body touches something between them on each.
    """
    cells = cells_about(path, structure, mesh)
    grips = cell_grips(walker, structure, cells)
    there, dear, closed = around(walker, structure), _dear(cells), set[tuple[int, int]]()
    outcome = CellSearch(walker, structure, cells, grips).run(start, deadline)
    if allowance is not None:
        allowance.left -= len(grips.cells) / ROWS + outcome.expanded / LANDINGS
    if not outcome.nodes:
        names = tuple(structure.ids[k] for k in sorted({int(grips.hold[g]) for g in outcome.reached}))
        number = f"{outcome.expanded} landings looked at{'' if outcome.complete else ', more are left'}"
        where = f"beyond {', '.join(names)}" if names else "from the start"
        text = f"up to {mesh.beside * mesh.side:.2f} m beside the path there is no route {where} ({number})"
        yield BodyRoute(None, outcome.complete, names, text)
        return False
    outcomes, known, seen = [outcome], list[list[int]](), 0
    # Then through cells at which the body has more place than it needs
    roomy = there.bodies(cells.frames, ROOMY) == NONE_MET
    roomy[[cells.start, cells.goal]] = True
    for count in range(VARIATIONS):
        if count and _over(deadline, allowance):
            break
        if count == 1 and not roomy.all():
            outcome = CellSearch(walker, structure, cells, grips.only(roomy)).run(start, deadline)
            if allowance is not None:
                allowance.left -= outcome.expanded / LANDINGS
            outcomes += [outcome] if outcome.nodes else []
        found = _clear(there, cells, outcomes[count % len(outcomes)], path, dear, closed)
        if found is None or found[0] in known:
            continue
        chain, route, at = found
        known.append(chain)
        off = cells.offsets(np.array(chain))
        far = np.abs(off[:, 1]).max(), off[:, 2].max(), np.degrees(np.abs(off[:, 3]).max())
        text = f"up to {far[0]:.2f} m beside, {far[1]:.2f} m lower, turned by {far[2]:.0f} deg"
        ended = yield BodyRoute(route, True, (), text)
        seen += 1
        if ended is not None:
            dear[_near(cells, chain[min(int(np.searchsorted(at, ended)), len(chain) - 1)])] += STUCK
    if not seen:
        text = f"up to {mesh.beside * mesh.side:.2f} m beside the path the body touches something on each route"
        yield BodyRoute(None, False, (), text)
    return not seen


def _clear(
    there: Around, cells: Cells, outcome: Outcome, path: BodyPath, dear: Array, closed: set[tuple[int, int]]
) -> tuple[list[int], BodyPath, Ints] | None:
    """The quickest chain of cells along which the body touches nothing on its way from cell to cell either, as a path,
    and the samples of its cells; steps at which it would are added to ``closed``. None if there is none.
    """
    while True:
        chain = shortest(cells, outcome.nodes, outcome.final, dear, closed, _pace(path))
        if chain is None:
            return None
        route, at = as_path(cells, chain, path)
        met = np.flatnonzero(there.bodies(route.poses) != NONE_MET)
        if not len(met):
            return chain, route, at
        for k in np.unique(np.clip(np.searchsorted(at, met), 1, max(len(chain) - 1, 1))).tolist():
            if k >= len(chain):
                return None
            closed |= {(chain[k - 1], chain[k]), (chain[k], chain[k - 1])}


def shortest(
    cells: Cells,
    nodes: tuple[CellNode, ...],
    final: Ints,
    off: Array,
    closed: Collection[tuple[int, int]] = (),
    pace: float = SLOW,
) -> list[int] | None:
    """The quickest chain of cells through the sets of nodes, each left where the next hand lands; None: there is none.

    Args:
        off: what each cell costs more ``[cells]``. closed: steps from cell to cell that are not made.
        pace: of the body beside the path [m/s].
    """
    steps_of = _Steps(cells, pace)
    sets = [set(node.cells.tolist()) for node in nodes]
    doors = [*(set(node.landed.tolist()) for node in nodes[1:]), set(final.tolist())]
    begin = (0, cells.start)
    cost: dict[tuple[int, int], float] = {begin: 0.0}
    came: dict[tuple[int, int], tuple[int, int] | None] = {begin: None}
    queue, done = [(0.0, begin)], set[tuple[int, int]]()
    while queue:
        spent, here = heapq.heappop(queue)
        if here in done:
            continue
        done.add(here)
        layer, cell = here
        if layer == len(nodes):
            return _chain(came, here)
        steps = [((layer, there), price) for there, price in steps_of(cell) if there in sets[layer]]
        steps = [(there, price) for there, price in steps if (cell, there[1]) not in closed]
        if cell in doors[layer]:
            steps.append(((layer + 1, cell), 0.0))
        for there, price in steps:
            total = spent + price + (off[there[1]] if price else 0.0)
            if total < cost.get(there, np.inf):
                cost[there], came[there] = total, here
                heapq.heappush(queue, (total, there))
    return None


def as_path(cells: Cells, chain: list[int], path: BodyPath) -> tuple[BodyPath, Ints]:
    """The path over a chain of cells, as fast as the given one along it, and its samples at the cells."""
    off = cells.offsets(np.array(chain))
    poses = [pin.SE3(cells.frames[cell]) for cell in chain]
    out = [poses[0].homogeneous[None]]
    pace = _pace(path)
    for (one, other), (first, last) in zip(itertools.pairwise(off), itertools.pairwise(poses), strict=True):
        seconds = float(_seconds(other - one, pace))
        count = max(ceil(seconds / path.spacing - 1e-9), 1)
        step = pin.log6(first.actInv(last))
        out.append(np.array([(first * pin.exp6(step * (k / count))).homogeneous for k in range(1, count + 1)]))
    whole = BodyPath(_rounded(np.concatenate(out), round(CORNER / path.spacing)), path.spacing)
    return whole, np.cumsum([len(part) for part in out]) - 1


def _rounded(poses: Array, most: int) -> Array:
    """Means over each pose and up to ``most`` before and as many after it: velocities change over that long; the ends
    stay.
    """
    rows = np.arange(len(poses))
    half = np.minimum(np.minimum(rows, rows[::-1]), most)
    total = np.concatenate([np.zeros((1, 4, 4)), np.cumsum(poses, axis=0)])
    out: Array = (total[rows + half + 1] - total[rows - half]) / (2 * half + 1)[:, None, None]
    u, _, v = np.linalg.svd(out[:, :3, :3])
    out[:, :3, :3] = u @ v
    out[[0, -1]] = poses[[0, -1]]
    return out


def _pace(path: BodyPath) -> float:
    """Mean speed of a path's origin [m/s]; of one that only turns :data:`SLOW`."""
    length = float(np.linalg.norm(np.diff(path.poses[:, :3, 3], axis=0), axis=1).sum())
    return max(length / path.duration, SLOW)


def _seconds(change: Array, pace: float) -> Array:
    """How long the body takes for changes of its offsets from the path ``[..., 4]`` [s]."""
    time, side, lower, turned = np.moveaxis(np.abs(change), -1, 0)
    turned = np.minimum(turned, 2.0 * pi - turned)
    out: Array = np.maximum(np.hypot(time, side / pace), np.maximum(lower / DOWN_SPEED, turned / TURN_SPEED))
    return out


def _dear(cells: Cells) -> Array:
    off = np.abs(cells.offsets(np.arange(len(cells))))
    out: Array = off[:, 1:] @ DEAR
    return out


class _Steps:
    """Cells next to one, diagonal ones too, and what it costs to go there: the time that it takes, in steps along the
    path, and a little for each change.
    """

    def __init__(self, cells: Cells, pace: float) -> None:
        self._cells, self._pace = cells, pace
        self._offsets = cells.offsets(np.arange(len(cells)))
        self._usual = (float(cells.at[-1] - cells.at[0]) / max(len(cells.at) - 1, 1)) or 1.0

    def __call__(self, cell: int) -> list[tuple[int, float]]:
        numbers, changes = _neighbours(self._cells, cell)
        seconds = _seconds(self._offsets[numbers] - self._offsets[cell], self._pace)
        price = seconds / self._usual + CHANGE * changes
        return list(zip(numbers.tolist(), price.tolist(), strict=True))


def _neighbours(cells: Cells, cell: int) -> tuple[Ints, Ints]:
    """Cells next to one, diagonal ones too, and in how many ways they differ from it."""
    there = np.array(np.unravel_index(cell, cells.shape)) + _AROUND
    there[:, 3] %= cells.shape[3]
    inside = ((there >= 0) & (there < cells.shape)).all(axis=1)
    return np.ravel_multi_index(tuple(there[inside].T), cells.shape), _CHANGES[inside]


def _near(cells: Cells, cell: int) -> Ints:
    """A cell and those next to it."""
    return np.append(_neighbours(cells, cell)[0], cell)


def _chain(came: dict[tuple[int, int], tuple[int, int] | None], end: tuple[int, int]) -> list[int]:
    out = [end[1]]
    at = came[end]
    while at is not None:
        if at[1] != out[-1]:
            out.append(at[1])
        at = came[at]
    return out[::-1]


_AROUND = np.array([step for step in itertools.product((-1, 0, 1), repeat=4) if any(step)])
_CHANGES = np.abs(_AROUND).sum(axis=1)
