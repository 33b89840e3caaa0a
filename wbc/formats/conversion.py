"""From a run to a file of another format, at once or by a process of its own while it is written."""

from __future__ import annotations

import contextlib
import os
import pathlib
import select
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator

from wbc import extras, validation
from wbc.api import Controller
from wbc.formats.errors import FormatError
from wbc.formats.run import RATE, Piece, Run, Wait
from wbc.formats.writers import serve, write_csv, write_lerobot, write_mcap, write_npz, write_rerun
from wbc.log.file import NOT_CLOSED
from wbc.record.recorder import Recorder

#: Time between two looks at a file that is still written [s]
LOOK = 0.02
#: Format -> what writes it, and the extra that it needs, and for what; names of files end with the format, but those of
#: ``lerobot`` (a folder) and ``foxglove`` (none)
FORMATS = {
    "mcap": (write_mcap, ("formats", "MCAP")),
    "rrd": (write_rerun, ("rerun", "a recording of Rerun")),
    "csv": (write_csv, ()),
    "npz": (write_npz, ()),
    "lerobot": (write_lerobot, ("recordings", "a dataset of LeRobot")),
    "foxglove": (serve, ("foxglove", "a connection for Foxglove")),
}


def convert(
    run: str | os.PathLike[str] | Run,
    to: str,
    out: str | os.PathLike[str] | None = None,
    *,
    rate: float = RATE,
    trust: bool = False,
    wait: Wait | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[pathlib.Path, list[str]]:
    """Write a run, whole or as far as it came, in another format; returns the file, and what is not in it, in words.

    Args:
        run: its folder, recording or log. to: one of :data:`FORMATS`.
        out: a new file, or folder of ``lerobot``; ``HOST:PORT`` of ``foxglove``. Default: beside the run, as its file.
        rate: ticks a second of which poses and binding rows are shown [1/s]; numbers are those of all ticks.
        trust: see :func:`wbc.replay`. wait: as of :meth:`wbc.log.LogFile.chunks`: the run is still written.
        progress: is told how many ticks are done.

    Raises:
        UnknownNameError: no such format. MissingPackageError: its package is not installed.
        FormatError: there is such a file, or it cannot be written. LogFileError: no run, or damaged.
        RangeError: a rate that is none.
    """
    write, rate = _writer_of(to), validation.scalar("rate", rate, low=1e-3, high=1e4, unit="1/s")
    source = run if isinstance(run, Run) else Run(run, trust)
    place, pieces = _place_of(source.path, to, out), source.pieces(wait, rate, progress)
    # What is to be seen meanwhile is written in its place
    meanwhile = to == "foxglove" or wait is not None
    with (validation.writing if meanwhile else validation.replacing)("out", place, FormatError) as fresh:
        write(source, pieces, fresh or place)
    return place, [*source.remarks, *([] if source.complete else [f"the run {NOT_CLOSED}"])]


def _writer_of(to: str) -> Callable[[Run, Iterable[Piece], pathlib.Path], None]:
    write, needs = FORMATS[validation.one_of("to", to, FORMATS)]
    if needs:
        extras.require(*needs)
    return write


def _place_of(run: pathlib.Path, to: str, out: str | os.PathLike[str] | None, overwrite: bool = False) -> pathlib.Path:
    """Where the copy of a run goes, which must not be there, or is removed."""
    if to == "foxglove":
        return pathlib.Path(out or "")
    place = pathlib.Path(out or run.with_suffix(f".{to}" if run.suffix != f".{to}" else f".converted.{to}"))
    if overwrite:
        shutil.rmtree(place, ignore_errors=True)
        place.unlink(missing_ok=True)
    if place.exists():
        raise FormatError("out", str(place), "there is such a file; choose another")
    return place


@contextlib.contextmanager
def recorded(
    controller: Controller, run: str | os.PathLike[str], to: str = "mcap", *, overwrite: bool = False
) -> Iterator[Recorder]:
    """Record every tick of a controller, and beside the recording the same in another format, which a process of its
    own writes while the loop runs: the loop is not slowed.

        with wbc.formats.recorded(controller, "ticks.npz", "mcap"):
            ...                                             # step as usual

    The copy is as far as the file, but for a chunk, and goes on to the end where the loop's process is killed; where
    the block ends it has all that is written. Arguments and errors are those of :meth:`wbc.Controller.record` and
    :func:`convert`.

    Raises:
        FormatError: at the end, too: the copy could not be written, and why.
    """
    _writer_of(to)
    copy = _place_of(validation.file_path("run", run), to, None, overwrite)
    with controller.record(run, overwrite=overwrite) as recorder:
        command = [sys.executable, "-m", __name__, str(recorder.path), to, str(copy)]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            # Closed before its copy is
            with recorder:
                yield recorder
        finally:
            _, said = process.communicate()
    if process.returncode:
        raise FormatError("run", str(copy), f"its copy ended early: {said.strip().splitlines()[-1:]}")


def main(run: str, to: str, out: str) -> None:
    """What a process of :func:`recorded` does."""
    # Ctrl-C is of the loop, whose recording is then closed
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ended = False

    def wait() -> bool:
        """Until the next look; what was written before the loop closed the copy, or was gone, is read as well."""
        nonlocal ended
        going_on, ended = not ended, bool(select.select([sys.stdin], [], [], LOOK)[0])
        return going_on

    convert(run, to, out, wait=wait)


if __name__ == "__main__":
    os.nice(5)
    main(*sys.argv[1:])
