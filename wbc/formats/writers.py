"""Runs as MCAP, Rerun's files, tables of text and of numpy, datasets of LeRobot, and over a WebSocket."""

from __future__ import annotations

import csv
import itertools
import json
import pathlib
import time
from collections.abc import Iterable
from typing import Any

import numpy as np

from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO, SCENE, TICK, RunMessages, by_first
from wbc.formats.run import Piece, Run
from wbc.log import Log, save
from wbc.log.lerobot import write_lerobot_dataset
from wbc.log.log import joined
from wbc.validation import Array

#: Size of a chunk of MCAP, which is compressed by itself [bytes]
CHUNK = 1 << 18
#: A chunk is written when it is full, or this old: a reader, or a kill, misses no more [s]
OLD = 0.5
#: Ticks that are sent to Rerun together; some thousand take little place
TOGETHER = 5000
#: Length of the axes that mark a target [m]
AXIS = 0.1
#: Largest difference of a tick's time from the grid of a dataset's frames [s]
TOLERANCE = 1e-4


def write_mcap(run: Run, pieces: Iterable[Piece], path: pathlib.Path) -> None:
    """An MCAP file of JSON messages, in chunks compressed by zstd."""
    import msgspec
    from mcap.writer import CompressionType, Writer

    messages, encode, flushed, channels = RunMessages(run), msgspec.json.Encoder().encode, time.monotonic(), {}
    columns = {"columns": json.dumps(messages.names), "units": json.dumps(dict(run.units))}
    with path.open("xb") as file:
        # Any: half of the package has no types
        writer: Any = Writer(file, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        writer.start("", "wbc")
        writer.add_metadata("wbc", {"about": json.dumps(run.about), "remarks": "; ".join(run.remarks)})
        for topic, schema in messages.schemas.items():
            number = writer.register_schema(schema["title"], "jsonschema", encode(schema))
            channels[topic] = writer.register_channel(topic, "json", number, columns if topic == TICK else {})
        scene = [[(SCENE, 0, messages.scene)]] if run.bodies else []
        for told in itertools.chain(scene, map(messages.of, pieces)):
            for topic, when, data in told:
                writer.add_message(channels[topic], when, encode(data), when)
            if time.monotonic() > flushed + OLD:
                writer.flush()
                flushed = time.monotonic()
        writer.finish()


def write_rerun(run: Run, pieces: Iterable[Piece], path: pathlib.Path) -> None:
    """A file ``.rrd``: bodies, targets, obstacles, binding rows, margins, reasons and all numbers on one time line."""
    import rerun

    stream, groups = rerun.RecordingStream("wbc"), by_first({name: name for name in run.units})
    stream.save(path)
    stream.send_blueprint(_layout(groups))
    stream.log("about", rerun.TextDocument(json.dumps(run.about, indent=1)), static=True)
    stream.log("scene", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for frame, (corners, triangles, colour) in run.bodies.items():
        mesh = rerun.Mesh3D(vertex_positions=corners, triangle_indices=triangles, albedo_factor=[*colour, 255])
        stream.log(f"scene/{frame}/mesh", mesh, static=True)
    for group, members in groups.items():
        stream.log(f"tick/{group}", rerun.SeriesLines(names=[name or group for name in members]), static=True)

    def send(log: Log) -> None:
        for group, members in groups.items():
            numbers = np.column_stack([log[name] for name in members.values()]).astype(np.float64)
            columns = rerun.Scalars.columns(scalars=numbers.ravel()).partition([len(members)] * len(numbers))
            times = rerun.TimeColumn("time", duration=log["t"])
            stream.send_columns(f"tick/{group}", indexes=[times], columns=columns)

    kept, said = list[Log](), ""
    for log, seen in pieces:
        for tick in seen:
            stream.set_time("time", duration=tick.t)
            for frame, pose in tick.poses.items():
                axes = [rerun.TransformAxes3D(AXIS)] if frame.startswith("target/") else []
                stream.log(f"scene/{frame}", rerun.Transform3D(translation=pose[:3], quaternion=pose[3:]), *axes)
            if tick.status and (binding := "\n".join([tick.status, *tick.binding])) != said:
                stream.log("binding", rerun.TextDocument(said := binding))
            if tick.why:
                stream.log("why", rerun.TextLog(tick.why, level="INFO" if tick.status == "solved" else "WARN"))
        kept.append(log)
        if sum(map(len, kept)) >= TOGETHER:
            send(joined(kept, run.units, run.about))
            kept = []
    send(joined(kept, run.units, run.about))
    stream.flush()
    stream.disconnect()


def _layout(groups: Iterable[str]) -> Any:
    """What Rerun's viewer shows: the scene beside binding rows, margins, commands and residuals."""
    import rerun.blueprint as views

    curves = [group for group in ("margin", "v", "residual") if group in groups]
    shown = [views.TimeSeriesView(origin=f"tick/{group}", name=group) for group in curves]
    told = views.Vertical(views.TextDocumentView(origin="binding"), *shown)
    scene = views.Vertical(views.Spatial3DView(origin="scene"), views.TextLogView(origin="why"), row_shares=[3, 1])
    return views.Blueprint(views.Horizontal(scene, told, column_shares=[3, 2]), collapse_panels=True)


def write_csv(run: Run, pieces: Iterable[Piece], path: pathlib.Path) -> None:
    """A row a tick; the head has the units."""
    with path.open("x", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(f"{name} [{unit}]" if unit else name for name, unit in run.units.items())
        for log, _ in pieces:
            table.writerows(zip(*(values.tolist() for values in log.columns.values()), strict=True))
            file.flush()


def write_npz(run: Run, pieces: Iterable[Piece], path: pathlib.Path) -> None:
    """A log for :func:`wbc.log.load` and ``numpy.load``, with the same names in every run."""
    save(joined([log for log, _ in pieces], run.units, run.about), path.parent, "npz", path.stem)


def write_lerobot(run: Run, pieces: Iterable[Piece], path: pathlib.Path) -> None:
    """A dataset of LeRobot, version 3.0, of one episode without images, in a folder: ``observation.state`` is the
    configuration, ``action`` the command of each tick.
    """
    log, robot = joined([log for log, _ in pieces], run.units, run.about), str(run.about.get("robot", ""))
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
    path.mkdir()
    write_lerobot_dataset(path, robot, rate, names, [episode], [f"run of {robot}"])


def serve(run: Run, pieces: Iterable[Piece], address: pathlib.Path) -> None:
    """A server that Foxglove connects to, of a run at the speed at which it was, or as it is written; its address is
    ``HOST:PORT``, or nothing for 127.0.0.1 and port 8765, which Foxglove proposes.
    """
    import foxglove

    host, _, port = ("" if address == pathlib.Path() else str(address)).rpartition(":")
    if (host or port) and not port.isdigit():
        raise FormatError("address", str(address), "expected HOST:PORT")
    messages, context, channels, began = RunMessages(run), foxglove.Context(), dict[str, Any](), 0.0

    class LateListener(foxglove.websocket.ServerListener):  # type: ignore[misc]  # without the package it is Any
        """Who comes later is given what was said once."""

        def on_subscribe(self, client: Any, channel: Any) -> None:
            if channel.topic == SCENE:
                channels[SCENE].log(messages.scene, log_time=0)

    served = {"host": host or "127.0.0.1", "port": int(port or 8765), "server_listener": LateListener()}
    try:
        server = foxglove.start_server(name="wbc", context=context, **served)
    except (RuntimeError, OSError) as error:
        raise FormatError("address", str(address), f"cannot be served on: {error}") from error
    for topic, schema in messages.schemas.items():
        channels[topic] = foxglove.Channel(topic, schema=schema, context=context)
    try:
        for topic, when, data in (message for piece in pieces for message in messages.of(piece)):
            began = began or time.monotonic() - when / NANO
            time.sleep(max(0.0, began + when / NANO - time.monotonic()))
            channels[topic].log(data, log_time=when)
    finally:
        server.stop()
