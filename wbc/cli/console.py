"""Where the commands write: results to standard output, progress and errors to standard error."""

from __future__ import annotations

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
