"""Plots and one picture of a run, from its log."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np

from wbc import style
from wbc.log import Log
from wbc.log.plots import LogPanel, over_time, save_each, tick_histogram
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.shapes import Sphere
from wbc.track.page import stretches
from wbc.track.scene import ELBOW, Scene
from wbc.track.summary import position_errors, rotation_angles
from wbc.validation import Array


def save_plots(log: Log, folder: pathlib.Path, progress: Callable[[str], None] | None = None) -> list[pathlib.Path]:
    """Write the plots that the log has data for; returns the files. An empty log gives none.

    joints, velocities, accelerations (with their limits), errors, plane (commanded and reached), clearance (by link,
    measured anew), tick_time.
    """
    if len(log) == 0:
        return []
    draws: dict[str, Callable[[Any], Any]] = {
        "joints": lambda plt: _dofs(plt, log, "q", "Joint positions", ("position_lower", "position_upper")),
        "velocities": lambda plt: _dofs(plt, log, "v", "Joint velocities", ("velocity",)),
        "accelerations": lambda plt: _dofs(plt, log, "a", "Joint accelerations", ("acceleration",)),
        "errors": lambda plt: _errors(plt, log),
        "tick_time": lambda plt: tick_histogram(
            plt, log["tick"], f"Tick time, {len(log)} ticks, {log.meta['solver']} ({log.meta['backend']})"
        ),
    }
    if "plane.command" in log:
        draws["plane"] = lambda plt: _plane(plt, log)
    if log.group("clearance"):
        draws["clearance"] = lambda plt: _clearance(plt, log)
    return save_each(draws, folder, progress)


def _dofs(plt: Any, log: Log, group: str, title: str, limits: tuple[str, ...]) -> Any:
    """A panel for each degree of freedom that has a curve, forbidden ranges shaded."""
    curves = {name: values for name, values in log.group(group).items() if name in log.meta["dofs"]}
    panels = [
        LogPanel(
            log.units[f"{group}.{name}"],
            [(values, style.BLUE, "")],
            *_range(log, limits, log.meta["dofs"].index(name)),
            name,
        )
        for name, values in curves.items()
    ]
    shaded = "" if all(x is None for name in limits for x in log.meta["limits"][name]) else ", limits in red"
    return over_time(plt, log["t"], panels, f"{title}{shaded}", 2 if len(panels) <= 8 else 4)


def _range(log: Log, limits: tuple[str, ...], index: int) -> tuple[float, float]:
    values = [log.meta["limits"][name][index] for name in limits]
    if len(values) == 2:
        return (
            -math.inf if values[0] is None else float(values[0]),
            math.inf if values[1] is None else float(values[1]),
        )
    return (-math.inf, math.inf) if values[0] is None else (-float(values[0]), float(values[0]))


def _errors(plt: Any, log: Log) -> Any:
    """Position and rotation error of the frame, and of the elbow plane where there is one."""
    curves = [("position error [mm]", 1e3 * position_errors(log), style.BLUE)]
    if log.meta.get("kind") != "position":
        curves.append(("rotation error [deg]", np.degrees(rotation_angles(log)), style.PURPLE))
    if "plane.command" in log:
        curves.append(("elbow plane error [deg]", np.degrees(log["error.plane.plane"]), style.ORANGE))
    panels = [LogPanel(label, [(values, colour, "")]) for label, values, colour in curves]
    figure = over_time(plt, log["t"], panels, f"Task errors of {log.meta['frame']}")
    for axis in figure.axes:
        _mark(axis, log)
    _mark_legend(figure.axes[0], log)
    return figure


def _plane(plt: Any, log: Log) -> Any:
    """Angle of the elbow plane, commanded and reached."""
    figure, panel = plt.subplots(figsize=(9.2, 3.6), layout="constrained")
    _mark(panel, log)
    angle = np.degrees(np.unwrap(log["plane.angle"]))
    panel.plot(log["t"], np.degrees(log["plane.command"]), color=style.GREY, ls=(0, (4, 2)), label="commanded")
    panel.plot(log["t"], angle, color=style.ORANGE, lw=2.2, label="reached")
    panel.set_xlabel("time [s]")
    panel.set_ylabel("angle [deg]")
    panel.margins(x=0.01)
    panel.set_title("Angle of the elbow plane, 0 = elbow up", fontsize=13)
    _mark_legend(panel, log)
    return figure


def _clearance(plt: Any, log: Log) -> Any:
    """Distance of each link's shapes to the nearest obstacle."""
    curves = log.group("clearance")
    nearest = sorted(curves, key=lambda link: float(curves[link].min()))[:7]
    margin = 1e3 * log.meta["margin"]
    figure, panel = plt.subplots(figsize=(9.2, 4.0), layout="constrained")
    for link in [name for name in curves if name in nearest]:
        panel.plot(log["t"], 1e3 * curves[link], label=link)
    top = 6.0 * max(margin, 20.0) + 1e3 * max(0.0, float(curves[nearest[0]].min()))
    panel.set_ylim(min(0.0, 1.1e3 * float(curves[nearest[0]].min())), top)
    if margin > 0.0:
        panel.axhspan(panel.get_ylim()[0], margin, color=style.RED, alpha=0.12, lw=0)
        panel.axhline(margin, color=style.RED, lw=1.0)
        panel.annotate("margin", (log["t"][0], margin), (4, -4), textcoords="offset points", va="top", color=style.RED)
    panel.set_xlabel("time [s]")
    panel.set_ylabel("distance to the nearest obstacle [mm]")
    panel.margins(x=0.01)
    panel.set_title("Clearance of the links' shapes", fontsize=13)
    panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _mark(panel: Any, log: Log) -> None:
    """Shade the ticks at which an obstacle binds."""
    t, dt = log["t"], log.meta["dt"]
    for start, end in stretches(_obstacle_binds(log)):
        panel.axvspan(t[start], t[end - 1] + dt, color=style.RED, alpha=0.10, lw=0)


def _mark_legend(panel: Any, log: Log) -> None:
    handles, labels = panel.get_legend_handles_labels()
    if _obstacle_binds(log).any():
        from matplotlib.patches import Patch

        handles.append(Patch(color=style.RED, alpha=0.15))
        labels.append("an obstacle binds")
    if handles:
        panel.legend(handles, labels, loc="upper right", ncols=len(labels), bbox_to_anchor=(1.0, 1.16))


def _obstacle_binds(log: Log) -> Array:
    out = np.zeros(len(log), dtype=bool)
    for name, flags in log.group("binding").items():
        if name.split("/")[0] in log.meta["obstacles"]:
            out |= flags
    return out


def save_picture(
    log: Log, robot: Robot, file: pathlib.Path, main: float | None = None, size: tuple[int, int] = (960, 600)
) -> pathlib.Path | None:
    """Draw a run; returns the file, or None for a log without ticks.

    Args:
        main: time [s] at which the robot is drawn solid; default: where it is nearest to an obstacle, else the middle.
        size: width and height [pixels].
    """
    if len(log) == 0:
        return None
    solid = _main_tick(log) if main is None else int(np.argmin(np.abs(log["t"] - main)))
    scene = Scene(robot, dark=(log.meta["frame"],))
    scene.add_robot(log.array("q")[solid])
    for k in _other_ticks(log, solid):
        scene.add_robot(log.array("q")[k], pale=True)
    scene.add_path(log.array("pose")[:, :3], f"path of {log.meta['frame']}")
    if "plane.command" in log:
        scene.add_path(_elbow(log, robot), "path of the elbow", ELBOW, radius=0.004)
    for obstacle in log.meta["obstacles"].values():
        if obstacle["radius"] is not None:
            center = np.array(obstacle["pose"])[:3, 3] + float(log["t"][solid]) * np.array(obstacle["velocity"])
            scene.add_shape(Sphere(obstacle["radius"]), pin.SE3(np.eye(3), center), "obstacles")
    return scene.save(file, size)


def _main_tick(log: Log) -> int:
    gaps = log.array("clearance")
    return int(np.argmin(gaps.min(axis=1))) if gaps.size else len(log) // 2


def _other_ticks(log: Log, solid: int) -> list[int]:
    """Up to two ticks at which the frame is far from where it is at the main one, and far from each other."""
    place = log.array("pose")[:, :3]
    chosen: list[int] = []
    away = np.linalg.norm(place - place[solid], axis=1)
    least = 0.3 * float(away.max())
    while len(chosen) < 2 and away.max() > max(least, 0.02):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(place - place[chosen[-1]], axis=1))
    return chosen


def _elbow(log: Log, robot: Robot) -> Array:
    data = robot.model.createData()
    index = robot.model.getFrameId(robot.frames["elbow"])
    points = []
    for q in log.array("q"):
        pin.framesForwardKinematics(robot.model, data, q)
        points.append(data.oMf[index].translation.copy())
    return np.array(points)
