"""A body path round what cannot be passed: from cell to cell, as a path."""

from __future__ import annotations

import itertools
import time
from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, pi

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.around import NONE_MET, Around, around
from wbc.walking.planner.detours.cell_graph import CellGraph
from wbc.walking.planner.detours.cell_grips import cell_grips
from wbc.walking.planner.detours.cells import ALONG, BESIDE, NARROW, WIDE, Cells, CellSpacing, Ints, cells_about
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.slices import Allowance

#: How fast the body goes down at most, whatever is asked for [m/s]
DOWN_SPEED = 0.05
#: Half of the time over which its velocity changes [s]
CORNER = 0.3
#: How many detours of a mesh are tried, each away from where plans along those before ended
VARIATIONS = 16
#: Detours that take so many times as long as the path, and so much longer [s], come after those among other cells
LONG, LONGER = 1.7, 30.0
#: Grips at cells that count as much as a slice of work; where less work is left than CELLS, cells are not looked at
ROWS, CELLS = 6000, 150.0
#: Cells that are looked at, in the order of trying: higher, lower and turned, then beside the path too, at first not
#: far; the body may touch something between them on every route, and pass between closer ones (NARROW)
MESHES = (BESIDE, WIDE)


@dataclass(frozen=True, eq=False)
class BodyRoute:
    """What was found.

    Attributes:
        path: of the body; None if there is none.
        separating: ids of the holds at which it ends; empty if there is one.
        text: how far the body goes off its path, or why there is none.
    """

    path: BodyPath | None
    separating: tuple[str, ...]
    text: str


#: Takes the plan along a route, where it does not lead to the end, and yields another route
Routes = Generator[BodyRoute, Plan | None, None]
#: The same; returns whether the body touches something between its cells on each
Variations = Generator[BodyRoute, Plan | None, bool]


def find_route(walker: Walker, structure: Structure, path: BodyPath, *, mesh: CellSpacing = ALONG) -> BodyRoute:
    """A detour from a path's beginning to its end, along it, beside it, lower and turned.

    Args:
        mesh: how far beside the path, how low, and how closely it is looked.
    """
    return next(_variations(walker, structure, path, mesh))


def find_routes(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    deadline: float | None = None,
    allowance: Allowance | None = None,
) -> Routes:
    """Detours, those near the path first, each with :data:`VARIATIONS`, and then such as take much longer than the
    path (:data:`LONG`); the next one is looked for on demand.

    Args:
        deadline: of ``time.perf_counter``. allowance: work that may be done; when it is spent no other detour is looked
            for.
    """
    limb, arms = limb_of(walker), len(walker.arms)
    closed, late = False, list[tuple[float, Variations, BodyRoute]]()
    for mesh in MESHES:
        if allowance is not None and allowance.left < CELLS:
            allowance.left = min(allowance.left, 0.0)
        if _over(deadline, allowance):
            return
        routes = _variations(walker, structure, path, mesh.of(limb, arms), deadline, allowance)
        first = next(routes)
        usual = max(LONG * path.duration, path.duration + LONGER)
        if first.path is not None and first.path.duration > usual:
            late.append((first.path.duration, routes, first))
        else:
            closed = yield from _from(first, routes)
    for _, routes, first in sorted(late, key=lambda one: one[0]):
        yield from _from(first, routes)
    if closed and not _over(deadline, allowance):
        yield from _variations(walker, structure, path, NARROW.of(limb, arms), deadline, allowance)


def _over(deadline: float | None, allowance: Allowance | None) -> bool:
    """Whether no time or no work is left."""
    late = deadline is not None and time.perf_counter() > deadline
    return late or (allowance is not None and allowance.spent)


def _from(route: BodyRoute, routes: Variations) -> Variations:
    """A route that was found, and those that follow it."""
    while True:
        plan = yield route
        try:
            route = routes.send(plan)
        except StopIteration as stop:
            return bool(stop.value)


def _variations(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    mesh: CellSpacing,
    deadline: float | None = None,
    allowance: Allowance | None = None,
) -> Variations:
    """Detours of one mesh: the quickest one, then such as keep away from where plans ended. Returns whether there are
    some among its cells, but the body touches something between them on each.
    """
    cells = cells_about(path, structure, mesh)
    grips = cell_grips(walker, structure, cells)
    graph = CellGraph(cells, grips, len(walker.arms), partial(_seconds, speed=path.speed, turn_rate=path.turn_rate))
    if allowance is not None:
        allowance.left -= len(grips.cell) / ROWS
    beside = f"up to {mesh.beside * mesh.side:.2f} m beside the path"
    if graph.shortest() is None:
        names = tuple(structure.ids[k] for k in np.unique(grips.hold[graph.furthest()]))
        where = f"beyond {', '.join(names)}" if names else "from the start"
        yield BodyRoute(None, names, f"{beside} there is no route {where}")
        return False
    there, known = around(walker, structure), list[list[int]]()
    for _ in range(VARIATIONS):
        found = None if known and _over(deadline, allowance) else _clear(there, graph, path)
        if found is None:
            break
        chain, route, at = found
        if chain not in known:
            known.append(chain)
            off = cells.offsets(np.array(chain))
            far = np.abs(off[:, 1]).max(), off[:, 2].max(), np.degrees(np.abs(off[:, 3]).max())
            text = f"up to {far[0]:.2f} m beside, {far[1]:.2f} m lower, turned by {far[2]:.0f} deg"
            plan = yield BodyRoute(route, (), text)
            ended, arms = (0.0, []) if plan is None else (plan.reached, _ended(plan))
        end = min(int(np.searchsorted(at, round(ended / route.spacing))), len(chain) - 1)
        graph.avoid(chain[max(end - 3, 0) : end + 2], arms)
    if not known:
        yield BodyRoute(None, (), f"{beside} the body touches something on each route")
    return not known


def _ended(plan: Plan) -> list[int]:
    """Rows of the arms whose grips end where a plan does."""
    if plan.grips is None:
        return []
    lasts = [plan.grips.last[chain[-1]] * plan.path.spacing for chain in plan.chain]
    return [arm for arm, last in enumerate(lasts) if last <= plan.reached + 1e-9]


def _clear(there: Around, graph: CellGraph, path: BodyPath) -> tuple[list[int], BodyPath, Ints] | None:
    """The best chain of cells along which the body touches nothing on its way from cell to cell either, as a path, and
    the samples of its cells; steps at which it would are closed. None if there is none.
    """
    while (chain := graph.shortest()) is not None:
        route, at = as_path(graph.cells, chain, path)
        met = np.flatnonzero(there.bodies(route.poses) != NONE_MET)
        if not len(met):
            return chain, route, at
        if len(chain) < 2:
            return None
        steps = np.unique(np.clip(np.searchsorted(at, met), 1, len(chain) - 1)).tolist()
        graph.close((chain[k - 1], chain[k]) for k in steps)
    return None


def as_path(cells: Cells, chain: list[int], path: BodyPath) -> tuple[BodyPath, Ints]:
    """The path over a chain of cells, as fast as the given one along it and never faster than was asked for, and its
    samples at the cells.
    """
    off = cells.offsets(np.array(chain))
    poses = [pin.SE3(cells.frames[cell]) for cell in chain]
    out = [poses[0].homogeneous[None]]
    for (one, other), (first, last) in zip(itertools.pairwise(off), itertools.pairwise(poses), strict=True):
        step = pin.log6(first.actInv(last))
        usual = float(_seconds(other - one, path.speed, path.turn_rate))
        ahead, turned = float(np.linalg.norm(step.linear)), float(np.linalg.norm(step.angular))
        seconds = max(usual, ahead / path.speed, turned / path.turn_rate)
        count = max(ceil(seconds / path.spacing - 1e-9), 1)
        out.append(np.array([(first * pin.exp6(step * (k / count))).homogeneous for k in range(1, count + 1)]))
    rounded = _rounded(np.concatenate(out), round(CORNER / path.spacing))
    whole = replace(path, poses=rounded)
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


def _seconds(change: Array, speed: float, turn_rate: float) -> Array:
    """How long the body takes at least for changes of its offsets from the path ``[..., 4]``, at such rates [s]."""
    time, side, lower, turned = np.moveaxis(np.abs(change), -1, 0)
    turned = np.minimum(turned, 2.0 * pi - turned)
    down = lower / min(speed, DOWN_SPEED)
    out: Array = np.maximum(np.hypot(time, side / speed), np.maximum(down, turned / turn_rate))
    return out
