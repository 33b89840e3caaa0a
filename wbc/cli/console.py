"""Where the commands write: results to standard output, progress and errors to standard error."""

from __future__ import annotations

import json
import math
import sys
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from wbc.errors import WbcError


class OutputError(WbcError):
    """A file or folder that cannot be written, or a folder that has a run already."""


class _Lines(Console):
    """A line that is printed with ``soft_wrap`` stays one line in a pipe; a terminal gets whole words a row."""

    def print(self, *objects: Any, **options: Any) -> None:
        """As rich does; see above."""
        if options.get("soft_wrap") and self.is_terminal:
            # Words longer than a row, such as paths and joint positions, stay whole, too
            options |= {"soft_wrap": False, "overflow": "ignore"}
        super().print(*objects, **options)


def out() -> Console:
    """For results. Made when needed, so that redirected streams are honoured; keeps them where `--json` wants data."""
    from wbc.cli import results

    return results.console() or _Lines(highlight=False)


def err() -> Console:
    """For progress and errors."""
    return _Lines(stderr=True, highlight=False)


def say(text: str) -> None:
    """A line of results as it is, however long."""
    out().print(text, soft_wrap=True, markup=False, emoji=False)


def print_json(data: object) -> None:
    """Results as one JSON document on standard output, numbers that are not finite as null."""
    sys.stdout.write(json.dumps(_finite(data), indent=1) + "\n")


def _finite(data: object) -> object:
    if isinstance(data, dict):
        return {str(key): _finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    return data


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
