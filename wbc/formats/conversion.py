"""From a run to a file of another format."""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
from collections.abc import Callable, Iterator

from wbc import extras, validation
from wbc.formats.errors import FormatError
from wbc.formats.lerobot import LeRobotSink
from wbc.formats.live import FoxgloveSink
from wbc.formats.mcap_file import McapSink
from wbc.formats.rerun_file import RerunSink
from wbc.formats.run import RATE, Run, run_of
from wbc.formats.sink import Sink
from wbc.formats.tables import CsvSink, NpzSink

#: Format -> what writes it; names of files end with it, but those of ``lerobot`` (a folder) and ``foxglove`` (none)
FORMATS: dict[str, type[Sink]] = {
    "mcap": McapSink,
    "rrd": RerunSink,
    "csv": CsvSink,
    "npz": NpzSink,
    "lerobot": LeRobotSink,
    "foxglove": FoxgloveSink,
}


def convert(
    run: str | os.PathLike[str] | Run,
    to: str,
    out: str | os.PathLike[str] | None = None,
    *,
    rate: float = RATE,
    trust: bool = False,
    wait: Callable[[], bool] | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[pathlib.Path, list[str]]:
    """Write a run, whole or as far as it came, in another format.

        wbc.formats.convert("runs/demo", "mcap")                # beside the recording

    Args:
        run: its folder, recording or log. to: one of :data:`FORMATS`.
        out: the file, or folder of ``lerobot``, which must not be there; ``HOST:PORT`` of ``foxglove``. Default: beside
            the run, named as its file.
        rate: ticks a second of which poses, margins and binding rows are shown [1/s]; numbers are those of all ticks.
        trust: see :func:`wbc.replay`. wait: as of :meth:`wbc.log.LogFile.chunks`: the run is still written.
        progress: is told how many ticks are done.

    Returns:
        The file, and what is not in it, in words.

    Raises:
        UnknownNameError: no such format. MissingPackageError: its package is not installed.
        FormatError: there is such a file, or it cannot be written. LogFileError: no run, or damaged.
        RangeError: a rate that is none.
    """
    kind = format_of(to)
    rate = validation.scalar("rate", rate, low=1e-3, high=1e4, unit="1/s")
    source = run if isinstance(run, Run) else run_of(run, trust)
    place, count = place_of(source.path, to, out), 0
    with _written(place, at_once=to == "foxglove" or wait is not None) as file:
        sink = kind(file)
        sink.begin(source)
        for log, seen in source.pieces(wait, rate):
            sink.write(log, seen)
            count += len(log)
            if progress is not None:
                progress(count)
        sink.close()
    return place, source.remarks


def format_of(to: str) -> type[Sink]:
    """What writes a format.

    Raises:
        UnknownNameError: no such format. MissingPackageError: its package is not installed.
    """
    kind = FORMATS[validation.one_of("to", to, FORMATS)]
    if kind.needs:
        extras.require(*kind.needs)
    return kind


def place_of(run: pathlib.Path, to: str, out: str | os.PathLike[str] | None, overwrite: bool = False) -> pathlib.Path:
    """Where the copy of a run goes; ``run`` and ``out`` are as of :func:`convert`.

    Args:
        overwrite: what is there is removed.

    Raises:
        FormatError: there is such a file.
    """
    if to == "foxglove":
        return pathlib.Path(out or "")
    beside = run.with_suffix(f".{to}" if run.suffix != f".{to}" else f".converted.{to}")
    place = pathlib.Path(out or beside)
    if overwrite:
        remove(place)
    if place.exists():
        raise FormatError("out", str(place), "there is such a file; choose another")
    return place


@contextlib.contextmanager
def _written(place: pathlib.Path, at_once: bool) -> Iterator[pathlib.Path]:
    """Where to write: beside the place, which then has all or nothing, or there ``at_once``."""
    with validation.writing("out", place, FormatError):
        if at_once:
            yield place
            return
        fresh = place.with_name(f".{place.name}")
        try:
            remove(fresh)
            yield fresh
            fresh.replace(place)
        finally:
            remove(fresh)


def remove(place: pathlib.Path) -> None:
    """Remove a file or folder, or nothing."""
    if place.is_dir():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)
