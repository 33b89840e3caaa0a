"""Runs as recordings of Rerun."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from wbc import extras
from wbc.formats.messages import AXIS
from wbc.formats.run import Run, SeenTick
from wbc.log import Log

#: Ticks that are sent together
TOGETHER = 5000
#: Time line
TIME = "time"


class RerunSink:
    """A file ``.rrd``: bodies, targets, obstacles, binding rows, margins, reasons and all numbers on one time line.

    Raises:
        MissingPackageError: rerun-sdk is not installed.
    """

    def __init__(self, path: pathlib.Path) -> None:
        extras.require("rerun", "a recording of Rerun")
        import rerun

        self._rerun = rerun
        self._stream = rerun.RecordingStream("wbc")
        self._stream.save(path)
        self._kept: list[Log] = []
        self._binding: tuple[str, ...] | None = None

    def begin(self, run: Run) -> None:
        """Bodies, and what the curves are called."""
        rerun, log = self._rerun, self._log
        self._stream.send_blueprint(self._layout(run))
        log("about", rerun.TextDocument(json.dumps(run.about, indent=1)), static=True)
        log("scene", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for kind, bodies in (("robot", run.meshes), ("obstacle", run.obstacles)):
            for name, body in bodies.items():
                colour = [*body.colour, 255]
                surface = rerun.Mesh3D(
                    vertex_positions=body.corners, triangle_indices=body.triangles, albedo_factor=colour
                )
                log(f"scene/{kind}/{name}", surface, static=True)
        for group, members in _groups(run.units).items():
            names = [name.partition(".")[2] or group for name in members]
            log(f"tick/{group}", rerun.SeriesLines(names=names), static=True)

    def _layout(self, run: Run) -> Any:
        """What the viewer shows: the scene beside binding rows, margins, residuals and reasons."""
        import rerun.blueprint as views

        shown = [group for group in ("v", "residual") if group in _groups(run.units)]
        curves = [views.TimeSeriesView(origin=f"tick/{group}", name=group) for group in shown]
        told = [views.TextDocumentView(origin="binding"), views.TimeSeriesView(origin="margin"), *curves]
        scene = views.Vertical(views.Spatial3DView(origin="scene"), views.TextLogView(origin="why"), row_shares=[3, 1])
        whole = views.Horizontal(scene, views.Vertical(*told), column_shares=[3, 2])
        return views.Blueprint(whole, collapse_panels=True)

    def _log(self, path: str, what: Any, static: bool = False) -> None:
        self._stream.log(path, what, static=static)

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        """Ticks, some thousand at a time, and what is seen of some of them."""
        for moment in seen:
            self._stream.set_time(TIME, duration=moment.t)
            self._show(moment)
        self._kept.append(log)
        if sum(map(len, self._kept)) >= TOGETHER:
            self._send()

    def _show(self, seen: SeenTick) -> None:
        rerun = self._rerun
        for name in seen.targets:
            self._log(f"scene/target/{name}", rerun.Arrows3D(vectors=AXIS * np.eye(3), colors=np.eye(3)))
        for kind, poses in (("robot", seen.frames), ("obstacle", seen.obstacles), ("target", seen.targets)):
            for name, pose in poses.items():
                self._log(f"scene/{kind}/{name}", rerun.Transform3D(translation=pose[:3], quaternion=pose[3:]))
        for name, margin in (seen.margins or {}).items():
            self._log(f"margin/{name}", rerun.Scalars(margin))
        if seen.binding != self._binding and seen.status:
            self._binding = seen.binding
            self._log("binding", rerun.TextDocument("\n".join([seen.status, *seen.binding])))
        if seen.why:
            self._log("why", rerun.TextLog(seen.why, level="INFO" if seen.status == "solved" else "WARN"))

    def _send(self) -> None:
        logs, self._kept = self._kept, []
        if not logs:
            return
        times = np.concatenate([log["t"] for log in logs])
        for group, members in _groups(logs[0].columns).items():
            numbers = np.concatenate(
                [np.column_stack([log[name] for name in members]) for log in logs], dtype=np.float64
            )
            scalars = self._rerun.Scalars.columns(scalars=numbers.ravel())
            self._stream.send_columns(
                f"tick/{group}",
                indexes=[self._rerun.TimeColumn(TIME, duration=times)],
                columns=scalars.partition([numbers.shape[1]] * len(times)),
            )

    def close(self) -> None:
        """Write what is left."""
        self._send()
        self._stream.flush()
        self._stream.disconnect()


def _groups(names: Iterable[str]) -> dict[str, list[str]]:
    """What columns ``group.member`` begin with -> these columns."""
    out: dict[str, list[str]] = {}
    for name in names:
        out.setdefault(name.partition(".")[0], []).append(name)
    return out
