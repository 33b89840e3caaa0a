"""From a run to a file of another format, once or while the run is written."""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Protocol

from wbc import extras, validation
from wbc.api import Controller
from wbc.errors import WbcError
from wbc.formats.errors import FormatError
from wbc.formats.lerobot import LeRobotSink
from wbc.formats.live import FoxgloveSink
from wbc.formats.mcap_file import McapSink
from wbc.formats.rerun_file import RerunSink
from wbc.formats.run import RATE, Run, SeenTick, run_of
from wbc.formats.tables import CsvSink, NpzSink
from wbc.log import Log
from wbc.record.recorder import Recorder

#: Time between two looks at a file that is still written [s]
LOOK = 0.02


class Sink(Protocol):
    """Where a run goes to."""

    def begin(self, run: Run) -> None:
        """Comes first."""

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        """The next ticks, and what is to be seen of some of them."""

    def close(self) -> None:
        """Nothing more comes."""


#: Format -> what writes it; names of files end with it, but those of ``lerobot`` (a folder) and ``foxglove`` (none)
FORMATS: dict[str, Callable[[pathlib.Path], Sink]] = {
    "mcap": McapSink,
    "rrd": RerunSink,
    "csv": CsvSink,
    "npz": NpzSink,
    "lerobot": LeRobotSink,
    "foxglove": FoxgloveSink,
}
#: Format -> the extra that it needs
NEEDED = {"mcap": "formats", "rrd": "rerun", "lerobot": "recordings", "foxglove": "foxglove"}


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
    validation.one_of("to", to, FORMATS)
    rate = validation.scalar("rate", rate, low=1e-3, high=1e4, unit="1/s")
    source = run if isinstance(run, Run) else run_of(run, trust)
    served = to == "foxglove"
    beside = source.path.with_suffix(f".{to}" if source.path.suffix != f".{to}" else f".converted.{to}")
    place = pathlib.Path(out or "") if served else _free(out or beside)
    # Written beside its place, but what another program shall read meanwhile
    fresh = place if wait is not None or served else place.with_name(f".{place.name}")
    count = 0
    try:
        with contextlib.ExitStack() as undone:
            if fresh != place:
                _remove(fresh)
                undone.callback(_remove, fresh)
            sink = FORMATS[to](fresh)
            sink.begin(source)
            for log, seen in source.pieces(wait, rate):
                sink.write(log, seen)
                count += len(log)
                if progress is not None:
                    progress(count)
            sink.close()
            if fresh != place:
                fresh.replace(place)
    except OSError as error:
        raise FormatError("out", str(place), f"cannot be written: {error.strerror}") from error
    return place, source.remarks


def _free(out: str | os.PathLike[str]) -> pathlib.Path:
    place = pathlib.Path(out)
    if place.exists():
        raise FormatError("out", str(place), "there is such a file; choose another")
    return place


def _remove(place: pathlib.Path) -> None:
    if place.is_dir():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)


class RunCopy:
    """A process that copies a run into another format while it is written; made by :func:`follow`.

    Attributes:
        path: where the copy goes.
    """

    def __init__(self, run: pathlib.Path, to: str, out: pathlib.Path) -> None:
        self.path = out
        command = [sys.executable, "-m", __name__, str(run), to, str(out)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    @property
    def running(self) -> bool:
        """It still copies."""
        return self._process.poll() is None

    def close(self) -> None:
        """Wait until all of the run that is written is in the copy.

        Raises:
            FormatError: it could not be written, and why.
        """
        _, said = self._process.communicate()
        if self._process.returncode:
            raise FormatError("run", str(self.path), f"its copy ended early: {said.strip().splitlines()[-1:]}")

    def __enter__(self) -> RunCopy:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def follow(run: str | os.PathLike[str], to: str, out: str | os.PathLike[str] | None = None) -> RunCopy:
    """Copy a run into another format while it is recorded, in a process of its own: the loop is not slowed.

        with wbc.formats.follow("ticks.npz", "mcap"), controller.record("ticks.npz"):
            ...                                             # step as usual

    The copy is as far as the file, but for a chunk, and goes on to the end where the loop's process is killed.

    Args:
        run: the file of the recorder, which may begin later. to, out: as of :func:`convert`.

    Raises:
        UnknownNameError: no such format. FormatError: there is such a file.
        MissingPackageError: its package is not installed.
    """
    validation.one_of("to", to, FORMATS)
    if to in NEEDED:
        extras.require(NEEDED[to], f"a run as {to}")
    path = validation.file_path("run", run)
    return RunCopy(path, to, _free(out or path.with_suffix(f".{to}")))


@contextlib.contextmanager
def recorded(
    controller: Controller, run: str | os.PathLike[str], to: str = "mcap", *, overwrite: bool = False
) -> Iterator[Recorder]:
    """Record every tick of a controller, and beside the recording the same in another format while the loop runs.

        with wbc.formats.recorded(controller, "ticks.npz"):         # and ticks.mcap
            ...                                                     # step as usual: a loop, a program, a plant

    Args:
        run, overwrite: as of :meth:`wbc.Controller.record`. to: as of :func:`convert`.

    Raises:
        Those of :func:`follow` and :meth:`wbc.Controller.record`.
    """
    copy = validation.file_path("run", run).with_suffix(f".{validation.one_of('to', to, FORMATS)}")
    if overwrite:
        _remove(copy)
    with controller.record(run, overwrite=overwrite) as recorder, follow(recorder.path, to, copy):
        try:
            yield recorder
        finally:
            recorder.close()


def main(run: str, to: str, out: str) -> None:
    """What a process of :func:`follow` does."""
    # Ctrl-C is of the loop, whose recording is then closed
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ended = threading.Event()

    def listen() -> None:
        # Until the loop closes the copy, or is gone
        sys.stdin.read()
        ended.set()

    threading.Thread(target=listen, daemon=True).start()

    def wait() -> bool:
        # What was written between the last look and the end of the loop is read as well
        running = not ended.is_set()
        time.sleep(LOOK)
        return running

    while True:
        try:
            source = run_of(run)
            break
        except WbcError:
            if not wait():
                raise
    convert(source, to, out, wait=wait)


if __name__ == "__main__":
    os.nice(5)
    main(*sys.argv[1:])
