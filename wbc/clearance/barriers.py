"""Proofs that no motion leads from a start to a goal: a part of it alone cannot go there past what stands about.

Balls within bodies are looked at on a grid: over the places of a ball, or over one or two coordinates that move some
bodies alone. Of a cell it is known that a ball is in an obstacle wherever in the cell it is, or else it counts as free.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from wbc.clearance.scene import Pair, SweptBody
from wbc.clearance.tree import SCALAR, Moves, Tree
from wbc.geometry.kernel import ShapeTable, distances, segments_from
from wbc.multibody import pin
from wbc.shapes import Cylinder, Geometry
from wbc.shapes.solid import Kind
from wbc.validation import Array

#: How far a ball goes from the middle of a cell to its corner, in parts of the distance that its centre keeps from
#: obstacles: at less than 1 / 2 there is no way through a wall of no thickness
CORNER = 0.45
#: and where it stays on its level, where there are fewer cells
LEVEL_CORNER = 0.15
#: Places of balls that are looked at on one grid at most
CELLS = 20_000
#: and for one goal
ALL_CELLS = 60_000
#: Cells along each axis of a grid of one, two and three axes at most
WIDTHS = (4096, 1024, 160)
#: Distances that are smaller by this are kept, too [m]: what proofs of motions leave open, and rounding
OPEN = 2e-4
#: Share of a ball's radius that counts, for what its measure may be off
INSIDE = 0.99
#: Balls along a body
BALLS = 3
#: A centre that rises by no more stays on its level [m]
LEVEL = 1e-9


Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Ball:
    """A ball within a body that moves, and how far the body stays away from each obstacle [m].

    Attributes:
        body: whose. centre: on the frame of the tree that carries it [m]; axis: z of the body there.
        chain: frames that carry it, up to the world. obstacles, kept: what stands, and that distance.
        radius: of the ball [m]. disc: of a cylinder about the centre, along the axis, that is within the body too, or
            0; and its height [m].
    """

    body: SweptBody
    centre: Array
    axis: Array
    chain: tuple[int, ...]
    obstacles: tuple[SweptBody, ...]
    kept: Array
    radius: float
    disc: tuple[float, float]

    @property
    def least(self) -> float:
        """How far the centre stays away from obstacles at least [m]."""
        return self.radius + float(self.kept.min())

    def struck(self, centres: Array, corner: float, wide: bool = False) -> tuple[Flags, set[str]]:
        """(at which places [m, 3] the centre, or the upright disc, is too near wherever it is within ``corner`` of it;
        to what).
        """
        out, names = np.zeros(len(centres), dtype=bool), set[str]()
        for obstacle, kept in zip(self.obstacles, self.kept, strict=True):
            place, shape = obstacle.placement or pin.SE3.Identity(), obstacle.shape
            assert isinstance(shape, Geometry)
            if wide:
                near = self._from_disc(shape, place, centres, corner) < kept
            else:
                local = (centres - place.translation) @ place.rotation
                near = segments_from(shape, local, local) < self.radius + kept - corner
            out |= near
            names |= {obstacle.name} if near.any() else set()
        return out, names

    def _from_disc(self, shape: Geometry, place: pin.SE3, centres: Array, corner: float) -> Array:
        """Distances of a shape from upright discs that are smaller by ``corner`` [m]."""
        disc, count, stands = Cylinder(self.disc[0] - corner, self.disc[1]), len(centres), place.act(shape.center)
        upright = np.hstack([np.tile(np.eye(3).ravel(), (count, 1)), centres])
        poses = np.vstack([upright, np.r_[place.rotation.ravel(), stands]])
        return distances(ShapeTable([disc] * count + [shape]), poses, np.arange(count), np.full(count, count))[:, 0]

    def places(self, tree: Tree, x: Array) -> Array:
        """Where the centre is at coordinates [m, n] in the world, and the body's axis [m, 6]."""
        turn, at = np.tile(np.eye(3), (len(x), 1, 1)), np.zeros((len(x), 3))
        for f in reversed(self.chain):
            frame = tree.frames[f]
            at = at + turn @ frame.place.translation
            turn = turn @ frame.place.rotation
            if frame.moves in SCALAR:
                moved = frame.scale * x[:, frame.coordinate] + frame.offset
                if frame.moves == Moves.SHIFTING:
                    at = at + moved[:, None] * turn[:, :, 2]
                else:
                    c, s, old = np.cos(moved)[:, None], np.sin(moved)[:, None], turn.copy()
                    turn[:, :, 0], turn[:, :, 1] = (
                        c * old[:, :, 0] + s * old[:, :, 1],
                        c * old[:, :, 1] - s * old[:, :, 0],
                    )
        return np.hstack([at + turn @ self.centre, turn @ self.axis])

    def reaches(self, tree: Tree, low: Array, high: Array) -> list[float]:
        """How far the centre can be from the origin of each frame of its chain [m]."""
        far, out = float(np.linalg.norm(self.centre)), list[float]()
        for f in self.chain:
            frame = tree.frames[f]
            if frame.moves == Moves.SHIFTING:
                ends = frame.scale * np.array([low[frame.coordinate], high[frame.coordinate]]) + frame.offset
                far += float(np.abs(ends).max())
            out.append(far)
            far += float(np.linalg.norm(frame.place.translation))
        return out


def balls(tree: Tree, bodies: Sequence[SweptBody], pairs: Sequence[Pair]) -> list[Ball]:
    """Those within bodies that move and keep away from obstacles, the largest first."""
    named, out = {body.name: body for body in bodies}, list[Ball]()
    kept: dict[str, dict[str, float]] = {}
    for pair in pairs:
        for one, other in ((pair.first, pair.second), (pair.second, pair.first)):
            if named[one].link != "world" and named[other].link == "world":
                kept.setdefault(one, {})[other] = pair.required
    for name, others in kept.items():
        body, obstacles = named[name], tuple(named[k] for k in others)
        if not all(isinstance(one.shape, Geometry) for one in (body, *obstacles)):
            continue
        assert isinstance(body.shape, Geometry)
        frame, place = tree.link("link", body.link)
        place = place * (body.placement or pin.SE3.Identity())
        x, y, z, flat, round_by = body.shape.sizes
        disc = (INSIDE * (min(x, y) + flat + round_by), 2.0 * z) if body.shape.kind == Kind.SUM else (0.0, 0.0)
        along = np.zeros(3)
        along[int(np.argmax([x, y, z]))] = max(x, y, z)
        for share in np.linspace(-1.0, 1.0, BALLS):
            middle = body.shape.center + share * along
            radius = -INSIDE * float(segments_from(body.shape, middle[None], middle[None])[0])
            if radius > 0.0:
                required = np.array(list(others.values())) - OPEN
                at, wide = (place.act(middle), place.rotation[:, 2]), disc if share == 0.0 else (0.0, 0.0)
                out.append(Ball(body, *at, tuple(tree.up(frame)), obstacles, required, radius, wide))
    return sorted(out, key=lambda ball: -ball.least)


class PlaceGrid:
    """Where a ball can be: cells of x, y and z [m], or of x and y where it stays on its level.

    Attributes:
        ends: at the start and at the goal [2, axes]. sides: of a cell. turns: cells of a turn, 0 of what has none.
        balls: that are looked at in each. what: they are in.
    """

    def __init__(self, ball: Ball, tree: Tree, limits: tuple[Array, Array], ends: Array) -> None:
        elsewhere = ends[0] + np.random.default_rng(0).uniform(-1.0, 1.0, (4, ends.shape[1]))
        places = ball.places(tree, np.concatenate([ends, elsewhere]))
        level = np.ptp(places[:, 2]) <= LEVEL
        axes, radius = 2 if level else 3, ball.disc[0]
        # What stays upright on its level is as wide as its disc
        self._wide = bool(level and radius > ball.radius and np.abs(places[:, 5]).min() > 1.0 - LEVEL)
        corner = LEVEL_CORNER * radius if self._wide else (LEVEL_CORNER if level else CORNER) * ball.least
        self._ball, self._corner, self._level = ball, corner, places[0, 2]
        self._root, self._reach = tree.frames[ball.chain[-1]].place.translation, ball.reaches(tree, *limits)[-1]
        self.ends, self.sides = places[:2, :axes], np.full(axes, 2.0 / np.sqrt(axes) * corner)
        self.turns, self.balls, self.what = np.zeros(axes, dtype=int), 1, ball.body.name

    def barred(self, cells: Array) -> tuple[Flags, set[str]]:
        """(whether the middle of each cell, and all of it, is barred; by which obstacles)."""
        centres = np.full((len(cells), 3), self._level)
        centres[:, : cells.shape[1]] = cells
        far = np.linalg.norm(centres - self._root, axis=1) > self._reach + self._corner
        near, names = self._ball.struck(centres, self._corner, self._wide)
        return near | far, names


class JointGrid:
    """Values of coordinates that move some balls alone; attributes as of :class:`PlaceGrid`."""

    def __init__(
        self,
        balls: list[Ball],
        tree: Tree,
        limits: tuple[Array, Array],
        ends: Array,
        numbers: list[int],
        endless: Flags,
    ) -> None:
        self._balls, self._tree, self._start, self._numbers = balls, tree, ends[0], numbers
        self._corner = CORNER * min(ball.least for ball in balls)
        ways = np.zeros((len(balls), ends.shape[1]))
        for way, ball in zip(ways, balls, strict=True):
            for frame, reach in zip((tree.frames[f] for f in ball.chain), ball.reaches(tree, *limits), strict=True):
                way[frame.coordinate] += abs(frame.scale) * (0.0, reach, 1.0)[frame.moves]
        far = ways.max(axis=0)
        self.ends, turn = ends[:, numbers], 2.0 * np.pi * endless[numbers]
        sides = np.array([2.0 * self._corner / (len(numbers) * max(far[k], LEVEL)) for k in numbers])
        self.turns = np.ceil(turn / sides).astype(int)
        self.sides = np.where(endless[numbers], turn / np.maximum(self.turns, 1), sides)
        self._low, self._high = (
            side[numbers] + sign * self.sides for side, sign in zip(limits, (-1.0, 1.0), strict=True)
        )
        self.balls, self.what = len(balls), ", ".join(dict.fromkeys(ball.body.name for ball in balls))

    def barred(self, cells: Array) -> tuple[Flags, set[str]]:
        """As of :class:`PlaceGrid`."""
        x, names = np.tile(self._start, (len(cells), 1)), set[str]()
        x[:, self._numbers] = cells
        out: Flags = np.any((cells < self._low) | (cells > self._high), axis=1)
        for ball in self._balls:
            rest = np.flatnonzero(~out)
            out[rest], by = ball.struck(ball.places(self._tree, x[rest])[:, :3], self._corner)
            names |= by
        return out, names


@dataclass(frozen=True, eq=False)
class Barriers:
    """What may keep two configurations apart, whatever the motion.

    Attributes:
        tree: of which all turns are about z and all shifts along it. bodies, pairs: what keeps which distance; that of
            bodies that move from those in the world counts.
        low, high: limits of the coordinates [n]. endless: numbers of those that are angles without limits.
    """

    tree: Tree
    bodies: Sequence[SweptBody]
    pairs: Sequence[Pair]
    low: Array
    high: Array
    endless: Collection[int]

    def between(self, start: Array, goal: Array) -> str:
        """What cannot get past which obstacles on any way between two configurations; empty: nothing is proven."""
        left = ALL_CELLS
        for grid in self._grids(np.array([start, goal])):
            count, reason = _between(grid)
            left -= count
            if reason or left < 0:
                return reason
        return ""

    def _grids(self, ends: Array) -> Iterator[PlaceGrid | JointGrid]:
        tree, limits = self.tree, (self.low, self.high)
        known = [ball for ball in balls(tree, self.bodies, self.pairs) if ball.chain]
        endless = np.isin(np.arange(ends.shape[1]), list(self.endless))
        bounded = set(np.flatnonzero(endless | np.isfinite(self.low) & np.isfinite(self.high)).tolist())
        moved = [{tree.frames[f].coordinate for f in ball.chain if tree.frames[f].moves in SCALAR} for ball in known]
        # Coordinates that move some balls alone
        for which in sorted({tuple(sorted(by)) for by in moved if 0 < len(by) <= 2 and by <= bounded}, key=len):
            own = [ball for ball, by in zip(known, moved, strict=True) if by and by <= set(which)]
            yield JointGrid(own, tree, limits, ends, list(which), endless)
        seen = set[str]()
        for ball in known:
            if ball.body.name not in seen:
                yield PlaceGrid(ball, tree, limits, ends)
            seen.add(ball.body.name)


def _between(grid: PlaceGrid | JointGrid) -> tuple[int, str]:
    """(places of balls looked at, what separates both ends on a grid; empty: nothing that was found).

    Cells are reached from both ends in turns, as far as the grid goes.
    """
    axes, width = len(grid.sides), WIDTHS[len(grid.sides) - 1]
    steps = np.array([step for step in product((-1, 0, 1), repeat=axes) if any(step)])
    strides, turns, count = width ** np.arange(axes), np.where(grid.turns, grid.turns, width), 0
    # Numbers of cells count from the first end's, which is in the middle

    def wrapped(cells: Array) -> Array:
        return np.where(grid.turns, (cells + turns // 2) % turns - turns // 2, cells) + width // 2

    fronts = [wrapped(np.round((end - grid.ends[0]) / grid.sides).astype(int)[None]) for end in grid.ends]
    seen, free = np.zeros((2, width**axes), dtype=bool), np.zeros((2, width**axes), dtype=bool)
    names, left = [set[str](), set[str]()], [k for k in range(2) if _inside(fronts[k], width)]
    if (turns > width).any() or (fronts[0] == fronts[1]).all():
        return 0, ""
    for k in left:
        seen[k, fronts[k] @ strides] = free[k, fronts[k] @ strides] = True
    while count < CELLS and left:
        k = min(left, key=lambda side: len(fronts[side]))
        near = wrapped((fronts[k][:, None] + steps).reshape(-1, axes) - width // 2)
        if not _inside(near, width):
            left.remove(k)
            continue
        codes = near @ strides
        codes = np.unique(codes[~seen[k, codes]])
        new = codes[:, None] // strides % width
        barred, by = grid.barred(grid.ends[0] + grid.sides * (new - width // 2))
        seen[k, codes], count = True, count + grid.balls * len(new)
        names[k] |= by
        fronts[k] = new[~barred]
        free[k, codes[~barred]] = True
        if free[1 - k, codes[~barred]].any():
            break
        if not len(fronts[k]):
            past = ", ".join(sorted(names[k])) or "its limits"
            return count, f"{grid.what} cannot get past {past}, from the {('start', 'goal')[k]}"
    return count, ""


def _inside(cells: Array, width: int) -> bool:
    return bool((cells >= 0).all() and (cells < width).all())
