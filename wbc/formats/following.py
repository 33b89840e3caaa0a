"""A run in another format while it is written, by a process of its own."""

from __future__ import annotations

import contextlib
import os
import pathlib
import select
import signal
import subprocess
import sys
from collections.abc import Iterator

from wbc import validation
from wbc.api import Controller
from wbc.errors import WbcError
from wbc.formats.conversion import convert, format_of, place_of
from wbc.formats.errors import FormatError
from wbc.formats.run import run_of
from wbc.record.recorder import Recorder

#: Time between two looks at a file that is still written [s]
LOOK = 0.02


class RunCopy(contextlib.AbstractContextManager["RunCopy"]):
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
    format_of(to)
    path = validation.file_path("run", run)
    return RunCopy(path, to, place_of(path, to, out))


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
    format_of(to)
    copy = place_of(validation.file_path("run", run), to, None, overwrite)
    with controller.record(run, overwrite=overwrite) as recorder, follow(recorder.path, to, copy):
        try:
            yield recorder
        finally:
            recorder.close()


def main(run: str, to: str, out: str) -> None:
    """What a process of :func:`follow` does."""
    # Ctrl-C is of the loop, whose recording is then closed
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ended = False

    def wait() -> bool:
        """Until the next look; what was written before the loop closed the copy, or was gone, is read as well."""
        nonlocal ended
        going_on, ended = not ended, bool(select.select([sys.stdin], [], [], LOOK)[0])
        return going_on

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
