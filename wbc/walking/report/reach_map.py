"""A map of all holds: which arm can use each over the walk, and why none can."""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import style
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import LIMIT_NAMES, limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import CylinderSurface
from wbc.walking.planner.grips.held import held
from wbc.walking.report.surroundings import arm_colour
from wbc.walking.run.session import WalkRun

FILE = "reach_map.png"
#: Poses of the body's path that are looked at, at most
SAMPLES = 80
#: Shown beyond usable holds [m]
EDGE = 0.6
#: Reason -> colour of a hold that no arm can use
REASONS = {
    "out of reach": "#d7dbe0",
    "joint limits": style.RED,
    "elbow or shoulder limit": style.PURPLE,
    "faces away": "#b08900",
}
#: Holds are round about something where the approach of one has less than this along the mean approach
ROUND = 0.5


def why_unusable(walker: Walker, structure: Structure, path: BodyPath) -> tuple[NDArray[np.bool_], list[str]]:
    """(whether an arm can use a hold somewhere along a path ``[holds, arms]``, why no arm can, "" where one can).

    The reason is that of the arm and the place that come nearest to it: a limit, else that it faces away, else reach.
    """
    limb, least = limb_of(walker), walker.margins.facing
    poses = path.poses[np.unique(np.linspace(0, len(path) - 1, min(SAMPLES, len(path))).round().astype(int))]
    usable = np.zeros((len(structure), len(walker.arms)), dtype=bool)
    best = np.full(len(structure), -np.inf)
    limit = np.full(len(structure), -1)
    facing = np.zeros(len(structure), dtype=bool)
    everywhere = np.arange(len(structure))
    for k, arm in enumerate(walker.arms):
        there = held(limb, structure, poses @ arm.base.homogeneous, everywhere, reach=0.0, facing=-np.inf)
        ahead = there.axes[:, 2] > least
        facing[there.hold[~ahead]] = True
        margins, hold = there.margins[ahead], there.hold[ahead]
        if not len(hold):
            continue
        usable[np.unique(hold[there.within(0.0)[ahead].any(axis=1)]), k] = True
        most = margins.min(axis=-1)
        branch, rows = most.argmax(axis=1), np.arange(len(hold))
        _keep_best(hold, most[rows, branch], margins[rows, branch].argmin(axis=1), best, limit)
    return usable, [_reason(usable[h], int(limit[h]), bool(facing[h])) for h in range(len(structure))]


def save_reach_map(run: WalkRun, folder: pathlib.Path) -> pathlib.Path:
    """Draws the holds on the unrolled surface into ``reach_map.png``: arms that can use them as sectors of their
    colours, holds that are used with a rim, reasons as colours; and the body's path.
    """
    path = run.path
    usable, reasons = why_unusable(run.walker, run.structure, path)
    places, label = unrolled(run.structure, run.structure.positions)
    way, _ = unrolled(run.structure, path.poses[:, :3, 3])
    with style.pyplot() as plt:
        low, high = _window(places[usable.any(axis=1)], places, way)
        span = high - low
        width = 9.2
        figure, panel = plt.subplots(
            figsize=(width, float(np.clip(width * span[1] / span[0], 2.2, 9.0)) + 1.3), layout="constrained"
        )
        panel.plot(*way.T, color=style.INK, lw=1.2, zorder=1)
        panel.plot(*way[-1], marker=">", color=style.INK, ms=7, zorder=1)
        none = ~usable.any(axis=1)
        for reason, colour in REASONS.items():
            rows = none & np.array([r == reason for r in reasons])
            if rows.any():
                panel.scatter(*places[rows].T, s=30, color=colour, marker="X", lw=0, label=f"{reason}: {rows.sum()}")
        _sectors(panel, places, usable, run)
        _rims(panel, places, run)
        panel.set_aspect("equal")
        panel.set_xlim(low[0], high[0])
        panel.set_ylim(low[1], high[1])
        panel.set_xlabel(label[0])
        panel.set_ylabel(label[1])
        panel.grid(visible=False)
        panel.set_title(f"Holds of the {run.structure.name} that arms can use along the body's path", fontsize=13)
        figure.legend(loc="outside lower center", ncols=4, fontsize=9)
        file = folder / FILE
        figure.savefig(file)
        plt.close(figure)
    return file


def unrolled(structure: Structure, points: Array) -> tuple[Array, tuple[str, str]]:
    """Points on the plane that a surface rolls out to, [n, 2] [m], and labels of its axes."""
    surface = structure.surface
    if isinstance(surface, CylinderSurface):
        local = (points - surface.pose.translation) @ surface.pose.rotation
        centre = ((structure.positions - surface.pose.translation) @ surface.pose.rotation).mean(axis=0)
        angle = np.arctan2(local[:, 1], local[:, 0]) - np.arctan2(centre[1], centre[0])
        angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
        return np.stack([-local[:, 2], -surface.radius * angle], axis=1), (
            "along the axis [m]",
            "round the surface [m]",
        )
    mean = structure.axes.mean(axis=0)
    if float((structure.axes @ mean).min()) < ROUND * float(np.linalg.norm(mean)):
        return _unrolled_inside(structure, points)
    # The plane across the mean approach direction, x along the widest spread of holds
    centre = structure.positions.mean(axis=0)
    up = -structure.axes.mean(axis=0)
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    off = structure.positions - centre
    off = off - np.outer(off @ up, up)
    x = np.linalg.svd(off, full_matrices=False)[2][0]
    x = x * (1.0 if x[np.abs(x).argmax()] > 0 else -1.0)
    return np.stack([(points - centre) @ x, (points - centre) @ np.cross(up, x)], axis=1), ("along [m]", "across [m]")


def _unrolled_inside(structure: Structure, points: Array) -> tuple[Array, tuple[str, str]]:
    """The same of holds all round, as on the inside of a cylinder: its axis d is what their approach directions a are
    across, its centre c the point that all of them point away from: min sum |(1 - a a') (p - c)|^2 across d.
    """
    axes, places = structure.axes, structure.positions
    _, _, rows = np.linalg.svd(axes, full_matrices=False)
    along = rows[2] * (1.0 if rows[2][np.abs(rows[2]).argmax()] > 0 else -1.0)
    across = np.stack([rows[0], np.cross(along, rows[0])])
    a, p = axes @ across.T, places @ across.T
    a /= np.maximum(np.linalg.norm(a, axis=1, keepdims=True), 1e-9)
    out = np.eye(2) - a[:, :, None] * a[:, None, :]
    centre = np.linalg.lstsq(out.sum(axis=0), np.einsum("kij,kj->i", out, p), rcond=None)[0]
    off = points @ across.T - centre
    radius = float(np.linalg.norm(p - centre, axis=1).mean())
    # Cut open where there is the widest gap between holds
    angles = np.sort(np.arctan2(*(p - centre).T[::-1]))
    gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    cut = angles[int(gaps.argmax())] + 0.5 * float(gaps.max())
    round_about = (np.arctan2(off[:, 1], off[:, 0]) - cut) % (2.0 * np.pi) - np.pi
    return np.stack([points @ along, radius * round_about], axis=1), ("along the axis [m]", "round the surface [m]")


def _window(usable: Array, places: Array, way: Array) -> tuple[Array, Array]:
    """Lowest and highest coordinates that are shown: the way, usable holds, and some of what is about them."""
    shown = np.concatenate([way, usable])
    low = np.maximum(shown.min(axis=0) - EDGE, np.minimum(places, way.min(axis=0)).min(axis=0) - 0.15)
    high = np.minimum(shown.max(axis=0) + EDGE, np.maximum(places, way.max(axis=0)).max(axis=0) + 0.15)
    return low, high


def _keep_best(
    hold: NDArray[np.int64], values: Array, limits: NDArray[np.int64], best: Array, limit: NDArray[np.int64]
) -> None:
    """Of every hold the largest value so far, and the limit that belongs to it."""
    order = np.argsort(values)  # the last write to a hold is its largest
    top = np.full(len(best), -np.inf)
    which = np.zeros(len(best), dtype=int)
    top[hold[order]], which[hold[order]] = values[order], limits[order]
    better = top > best
    best[better], limit[better] = top[better], which[better]


def _reason(usable: NDArray[np.bool_], limit: int, facing: bool) -> str:
    if usable.any():
        return ""
    if limit >= 0:
        return "joint limits" if LIMIT_NAMES[limit].startswith("joint") else "elbow or shoulder limit"
    return "faces away" if facing else "out of reach"


def _sectors(panel: Any, places: Array, usable: NDArray[np.bool_], run: WalkRun) -> None:
    """A disc of as many sectors as there are arms; those of arms that can use the hold are coloured."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Wedge

    count = usable.shape[1]
    for arm in range(count):
        start, end = 90.0 + 360.0 * arm / count, 90.0 + 360.0 * (arm + 1) / count
        wedges = [Wedge(tuple(places[h]), 0.075, start, end) for h in np.nonzero(usable[:, arm])[0]]
        panel.add_collection(PatchCollection(wedges, facecolor=arm_colour(arm), edgecolor="none", zorder=2))
        name = f"{run.walker.arms[arm].name} can: {len(wedges)}"
        panel.scatter([], [], s=60, color=arm_colour(arm), label=name)


def _rims(panel: Any, places: Array, run: WalkRun) -> None:
    """Holds that the plan uses."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    if run.plan is None:
        return
    # A hand that never held has no first hold
    names = {*run.plan.start, *(step.target for step in run.plan.regrasps)} - {""}
    rows = [run.structure.index(name) for name in sorted(names)]
    rims = [Circle(tuple(places[row]), 0.092) for row in rows]
    panel.add_collection(PatchCollection(rims, facecolor="none", edgecolor=style.INK, lw=1.6, zorder=3))
    panel.scatter([], [], s=150, facecolor="none", edgecolor=style.INK, lw=1.6, label=f"used: {len(rows)}")
