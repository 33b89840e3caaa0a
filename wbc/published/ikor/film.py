"""A run as a film: links, platform, obstacles and the way of the tool, and the norm of each step beside them."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc import style, validation
from wbc.published.ikor.driver import CourseRun
from wbc.published.ikor.machines import ArmMachine
from wbc.validation import Array

#: Pictures of a film, at most
MOST = 40
#: Pictures of a film a second [1/s]
RATE = 10
SUFFIXES = (".gif", ".html")


def save_film(
    machine: ArmMachine, run: CourseRun, spheres: Array, file: Any, polygons: Sequence[Array] = ()
) -> pathlib.Path:
    """``.gif``, or ``.html``: a page that plays, steps and scrubs.

    Raises:
        UnknownNameError: a file of another kind. RangeError: a run without a step.
    """
    from matplotlib.animation import FuncAnimation, HTMLWriter, PillowWriter

    path = pathlib.Path(file)
    validation.one_of("file", path.suffix, SUFFIXES)
    validation.integer("steps", len(run.norms), 1)
    shown = np.unique(np.linspace(0, len(run.norms), MOST).round().astype(int))
    points = np.array([machine.points(q) for q in run.q])
    loops = [np.column_stack((np.vstack((loop, loop[:1])), np.zeros(len(loop) + 1))) for loop in polygons]
    corners = np.vstack((points.reshape(-1, 3), *(spheres[:, :3] + s * spheres[:, 3:] for s in (-1, 1)), *loops))
    middle, half = 0.5 * (corners.max(axis=0) + corners.min(axis=0)), 0.55 * np.ptp(corners, axis=0).max()
    with style.pyplot() as plt:
        figure = plt.figure(figsize=(9.0, 4.4))
        figure.subplots_adjust(0.02, 0.12, 0.98, 0.97, wspace=0.3)
        scene, graph = figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)
        scene.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half),
                  zlim=(middle[2] - half, middle[2] + half), box_aspect=(1, 1, 1), xlabel="x [m]", ylabel="y [m]",
                  zlabel="z [m]")  # fmt: skip
        u, w = np.meshgrid(np.linspace(0, 2 * np.pi, 13), np.linspace(0, np.pi, 7))
        ball = np.cos(u) * np.sin(w), np.sin(u) * np.sin(w), np.cos(w)
        for *centre, radius in spheres:
            x, y, z = (c + radius * b for c, b in zip(centre, ball, strict=True))
            scene.plot_wireframe(x, y, z, color=style.ORANGE, lw=0.8)
        for loop in loops:
            scene.plot(*loop.T, color=style.ORANGE, lw=1.5)
        trace, links = (scene.plot([], [], [], **looks)[0] for looks in (
            {"color": style.GREY, "lw": 1.0}, {"color": style.BLUE, "lw": 3.0, "marker": "o", "ms": 4}))  # fmt: skip
        plate = scene.plot([], [], [], color="black", lw=1.5)[0]
        graph.plot(np.arange(1, len(run.norms) + 1), run.norms)
        here = graph.axvline(0, color="black", lw=1.0)
        graph.set(yscale="log" if run.norms.min() > 0.0 else "linear", xlabel="step", ylabel="norm [deg$^2$]")

        def draw(k: int) -> None:
            links.set_data_3d(points[k].T)
            trace.set_data_3d(points[: k + 1, -1].T)
            here.set_xdata([k, k])
            if machine.base != "none":
                x, y, turn = run.q[k, -3:]
                # The disc, and the way that it looks
                around = turn + np.concatenate(([0.0], np.linspace(0.0, 2.0 * np.pi, 25)))
                out = np.concatenate(([0.0], np.full(25, machine.plate)))
                plate.set_data_3d(x + out * np.cos(around), y + out * np.sin(around), 0.0 * out)

        film = FuncAnimation(figure, draw, frames=shown.tolist())
        film.save(path, PillowWriter(RATE) if path.suffix == ".gif" else HTMLWriter(RATE, embed_frames=True), dpi=80)
        plt.close(figure)
    return path
