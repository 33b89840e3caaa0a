"""Over which region of its centre of mass a robot can stand on its contacts.

    {x : there are wrenches w with  h - J'w = G x (base),  F w >= b,  and if wished  -T <= h - J'w <= T}

x are the two coordinates across gravity by which the centre of mass is elsewhere, G x the moment of the weight there.
The region is convex; it is found between an inner polygon, whose corners are held, and an outer one, whose edges are
supporting lines, by one linear program a corner in the direction in which they differ most (Bretl and Lall, Testing
static equilibrium for legged robots, IEEE Transactions on Robotics 24(4), 2008). With torque limits it is the feasible
region of Orsolino et al. (Feasible region: an actuation-aware extension of the support region, IEEE Transactions on
Robotics 36(4), 2020): legs keep their configuration, and with it the torques of their own weight, while the centre of
mass moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.errors import CommandError, RangeError
from wbc.linear_program import OPTIMAL, least
from wbc.multibody import pin
from wbc.support.statics import Statics, statics
from wbc.validation import Array

#: Corners at most
MOST = 200
#: Centres of mass farther than this from where they are count as no limit [m]
BEYOND = 1e3


@dataclass(frozen=True, eq=False)
class Region:
    """Where the centre of mass may be.

    Attributes:
        center: the centre of mass of the configuration, in the world [3, m]. axes: two unit vectors across gravity [2,
            3].
        corners: of the inner polygon, in these axes, counted from the origin of the world, counterclockwise [n, 2, m];
            all of them are held. Empty where nothing is.
        outer: of the outer polygon [n, 2, m]; nothing beyond it is held.
        torque: whether torque limits count.
    """

    center: Array
    axes: Array
    corners: Array
    outer: Array
    torque: bool

    @property
    def area(self) -> float:
        """Of the inner polygon [m^2]."""
        return _area(self.corners)

    @property
    def error(self) -> float:
        """Area by which the outer polygon is larger [m^2]."""
        return _area(self.outer) - self.area

    def margin(self, point: Any = None) -> float:
        """Distance of a point of the world, by default the centre of mass, from the edges of the inner polygon [m]:
        negative outside.
        """
        at = self.axes @ (self.center if point is None else validation.real_array("point", point, (3,)))
        if len(self.corners) < 3:
            return -np.inf if not len(self.corners) else -float(np.linalg.norm(self.corners - at, axis=1).min())
        normals, offsets = _edges(self.corners)
        if (inside := offsets - normals @ at).min() >= 0.0:
            return float(inside.min())
        ends = np.roll(self.corners, -1, axis=0) - self.corners
        along = np.clip(np.einsum("ij,ij->i", at - self.corners, ends) / np.einsum("ij,ij->i", ends, ends), 0.0, 1.0)
        return -float(np.linalg.norm(self.corners + along[:, None] * ends - at, axis=1).min())

    def planes(self, count: int, inset: float = 0.0) -> dict[str, Array]:
        """Values for the inputs of :class:`wbc.tasks.SupportRegion` with ``count`` planes: the edges of a polygon
        within the inner one, of the corners that make its area largest one after the other.

        Args:
            inset: by how much all edges are farther inside [m].

        Raises:
            RangeError: nothing is held.
        """
        kept = self.corners
        if len(kept) < 3:
            raise RangeError("region", len(kept), "no centre of mass is held, so there are no planes")
        while len(kept) > max(3, count):
            before, after = np.roll(kept, 1, axis=0), np.roll(kept, -1, axis=0)
            lost = np.abs(_cross(kept - before, after - before))
            kept = np.delete(kept, int(np.argmin(lost)), axis=0)
        normals, offsets = _edges(kept)
        all_normals, all_offsets = np.zeros((count, 3)), np.full(count, BEYOND)
        all_normals[: len(kept)], all_offsets[: len(kept)] = normals @ self.axes, offsets - inset
        return {"normals": all_normals.ravel(), "offsets": all_offsets}

    def plot(self, panel: Any, color: str = "#1f5fa8", label: str = "") -> None:
        """Draw it on matplotlib's axes: the inner polygon, and the centre of mass as a cross."""
        closed = np.vstack([self.corners, self.corners[:1]]) if len(self.corners) else np.zeros((0, 2))
        panel.fill(*closed.T, color=color, alpha=0.18, linewidth=0)
        panel.plot(*closed.T, color=color, label=label or None)
        panel.plot(*(self.axes @ self.center), "x", color=color)
        panel.set_aspect("equal")
        panel.set_xlabel("x [m]")
        panel.set_ylabel("y [m]")


def region(controller: CompiledStack, q: Any, *, torque: bool = True, tolerance: float = 1e-5) -> Region:
    """The region of the contacts of a controller at a configuration.

    Args:
        controller: of a stack with a floating base that commands torques: its contacts as they are enabled, with their
            friction and limits, and its loads. q: configuration [nq].
        torque: whether torque limits count.
        tolerance: area by which inner and outer polygon may differ [m^2].

    Raises:
        CommandError: the controller does not command torques, or the base is fixed. RangeError: there is no gravity.
        ShapeError, NotFiniteError, SolverError: see :func:`wbc.support.statics.statics`.
    """
    found, robot = statics(controller, q), core_of(controller).stack.robot
    if not found.base.any():
        raise CommandError("controller", robot.name, "the base is fixed: it holds the centre of mass wherever it is")
    limit = validation.scalar("tolerance", tolerance, low=0.0, open_low=True, unit="m^2")
    gravity = np.array(robot.model.gravity.linear)
    strength = float(np.linalg.norm(gravity))
    if strength == 0.0:
        raise RangeError("gravity", strength, "without gravity the centre of mass may be anywhere")
    data, configuration = robot.model.createData(), robot.configuration("q", q)
    center = pin.centerOfMass(robot.model, data, configuration).copy()
    pin.forwardKinematics(robot.model, data, configuration)
    axes, turn = across(gravity / strength), data.oMi[1].rotation
    weight = pin.computeTotalMass(robot.model) * gravity
    # the moment of the weight about the base, in its axes, by how far the centre of mass is elsewhere
    moments = np.zeros((6, 2))
    moments[3:] = np.column_stack([turn.T @ np.cross(axis, weight) for axis in axes])
    program = _RegionProgram(found, moments, validation.flag("torque", torque))
    corners, outer = projected(program.farthest, limit)
    here = axes @ center
    return Region(center, axes, corners + here, outer + here, bool(torque))


class _RegionProgram:
    """The linear program: variables (w, x)."""

    def __init__(self, found: Statics, moments: Array, torque: bool) -> None:
        rows = np.ones(len(found.lower), bool) if torque else ~found.torques
        wide = np.hstack([found.A * found.scale, np.zeros((len(found.lower), 2))])
        # rows of the base read  -J'w = -h - (what gravity adds)
        wide[found.base, -2:] = -moments
        wide, low, high = (part[rows] for part in (wide / found.sizes[:, None], *self._ends(found)))
        equal = low == high
        self._equal = (wide[equal], low[equal]) if equal.any() else (None, None)
        sides = [(wide, high), (-wide, -low)]
        kept = [(matrix[~equal & np.isfinite(end)], end[~equal & np.isfinite(end)]) for matrix, end in sides]
        self._sides = np.vstack([matrix for matrix, _ in kept]), np.concatenate([end for _, end in kept])
        self._bounds = [(None, None)] * found.A.shape[1] + [(-BEYOND, BEYOND)] * 2

    @staticmethod
    def _ends(found: Statics) -> tuple[Array, Array]:
        return found.lower / found.sizes, found.upper / found.sizes

    def farthest(self, direction: Array) -> Array | None:
        """The point of the region that is farthest along a direction, None where the region is empty."""
        cost = np.zeros(len(self._bounds))
        cost[-2:] = -direction
        (A, b), (E, e) = self._sides, self._equal
        answer = least(cost, A, b, E, e, self._bounds)
        return None if answer.status != OPTIMAL else np.array(answer.x[-2:])


def projected(farthest: Callable[[Array], Array | None], tolerance: float) -> tuple[Array, Array]:
    """Corners of an inner and of an outer polygon of a convex region in the plane, counterclockwise.

    Args:
        farthest: the point of the region that is farthest along a direction, None where the region is empty.
        tolerance: area by which the two may differ.
    """
    angles = 2.0 * np.pi * np.arange(4) / 4
    directions = [np.array([np.cos(a), np.sin(a)]) for a in angles]
    corners: list[Array] = []
    for direction in directions:
        if (point := farthest(direction)) is None:
            return np.zeros((0, 2)), np.zeros((0, 2))
        corners.append(point)
    while len(corners) < MOST:
        tips = _tips(directions, corners)
        after = [*corners[1:], corners[0]]
        gaps = [0.5 * abs(float(_cross(b - a, t - a))) for a, b, t in zip(corners, after, tips, strict=True)]
        if sum(gaps) <= tolerance:
            break
        k = int(np.argmax(gaps))
        edge = after[k] - corners[k]
        direction = np.array([edge[1], -edge[0]]) / np.linalg.norm(edge)
        point = farthest(direction)
        if point is None:
            break
        directions.insert(k + 1, direction)
        corners.insert(k + 1, point)
    return _distinct(np.array(corners)), _distinct(np.array(_tips(directions, corners)))


def _tips(directions: list[Array], corners: list[Array]) -> list[Array]:
    """Where the supporting lines of neighbouring corners meet."""
    out = []
    for k, (direction, corner) in enumerate(zip(directions, corners, strict=True)):
        other, there = directions[(k + 1) % len(corners)], corners[(k + 1) % len(corners)]
        if abs(float(_cross(direction, other))) < 1e-9 or np.linalg.norm(there - corner) < 1e-9:
            out.append(corner)
            continue
        lines = np.array([direction, other])
        out.append(np.linalg.solve(lines, np.array([direction @ corner, other @ there])))
    return out


def _distinct(corners: Array) -> Array:
    """Corners without those that are where the one before is, or on the line between its neighbours."""
    kept = [corner for k, corner in enumerate(corners) if np.linalg.norm(corner - corners[k - 1]) > 1e-7]
    out = np.array(kept) if kept else corners[:1]
    if len(out) < 3:
        return out
    before, after = np.roll(out, 1, axis=0), np.roll(out, -1, axis=0)
    return np.asarray(out[np.abs(_cross(out - before, after - before)) > 1e-10])


def _cross(a: Array, b: Array) -> Array:
    """z component of the cross product of vectors in the plane."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _edges(corners: Array) -> tuple[Array, Array]:
    """Unit normals, outwards, and distances of the edges of a polygon from the origin."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    return normals, np.einsum("ij,ij->i", normals, corners)


def _area(corners: Array) -> float:
    if len(corners) < 3:
        return 0.0
    return 0.5 * abs(float(_cross(corners, np.roll(corners, -1, axis=0)).sum()))


def across(down: Array) -> Array:
    """Two unit vectors across a direction: x and y of the world where it is down."""
    first = np.array([1.0, 0.0, 0.0]) if abs(down[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = first - down * (down @ first)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(first, down)])
