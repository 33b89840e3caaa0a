"""Runs as files: MCAP, Rerun, tables of text and of numpy, and datasets of LeRobot."""

from __future__ import annotations

import csv
import json
import pathlib
import time
from collections import Counter
from typing import Any

import numpy as np

from wbc.formats.errors import FormatError
from wbc.formats.messages import TICK, MessageSink, by_first
from wbc.formats.run import Run, SeenTick, Sink
from wbc.log import Log, save
from wbc.log.lerobot import write_lerobot_dataset
from wbc.validation import Array

#: Size of a chunk of MCAP, which is compressed by itself [bytes]
CHUNK = 1 << 18
#: A chunk is written when it is full, or this old: a reader, or a kill, misses no more [s]
OLD = 0.5
#: Ticks that are sent to Rerun together; some thousand take little place
TOGETHER = 5000
#: Largest difference of a tick's time from the grid of a dataset's frames [s]
TOLERANCE = 1e-4


class McapSink(MessageSink):
    """An MCAP file of JSON messages, in chunks compressed by zstd."""

    needs = ("formats", "MCAP")

    def __init__(self, path: pathlib.Path) -> None:
        import msgspec
        from mcap.writer import CompressionType, Writer

        self._encode = msgspec.json.Encoder().encode
        self._file, self._flushed = path.open("xb"), time.monotonic()
        # Any: half of the package has no types
        self._writer: Any = Writer(self._file, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        self._channels, self._counts = dict[str, int](), Counter[str]()

    def begin(self, run: Run) -> None:
        self._writer.start("", "wbc")
        self._writer.add_metadata("wbc", {"about": json.dumps(run.about), "remarks": "; ".join(run.remarks)})
        super().begin(run)

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        super().write(log, seen)
        if time.monotonic() > self._flushed + OLD:
            self._writer.flush()
            self._flushed = time.monotonic()

    def _open(self, topic: str, schema: dict[str, Any]) -> None:
        number = self._writer.register_schema(schema["title"], "jsonschema", json.dumps(schema).encode())
        about = {"columns": json.dumps(self._tree.names), "units": json.dumps(dict(self._run.units))}
        self._channels[topic] = self._writer.register_channel(topic, "json", number, about if topic == TICK else {})

    def _put(self, topic: str, when: int, data: dict[str, Any]) -> None:
        self._writer.add_message(self._channels[topic], when, self._encode(data), when, self._counts[topic])
        self._counts[topic] += 1

    def close(self) -> None:
        self._writer.finish()
        self._file.close()


class RerunSink(Sink):
    """A file ``.rrd``: bodies, targets, obstacles, binding rows, margins, reasons and all numbers on one time line."""

    needs = ("rerun", "a recording of Rerun")

    def __init__(self, path: pathlib.Path) -> None:
        import rerun

        super().__init__(path)
        self._rerun, self._stream, self._binding = rerun, rerun.RecordingStream("wbc"), ""
        self._stream.save(path)

    def begin(self, run: Run) -> None:
        super().begin(run)
        rerun, log = self._rerun, self._stream.log
        self._groups = by_first({name: name for name in run.units})
        self._stream.send_blueprint(self._layout())
        log("about", rerun.TextDocument(json.dumps(run.about, indent=1)), static=True)
        log("scene", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for frame, meshes in run.bodies.items():
            for k, (corners, triangles, (red, green, blue)) in enumerate(meshes):
                surface = {"vertex_positions": corners, "triangle_indices": triangles}
                log(f"scene/{frame}/{k}", rerun.Mesh3D(**surface, albedo_factor=[red, green, blue, 255]), static=True)
        for group, members in self._groups.items():
            log(f"tick/{group}", rerun.SeriesLines(names=[name or group for name in members]), static=True)

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        super().write(log, seen)
        rerun, show = self._rerun, self._stream.log
        for tick in seen:
            self._stream.set_time("time", duration=tick.t)
            for frame, pose in tick.poses.items():
                show(f"scene/{frame}", rerun.Transform3D(translation=pose[:3], quaternion=pose[3:]))
            if tick.status and (binding := "\n".join([tick.status, *tick.binding])) != self._binding:
                self._binding = binding
                show("binding", rerun.TextDocument(binding))
            if tick.why:
                show("why", rerun.TextLog(tick.why, level="INFO" if tick.status == "solved" else "WARN"))
        if sum(map(len, self._logs)) >= TOGETHER:
            self._send()

    def _send(self) -> None:
        log, rerun = self.taken(), self._rerun
        for group, members in self._groups.items():
            numbers = np.column_stack([log[name] for name in members.values()]).astype(np.float64)
            columns = rerun.Scalars.columns(scalars=numbers.ravel()).partition([len(members)] * len(numbers))
            times = rerun.TimeColumn("time", duration=log["t"])
            self._stream.send_columns(f"tick/{group}", indexes=[times], columns=columns)

    def close(self) -> None:
        self._send()
        self._stream.flush()
        self._stream.disconnect()

    def _layout(self) -> Any:
        """What the viewer shows: the scene beside binding rows, margins, commands and residuals."""
        import rerun.blueprint as views

        groups = [group for group in ("margin", "v", "residual") if group in self._groups]
        curves = [views.TimeSeriesView(origin=f"tick/{group}", name=group) for group in groups]
        told = views.Vertical(views.TextDocumentView(origin="binding"), *curves)
        scene = views.Vertical(views.Spatial3DView(origin="scene"), views.TextLogView(origin="why"), row_shares=[3, 1])
        return views.Blueprint(views.Horizontal(scene, told, column_shares=[3, 2]), collapse_panels=True)


class CsvSink(Sink):
    """A row a tick; the head has the units."""

    def __init__(self, path: pathlib.Path) -> None:
        self._file = path.open("x", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file)

    def begin(self, run: Run) -> None:
        self._writer.writerow(f"{name} [{unit}]" if unit else name for name, unit in run.units.items())

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        self._writer.writerows(zip(*(values.tolist() for values in log.columns.values()), strict=True))
        self._file.flush()

    def close(self) -> None:
        self._file.close()


class NpzSink(Sink):
    """A log for :func:`wbc.log.load` and ``numpy.load``, with the same names in every run."""

    def close(self) -> None:
        save(self.taken(), self._path.parent, "npz", self._path.stem)


class LeRobotSink(Sink):
    """A dataset of LeRobot, version 3.0, of one episode without images, in a folder: ``observation.state`` is the
    configuration, ``action`` the command of each tick.

    Raises:
        FormatError: no ticks, none at whole frames a second, or no command.
    """

    needs = ("recordings", "a dataset of LeRobot")

    def close(self) -> None:
        log, robot = self.taken(), str(self._run.about.get("robot", ""))
        t = log["t"]
        if len(t) < 2:
            raise FormatError("run", len(t), "a dataset needs two ticks or more")
        period = float(t[-1] - t[0]) / (len(t) - 1)
        rate = round(1.0 / period) if period > 0.0 else 0
        if rate < 1 or np.abs(t - t[0] - np.arange(len(t)) / rate).max() > TOLERANCE:
            raise FormatError("run", period, "ticks are not at a whole number a second, which frames of LeRobot are")
        names, episode = dict[str, list[str]](), dict[str, Array]()
        for feature, group in {"observation.state": "q", "action": "v" if log.group("v") else "a"}.items():
            names[feature], episode[feature] = list(log.group(group)), log.array(group)
            if not names[feature]:
                raise FormatError("run", group, f"has no columns for {feature}")
        self._path.mkdir()
        write_lerobot_dataset(self._path, robot, rate, names, [episode], [f"run of {robot}"])
