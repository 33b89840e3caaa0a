"""The folder of a run: named, made, and kept from being written over."""

from __future__ import annotations

import contextlib
import datetime
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from wbc import validation
from wbc.api import Controller
from wbc.cli.console import OutputError, tell
from wbc.cli.output import RECORDED


def run_folder(
    wanted: Path | None,
    name: str,
    written: Sequence[str],
    force: bool = False,
    *,
    clear: bool = True,
) -> Path:
    """The folder that was asked for, or a new one ``runs/NAME-TIME``, without the files of an earlier run. A new one is
    made by whoever first writes into it: what is refused, or killed before that, leaves none.

    Args:
        wanted: None: a new one. written: names, or patterns, of all files that such a run writes.
        force: write into a folder that has such a file.
        clear: False: the files of an earlier run stay until :func:`filled` has those of the new one.

    Raises:
        OutputError: it has a file of a run and ``force`` is off, or it cannot be written.
    """
    folder = wanted or _new(name)
    with validation.writing("out", folder, OutputError, ValueError):
        there = [file for pattern in written for file in folder.glob(pattern)]
        if there and not force:
            reason = f"there is a run in this folder ({there[0].name}); choose another, or use --force"
            raise OutputError("out", str(folder), reason)
        new = [place for place in (folder, *folder.parents) if not place.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        for file in there if clear else ():
            file.unlink()
        # A folder that can be seen but not written says so before anything is computed
        probe = folder / ".probe"
        probe.touch()
        probe.unlink()
        # Not where another process has begun to write meanwhile
        with contextlib.suppress(OSError):
            for place in new:
                place.rmdir()
    return folder


@contextlib.contextmanager
def filled(folder: Path, replaced: Sequence[str] = ()) -> Iterator[Path]:
    """A folder to write into, whose files are in ``folder`` at the end: whoever is killed leaves no half of a file.

    Args:
        folder: of a run. replaced: names, or patterns, of files of an earlier run, which then go.
    """
    fresh = folder / ".writing"
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    try:
        yield fresh
        for old in [file for pattern in replaced for file in folder.glob(pattern)]:
            if not (fresh / old.name).exists():
                old.unlink()
        for file in sorted(fresh.iterdir()):
            file.replace(folder / file.name)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def recording(stack: contextlib.ExitStack, folder: Path, mcap: bool) -> Callable[[Controller], None] | None:
    """What is told of a controller before its first tick, so that it is recorded until ``stack`` ends; None: nothing.

    Args:
        folder: of the run. mcap: whether its ticks are recorded, and written as MCAP.
    """

    def begin(controller: Controller) -> None:
        stack.enter_context(with_mcap(controller, folder))

    return begin if mcap else None


@contextlib.contextmanager
def with_mcap(controller: Controller, folder: Path) -> Iterator[None]:
    """Record ticks into a folder, and write them as MCAP meanwhile; one that cannot be written to the end is told of:
    the run is worth keeping all the same.

    Raises:
        MissingPackageError: the packages of the extra are not installed.
    """
    from wbc.formats import FormatError, recorded
    from wbc.record.recording import RecordingError

    folder.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as stack:
        stack.enter_context(recorded(controller, folder / RECORDED[0], overwrite=True))
        yield
        try:
            stack.close()
        except (FormatError, RecordingError) as error:
            tell(str(error), "warning")


def _new(name: str) -> Path:
    """A name that no folder has yet."""
    stem = Path("runs") / f"{name}-{datetime.datetime.now():%Y%m%d-%H%M%S}"
    choices = (stem.with_name(f"{stem.name}{more}") for more in ("", *(f"-{k}" for k in range(2, 1000))))
    return next(choice for choice in choices if not choice.exists())
