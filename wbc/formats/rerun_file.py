"""Runs as recordings of Rerun."""

from __future__ import annotations

import json
import pathlib
from typing import Any

import numpy as np

from wbc import extras
from wbc.formats.messages import AXIS
from wbc.formats.run import Run, SeenTick
from wbc.log import Log
from wbc.validation import Array

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
        log, mesh = self._log, self._rerun.Mesh3D
        self._stream.send_blueprint(self._layout(run))
        log("about", self._rerun.TextDocument(json.dumps(run.about, indent=1)), static=True)
        log("scene", self._rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        bodies = {f"scene/robot/{name}": body for name, body in run.meshes.items()}
        bodies |= {f"scene/obstacle/{name}": body for name, body in run.obstacles.items()}
        for path, body in bodies.items():
            surface = mesh(
                vertex_positions=body.corners, triangle_indices=body.triangles, albedo_factor=[*body.colour, 255]
            )
            log(path, surface, static=True)
        groups: dict[str, list[str]] = {}
        for name in run.units:
            group, _, member = name.partition(".")
            groups.setdefault(group, []).append(member or group)
        for group, names in groups.items():
            log(f"tick/{group}", self._rerun.SeriesLines(names=names), static=True)

    def _layout(self, run: Run) -> Any:
        """What the viewer shows: the scene beside binding rows, margins, residuals and reasons."""
        import rerun.blueprint as views

        groups = {name.partition(".")[0] for name in run.units}
        curves = [
            views.TimeSeriesView(origin=f"tick/{group}", name=group) for group in ("v", "residual") if group in groups
        ]
        told = [views.TextDocumentView(origin="binding"), views.TimeSeriesView(origin="margin"), *curves]
        scene = views.Vertical(views.Spatial3DView(origin="scene"), views.TextLogView(origin="why"), row_shares=[3, 1])
        return views.Blueprint(
            views.Horizontal(scene, views.Vertical(*told), column_shares=[3, 2]), collapse_panels=True
        )

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
        placed = {f"scene/robot/{name}": pose for name, pose in seen.frames.items()}
        placed |= {f"scene/obstacle/{name}": pose for name, pose in seen.obstacles.items()}
        for name, pose in seen.targets.items():
            self._log(f"scene/target/{name}", rerun.Arrows3D(vectors=AXIS * np.eye(3), colors=np.eye(3)))
            placed[f"scene/target/{name}"] = pose
        for path, pose in placed.items():
            self._log(path, rerun.Transform3D(translation=pose[:3], quaternion=pose[3:]))
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
        columns: dict[str, list[Array]] = {}
        for name in logs[0].columns:
            columns.setdefault(name.partition(".")[0], []).append(np.concatenate([log[name] for log in logs]))
        for group, members in columns.items():
            numbers = np.column_stack(members).astype(np.float64)
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
