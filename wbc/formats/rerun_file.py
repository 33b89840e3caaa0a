"""Runs as recordings of Rerun."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from wbc.formats.messages import AXIS
from wbc.formats.run import Run, SeenTick
from wbc.formats.sink import Sink
from wbc.formats.tick_tree import by_first
from wbc.log import Log

#: Ticks that are sent together
TOGETHER = 5000
#: Time line
TIME = "time"


class RerunSink(Sink):
    """A file ``.rrd``: bodies, targets, obstacles, binding rows, margins, reasons and all numbers on one time line."""

    needs = ("rerun", "a recording of Rerun")

    def __init__(self, path: pathlib.Path) -> None:
        import rerun

        self._rerun, self._stream = rerun, rerun.RecordingStream("wbc")
        self._stream.save(path)
        self._kept = list[Log]()
        self._binding: tuple[str, ...] | None = None

    def begin(self, run: Run) -> None:
        rerun, log, groups = self._rerun, self._stream.log, _groups(run.units)
        self._stream.send_blueprint(_layout(groups))
        log("about", rerun.TextDocument(json.dumps(run.about, indent=1)), static=True)
        log("scene", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for kind, bodies in (("robot", run.meshes), ("obstacle", run.obstacles)):
            for name, (corners, triangles, colour) in bodies.items():
                shade = {"albedo_factor": [*colour, 255]}
                surface = rerun.Mesh3D(vertex_positions=corners, triangle_indices=triangles, **shade)
                log(f"scene/{kind}/{name}", surface, static=True)
        for group, members in groups.items():
            names = [name.partition(".")[2] or group for name in members]
            log(f"tick/{group}", rerun.SeriesLines(names=names), static=True)

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        for moment in seen:
            self._stream.set_time(TIME, duration=moment.t)
            self._show(moment)
        self._kept.append(log)
        if sum(map(len, self._kept)) >= TOGETHER:
            self._send()

    def _show(self, seen: SeenTick) -> None:
        rerun, log = self._rerun, self._stream.log
        for name in seen.targets:
            log(f"scene/target/{name}", rerun.Arrows3D(vectors=AXIS * np.eye(3), colors=np.eye(3)))
        for kind, poses in (("robot", seen.frames), ("obstacle", seen.obstacles), ("target", seen.targets)):
            for name, pose in poses.items():
                log(f"scene/{kind}/{name}", rerun.Transform3D(translation=pose[:3], quaternion=pose[3:]))
        for name, margin in (seen.margins or {}).items():
            log(f"margin/{name}", rerun.Scalars(margin))
        if seen.binding != self._binding and seen.status:
            self._binding = seen.binding
            log("binding", rerun.TextDocument("\n".join([seen.status, *seen.binding])))
        if seen.why:
            log("why", rerun.TextLog(seen.why, level="INFO" if seen.status == "solved" else "WARN"))

    def _send(self) -> None:
        """Numbers of the ticks that are kept; some thousand together take little place."""
        logs, self._kept = self._kept, []
        if not logs:
            return
        times = self._rerun.TimeColumn(TIME, duration=np.concatenate([log["t"] for log in logs]))
        for group, members in _groups(logs[0].columns).items():
            rows = [np.column_stack([log[name] for name in members]) for log in logs]
            numbers = np.concatenate(rows, dtype=np.float64)
            columns = self._rerun.Scalars.columns(scalars=numbers.ravel()).partition([len(members)] * len(numbers))
            self._stream.send_columns(f"tick/{group}", indexes=[times], columns=columns)

    def close(self) -> None:
        self._send()
        self._stream.flush()
        self._stream.disconnect()


def _layout(groups: Iterable[str]) -> Any:
    """What the viewer shows: the scene beside binding rows, margins, residuals and reasons."""
    import rerun.blueprint as views

    curves = [
        views.TimeSeriesView(origin=f"tick/{group}", name=group) for group in ("v", "residual") if group in groups
    ]
    told = [views.TextDocumentView(origin="binding"), views.TimeSeriesView(origin="margin"), *curves]
    scene = views.Vertical(views.Spatial3DView(origin="scene"), views.TextLogView(origin="why"), row_shares=[3, 1])
    whole = views.Horizontal(scene, views.Vertical(*told), column_shares=[3, 2])
    return views.Blueprint(whole, collapse_panels=True)


def _groups(names: Iterable[str]) -> dict[str, list[str]]:
    """What columns ``group.member`` begin with -> these columns."""
    return {group: list(members.values()) for group, members in by_first({name: name for name in names}).items()}
