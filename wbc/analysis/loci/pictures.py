"""Pictures of loci: their branches in joint space, and the robot in a pose on each."""

from __future__ import annotations

from collections import Counter
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from wbc import style, validation
from wbc.analysis.algebra.branches import LocusBranch
from wbc.analysis.algebra.locus import Located
from wbc.analysis.algebra.notation import Notation
from wbc.analysis.algebra.points import angle, form_grid, real_point
from wbc.analysis.jacobians.model import ExactModel
from wbc.errors import RobotFileError, ShapeError
from wbc.multibody import pin
from wbc.validation import Array

#: Random points that are drawn of a curve
_POINTS = 1500
#: Random starts of the search for the pose that is drawn
_TRIES = 20
#: Points of the grid along each joint in which surfaces are found
_GRID = 33
#: Points of the grid along each joint in which curves are found
_FINE = 241
#: Lines of a locus that are drawn, at most
_MOST = 6
#: Corners of a cell that six tetrahedra about its diagonal have, each a walk along the axes in another order
_WALKS = np.array([[np.zeros(3), *np.cumsum(np.eye(3)[list(order)], axis=0)] for order in permutations(range(3))], int)
#: Corners of a tetrahedron, in the order of their values, between which the triangles have their vertices, by how many
#: values are negative
_TRIANGLES = {
    1: (((0, 1), (0, 2), (0, 3)),),
    2: (((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))),
    3: (((3, 0), (3, 1), (3, 2)),),
}


def zero_surface(values: Array, ticks: Array) -> Array:
    """Triangles of the set f = 0, f linear in each of six tetrahedra a cell.

    Args:
        values: of f on the grid ticks x ticks x ticks ``[n, n, n]``. ticks: rising ``[n]``.

    Returns:
        ``[m, 3 vertices, 3 coordinates]``, counterclockwise seen from where f is positive.

    Raises:
        ShapeError: values that are not on that grid.
    """
    count = len(ticks)
    if values.shape != (count,) * 3 or count < 2:
        raise ShapeError("values", values, f"expected shape {(count,) * 3}, and two ticks or more")
    cells = np.stack(np.meshgrid(*[np.arange(count - 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 1, 3)
    corners = (cells + _WALKS).reshape(-1, 4, 3)
    # A corner at zero counts as above, so that every crossing has a length
    heights = values[corners[..., 0], corners[..., 1], corners[..., 2]]
    order = np.argsort(heights, axis=1)
    heights = np.take_along_axis(heights, order, axis=1)
    corners = np.take_along_axis(corners, order[..., None], axis=1)
    below = (heights < 0.0).sum(axis=1)
    pieces, upward = [], []
    for number, triangles in _TRIANGLES.items():
        h, at = heights[below == number], np.asarray(ticks)[corners[below == number]]
        for triangle in triangles:
            upward.append(at[:, 3] - at[:, 0])
            part = [h[:, a] / (h[:, a] - h[:, b]) for a, b in triangle]
            pieces.append(
                np.stack(
                    [at[:, a] + t[:, None] * (at[:, b] - at[:, a]) for (a, b), t in zip(triangle, part, strict=True)], 1
                )
            )
    out, normal = np.concatenate(pieces), np.concatenate(upward)
    turned = np.einsum("ij,ij->i", np.cross(out[:, 1] - out[:, 0], out[:, 2] - out[:, 0]), normal) < 0.0
    out[turned] = out[turned][:, [0, 2, 1]]
    return np.asarray(out)


def save_pictures(model: ExactModel, found: Located, folder: Path, name: str) -> list[Path]:
    """Writes ``name``-locus.png, ``name``-poses.png, ``name``.tex and ``name``.txt; returns the files.

    The locus is drawn in at most three joints, those of relations first: planes for the values of one joint, surfaces
    (in two joints curves) for one relation, random points for what has several conditions; branches with conditions on
    further joints are named only. An empty locus has only the text files.

    Raises:
        RobotFileError: the folder cannot be written.
    """
    groups = _groups(found)
    with validation.writing("plot", folder, RobotFileError):
        folder.mkdir(parents=True, exist_ok=True)
        files = []
        for suffix, latex in ((".txt", False), (".tex", True)):
            lines = Notation(found.exact.half, latex).branches(found.locus.branches)
            text = "\n".join(rf"\[ {line} \]" if latex else line for line in lines) or "% empty" * latex
            files.append(folder / f"{name}{suffix}")
            files[-1].write_text(text + "\n", encoding="utf-8")
        if groups:
            with style.pyplot() as plt:
                for kind, draw in (("locus", _locus), ("poses", _poses)):
                    figure = draw(plt, model, found, groups)
                    files.append(folder / f"{name}-{kind}.png")
                    figure.savefig(files[-1], bbox_inches="tight")
                    plt.close(figure)
    return files


def _groups(found: Located) -> list[tuple[str, list[LocusBranch]]]:
    """Lines of the text and the branches of each: those with conditions on the same joints."""
    kinds: dict[tuple[object, ...], list[LocusBranch]] = {}
    for branch in found.locus.branches:
        key = (tuple(v.joint for v in branch.values), tuple(r.joints for r in branch.relations))
        kinds.setdefault(key, []).append(branch)
    notation = Notation(found.exact.half)
    return [("; ".join(notation.branches(branches)), branches) for branches in list(kinds.values())[:_MOST]]


def _joints(found: Located) -> list[int]:
    """The joints that most branches have conditions on, at most three, at least two."""
    branches = found.locus.branches
    # Relations first: planes of one value are the same in whatever joints stand beside it
    seen = Counter(k for b in branches for r in b.relations for k in r.joints)
    seen = Counter({k: 1000 * n for k, n in seen.items()}) + Counter(v.joint for b in branches for v in b.values)
    chosen = [k for k, _ in seen.most_common(3)]
    others = (k for k in range(found.exact.half.size) if k not in chosen)
    while len(chosen) < 2:
        chosen.append(next(others))
    return sorted(chosen)


def _points(found: Located, branches: list[LocusBranch], count: int) -> Array:
    rng = np.random.default_rng(0)
    tries = (real_point(found.exact.half, b, rng) for b in branches for _ in range(count))
    points = [p for p in tries if p is not None]
    return np.array(points).reshape(-1, found.exact.half.size)


def _locus(plt: Any, model: ExactModel, found: Located, groups: list[tuple[str, list[LocusBranch]]]) -> Any:
    joints = _joints(found)
    notation = Notation(found.exact.half)
    solid = len(joints) == 3
    figure = plt.figure(figsize=(8.0, 6.5))
    axes = figure.add_subplot(projection="3d" if solid else None)
    for number, (text, branches) in enumerate(groups):
        colour = style.CYCLE[number % len(style.CYCLE)]
        if solid and all(len(b.values) == 1 and not b.relations and b.values[0].joint in joints for b in branches):
            for branch in branches:
                _plane(axes, joints.index(branch.values[0].joint), angle(branch.values[0], found.exact.half), colour)
            axes.scatter([], [], [], color=colour, label=text)
            continue
        restricted = {v.joint for b in branches for v in b.values}
        restricted |= {k for b in branches for r in b.relations for k in r.joints}
        if not restricted <= {*joints}:
            axes.scatter(*([] for _ in joints), color="none", label=f"not shown: {text}")
            continue
        if all(len(b.relations) == 1 and not b.values for b in branches):
            for branch in branches:
                (_surface if solid else _curve)(axes, found, branch, joints, colour)
            axes.scatter(*([] for _ in joints), color=colour, label=text)
            continue
        points = _points(found, branches, _POINTS)
        axes.scatter(*(points[:, k] for k in joints), s=4, color=colour, label=text)
    ticks, labels = [-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi], ["-π", "-π/2", "0", "π/2", "π"]
    for letter, k in zip("xyz", joints, strict=False):
        getattr(axes, f"set_{letter}label")(f"{notation.label(k)} [rad]")
        getattr(axes, f"set_{letter}lim")(-np.pi * 1.03, np.pi * 1.03)
        getattr(axes, f"set_{letter}ticks")(ticks, labels)
    axes.set_title(f"{model.robot.name}: where the rows lose rank")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), markerscale=4)
    return figure


def _plane(axes: Any, across: int, at: float, colour: str) -> None:
    """A plane of the cube, at a place of one of its joints."""
    one, other = np.meshgrid([-np.pi, np.pi], [-np.pi, np.pi])
    sides = [one, other]
    sides.insert(across, np.full_like(one, at))
    axes.plot_surface(*sides, color=colour, alpha=0.3, edgecolor=colour)


def _relation(found: Located, branch: LocusBranch, joints: list[int], ticks: Array) -> Array:
    """The relation of a branch on a grid of some joints; it has no others."""
    grid = np.meshgrid(*[ticks] * len(joints), indexing="ij")
    q = [np.zeros_like(grid[0])] * found.exact.half.size
    for k, values in zip(joints, grid, strict=True):
        q[k] = values
    return form_grid(found.exact.half, branch.relations[0], q)


def _surface(axes: Any, found: Located, branch: LocusBranch, joints: list[int], colour: str) -> None:
    ticks = np.linspace(-np.pi, np.pi, _GRID)
    triangles = zero_surface(_relation(found, branch, joints, ticks), ticks)
    if len(triangles):
        vertices = triangles.reshape(-1, 3)
        rows = np.arange(len(vertices)).reshape(-1, 3)
        axes.plot_trisurf(*vertices[:, :2].T, vertices[:, 2], triangles=rows, color=colour, alpha=0.55)


def _curve(axes: Any, found: Located, branch: LocusBranch, joints: list[int], colour: str) -> None:
    ticks = np.linspace(-np.pi, np.pi, _FINE)
    axes.contour(ticks, ticks, _relation(found, branch, joints, ticks).T, levels=[0.0], colors=[colour])


def _poses(plt: Any, model: ExactModel, found: Located, groups: list[tuple[str, list[LocusBranch]]]) -> Any:
    columns = min(3, len(groups))
    figure = plt.figure(figsize=(4.6 * columns, 4.6 * -(-len(groups) // columns)))
    for place, (text, branches) in enumerate(groups, start=1):
        axes = figure.add_subplot(-(-len(groups) // columns), columns, place, projection="3d")
        points = _points(found, branches[:1], _TRIES)
        axes.set_title(text if len(text) < 46 else text[:43] + "...", fontsize=9)
        if not len(points):
            continue
        links, joints, tips = _links(model, points[0])
        # NaN ends a line
        lines = np.concatenate([links, np.full((len(links), 1, 3), np.nan)], axis=1).reshape(-1, 3)
        axes.plot(*lines.T, color=style.BLUE)
        axes.plot(*joints.T, "o", color=style.BLUE, markersize=4)
        axes.plot(*tips.T, "o", color=style.RED)
        ends = links.reshape(-1, 3)
        middle, size = (ends.max(0) + ends.min(0)) / 2, max(float(np.ptp(ends, axis=0).max()), 1e-3) / 2
        for letter, at in zip("xyz", middle, strict=True):
            getattr(axes, f"set_{letter}lim")(at - size, at + size)
            getattr(axes, f"set_{letter}label")(f"{letter} [m]", fontsize=8)
    return figure


def _links(model: ExactModel, point: Array) -> tuple[Array, Array, Array]:
    """Lines between frames and those before them ``[m, 2, 3]``, origins of joints, and last frames of each arm [m].

    Lines are of all that moves: an arm whose carrier is locked stands alone, with a carrier come the arms on it.
    """
    robot = model.robot.model
    data = robot.createData()
    pin.framesForwardKinematics(robot, data, model.configuration(point))
    places = np.array([pose.translation for pose in data.oMf])
    moving = [k for k, f in enumerate(robot.frames) if f.parentJoint > 0]
    links = np.array([(places[robot.frames[k].parentFrame], places[k]) for k in moving])
    last = {f.parentJoint: k for k, f in enumerate(robot.frames)}
    ends = [last[j] for j in range(robot.njoints) if j in last and not len(robot.children[j])]
    return links, np.array([data.oMi[j].translation for j in range(1, robot.njoints)]), places[ends]
