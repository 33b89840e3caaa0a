"""Runs as MCAP files."""

from __future__ import annotations

import json
import pathlib
import time
from collections import Counter
from typing import TYPE_CHECKING, Any

from wbc import extras
from wbc.formats.messages import TICK, Message, MessageSink
from wbc.formats.run import Run, SeenTick
from wbc.log import Log

if TYPE_CHECKING:
    import msgspec
    from mcap.writer import Writer

#: Size of a chunk, which is compressed by itself [bytes]
CHUNK = 1 << 18
#: A chunk is written when it is full, or this old: a reader, or a kill, misses no more [s]
OLD = 0.5


class McapSink(MessageSink):
    """An MCAP file of JSON messages, in chunks compressed by zstd.

    Raises:
        MissingPackageError: the packages of the extra are not installed.
    """

    def __init__(self, path: pathlib.Path) -> None:
        extras.require("formats", "MCAP")
        import msgspec
        from mcap.writer import CompressionType, Writer

        self._encoder: msgspec.json.Encoder = msgspec.json.Encoder()
        self._file, self._flushed = path.open("xb"), time.monotonic()
        self._writer: Writer = Writer(self._file, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        self._channels = dict[str, int]()
        self._counts = Counter[str]()

    def begin(self, run: Run) -> None:
        """Schemas, what is said of the run, and bodies."""
        self._writer.start("", "wbc")
        self._writer.add_metadata("wbc", {"about": json.dumps(run.about), "remarks": "; ".join(run.remarks)})
        super().begin(run)

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        """Ticks, and what is seen of some of them, by their times."""
        super().write(log, seen)
        if time.monotonic() > self._flushed + OLD:
            self._writer.flush()  # type: ignore[no-untyped-call]  # of the package
            self._flushed = time.monotonic()

    def _open(self, topic: str, schema: dict[str, Any]) -> None:
        number = self._writer.register_schema(schema["title"], "jsonschema", json.dumps(schema).encode())
        columns = {"columns": json.dumps(self._tree.names)} if topic == TICK else {}
        self._channels[topic] = self._writer.register_channel(topic, "json", number, columns)

    def _put(self, message: Message) -> None:
        self._counts[message.topic] += 1
        data: Any = self._encoder.encode(message.data)
        count = self._counts[message.topic] - 1
        self._writer.add_message(self._channels[message.topic], message.time, data, message.time, count)

    def close(self) -> None:
        """Write the index."""
        self._writer.finish()  # type: ignore[no-untyped-call]  # of the package
        self._file.close()
