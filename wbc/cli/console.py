"""Where the commands write: results to standard output, progress and errors to standard error."""

from __future__ import annotations

import datetime
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from wbc.errors import WbcError


class OutputError(WbcError):
    """A file or folder that cannot be written, or a folder that has a run already."""


def out() -> Console:
    """For results. Made when needed, so that redirected streams are honoured."""
    return Console(highlight=False)


def err() -> Console:
    """For progress and errors."""
    return Console(stderr=True, highlight=False)


def run_folder(kind: str, folder: Path | None, force: bool) -> Path:
    """The folder of a run that leaves ``summary.json``, made; default: runs/KIND-TIME.

    Raises:
        OutputError: there is a run in it and ``force`` is off, or it cannot be made.
    """
    folder = folder or Path("runs") / f"{kind}-{datetime.datetime.now():%Y%m%d-%H%M%S}"
    if (folder / "summary.json").exists() and not force:
        raise OutputError("out", str(folder), "there is a run in this folder; choose another, or use --force")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError("out", str(folder), f"cannot be written: {error.strerror}") from error
    return folder


def complain(error: WbcError) -> None:
    """An error as one line."""
    line = Text.assemble(("error: ", "bold red"), " ".join(str(error).split()))
    err().print(line, soft_wrap=True)


def progress_bar() -> Progress:
    """A progress bar on the error stream; none where that is no terminal."""
    console = err()
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
        refresh_per_second=5,
    )
