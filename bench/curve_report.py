"""The growing problems as tables and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.harness import OURS
from bench.sheet import Sheet, line, us

TITLES = {
    "joints": "Tick against joints: two poses, posture, limits; medians [us]",
    "tasks": "Tick against tasks: pose tasks on Talos, posture, limits; medians [us]",
    "spheres": "Tick against obstacles: a Panda's 10 link capsules against spheres, a row for each pair; medians [us]",
    "sensed": "Tick against measured pairs: 5 boxes on a Panda's links against boxes; medians [us]",
    "g1": "Self-collision: Unitree G1, 4 poses, centre of mass, posture, limits, 20 pairs of capsules; medians [us]",
}
#: What grows; panels of the picture are those where it says so
AXES = {
    "joints": "degrees of freedom", "tasks": "pose tasks", "spheres": "spheres", "sensed": "pairs", "g1": "",
}  # fmt: skip
COLOURS = {"wbc": "#0b6e4f", "pink + daqp": "#c2185b", "mink + daqp": "#1565c0", "placo": "#ef6c00"}

NOTES = """\
Targets are those of a path of the joints, all within reach; velocity limits, position limits and a \
posture task. Degrees of freedom count the base's six where it floats. Switched off for wbc in all of them, \
because the peers have no such limit: `JointLimits(acceleration=False)`; all else is at its \
default (look-ahead and certificate on, `calm=True`, whose curvature and damping the QPs of the peers do not have). \
Three rounds of up to one pass or a quarter of a second; a dash in place of an end error: too slow for a whole pass in \
that time.

Obstacles: wbc and pink have a row for every pair in every tick. mink and placo have rows for pairs nearer than 15 cm \
only, and mink leaves out the link next to the base, whose parent is the world like the obstacles': 9 pairs a sphere \
instead of 10. placo's constraint has no rate. What pink costs with rows for the 8 nearest only is in the table of \
measured pairs.

Measured pairs: wbc and pink have rows for the 8 nearest of all pairs, mink and placo for those nearer than 15 cm. The \
boxes in the world are one `Obstacle` for wbc, each a hull of eight corners.

Self-collision: all have the same 20 pairs of the same capsules, fitted to the meshes of the links; wbc and pink have \
a row for each pair, mink and placo for those nearer than 15 cm, mink's second column for those nearer than its \
default of 1 cm, which lets joints close in faster than the rate of the others. mink's model is the same URDF, read by \
MuJoCo, with these capsules as its geoms."""


#: What is said of a path
KEYS = ("position", "clearance")


def curve_sheets(curves: Sequence[dict[str, Any]]) -> list[Sheet]:
    """Tables of all curves."""
    out = []
    for curve, title in TITLES.items():
        found = [point for point in curves if point["curve"] == curve]
        if found:
            out += [medians(title, curve, found), same_job(curve, found)]
    return out


def medians(title: str, curve: str, found: Sequence[dict[str, Any]]) -> Sheet:
    """Median of the call, and its ratio to this package's."""
    names = list(found[0]["contenders"])
    rows = []
    for point in found:
        spent = [point["contenders"][name]["median"] for name in names]
        cells = (
            us(x) if name == OURS else f"{us(x)} ({x / spent[0]:.1f}x)" for name, x in zip(names, spent, strict=True)
        )
        rows.append((point["label"], *cells))
    return Sheet(title, (AXES[curve], *names), rows)


def same_job(curve: str, found: Sequence[dict[str, Any]]) -> Sheet:
    """End errors [mm] and least clearances [mm] of all."""
    names = list(found[0]["contenders"])
    clear = any(one["clearance"] is not None for point in found for one in point["contenders"].values())
    keys, what = (KEYS, "End error / least clearance [mm]") if clear else (KEYS[:1], "End error [mm]")
    rows = []
    for point in found:
        some = [[point["contenders"][name][key] for key in keys] for name in names]
        cells = (" / ".join("-" if x is None else f"{x * 1e3:.2f}" for x in numbers) for numbers in some)
        rows.append((point["label"], *cells))
    return Sheet(what, (AXES[curve], *names), rows)


def curve_readme(curves: Sequence[dict[str, Any]]) -> list[str]:
    """The README's second table: the ends of the curves."""
    chosen = [
        ("joints", 7.0, "7 joints, 2 poses"), ("joints", 49.0, "49 degrees of freedom, 2 poses"),
        ("tasks", 1.0, "Talos, 1 pose"), ("tasks", 20.0, "Talos, 20 poses"),
        ("spheres", 5.0, "Panda, 5 spheres"), ("spheres", 50.0, "Panda, 50 spheres"),
        ("sensed", 20.0, "Panda, 20 measured pairs"), ("sensed", 200.0, "Panda, 200 measured pairs"),
        ("g1", 20.0, "Unitree G1, 4 poses, self-collision of 20 pairs"),
    ]  # fmt: skip
    by_place = {(point["curve"], point["x"]): point for point in curves}
    names = list(curves[0]["contenders"])
    lines = [line(["one tick [us], medians", *names]), line(["---", *("---:" for _ in names)])]
    for curve, x, label in chosen:
        found = by_place[curve, x]["contenders"]
        lines.append(line([label, *(us(found[name]["median"]) for name in names)]))
    return lines


def draw(curves: Sequence[dict[str, Any]], path: Path) -> None:
    """One panel a curve, medians of the tick over what grows, written as PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    panels = [curve for curve in AXES if AXES[curve]]
    figure, axes = plt.subplots(1, len(panels), figsize=(13.0, 3.4), sharey=True, layout="constrained")
    for axis, curve in zip(axes, panels, strict=True):
        found = [point for point in curves if point["curve"] == curve]
        for name, colour in COLOURS.items():
            places = [(p["x"], p["contenders"][name]["median"]) for p in found if name in p["contenders"]]
            axis.plot(*zip(*places, strict=True), "o-", color=colour, label=name, markersize=4) if places else None
        axis.set_yscale("log")
        axis.set_xlabel(AXES[curve])
        axis.set_xlim(left=0.0)
        axis.grid(alpha=0.3, which="major")
    axes[0].set_ylabel("median of one tick [us]")
    axes[0].legend(loc="upper left", fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
