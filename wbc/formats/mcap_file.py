"""Runs as MCAP files."""

from __future__ import annotations

import json
import pathlib
import time
from collections import Counter
from typing import Any

from wbc.formats.messages import TICK, Message, MessageSink
from wbc.formats.run import Run, SeenTick
from wbc.log import Log

#: Size of a chunk, which is compressed by itself [bytes]
CHUNK = 1 << 18
#: A chunk is written when it is full, or this old: a reader, or a kill, misses no more [s]
OLD = 0.5


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
        columns = {"columns": json.dumps(self._tree.names)} if topic == TICK else {}
        self._channels[topic] = self._writer.register_channel(topic, "json", number, columns)

    def _put(self, message: Message) -> None:
        channel, count, data = self._channels[message.topic], self._counts[message.topic], self._encode(message.data)
        self._writer.add_message(channel, message.time, data, message.time, count)
        self._counts[message.topic] = count + 1

    def close(self) -> None:
        self._writer.finish()
        self._file.close()
