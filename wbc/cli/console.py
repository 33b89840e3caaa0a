"""Where the commands write: results to standard output, progress and errors to standard error; with ``--json`` what
goes to :func:`out` is kept, and printed as data at the end.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from wbc.errors import WbcError

if TYPE_CHECKING:
    from rich.progress import Progress


#: What has been printed so far: one where data is wanted
_kept: list[Any] = []


class OutputError(WbcError):
    """A file or folder that cannot be written, or a folder that has a run already."""


class _WholeLines(Console):
    """A line that is printed with ``soft_wrap`` stays one line in a pipe; a terminal gets whole words a row."""

    def print(self, *objects: Any, **options: Any) -> None:
        if options.get("soft_wrap") and self.is_terminal:
            # Words longer than a row, such as paths and joint positions, stay whole, too
            options |= {"soft_wrap": False, "overflow": "ignore"}
        super().print(*objects, **options)


class _Data(Console):
    """Keeps lines as texts; a table as a title and one object a row, or one of names and texts; numbers as numbers."""

    def print(self, *objects: Any, **options: Any) -> None:
        for each in objects if isinstance(_kept[0], dict) else ():
            if isinstance(each, Table):
                _kept[0].setdefault("tables", []).append({"title": _plain(each.title or ""), "rows": _rows(each)})
            else:
                _kept[0].setdefault("lines", []).append(_plain(each, options.get("markup") is not False))


def collect() -> None:
    """From now on what goes to :func:`out` is kept."""
    _kept[:] = [{"lines": [], "tables": []}]


def data(found: object) -> None:
    """What ``--json`` prints in the place of lines and tables."""
    _kept[:] = [[found]] if _kept else []


def print_kept() -> None:
    """What was kept, as one JSON document on standard output, numbers that are not finite as null."""
    for found in _kept:
        sys.stdout.write(json.dumps(_finite(found[0] if isinstance(found, list) else found), indent=1) + "\n")
    _kept.clear()


def out() -> Console:
    """For results. Made when needed, so that redirected streams are honoured."""
    return _Data(highlight=False) if _kept else _WholeLines(highlight=False)


def err() -> Console:
    """For progress and errors."""
    return _WholeLines(stderr=True, highlight=False)


def say(text: object) -> None:
    """A line of results as it is, however long."""
    out().print(str(text), soft_wrap=True, markup=False, emoji=False)


def tell(text: object, kind: str = "") -> None:
    """A line on the error stream as it is; ``kind``, such as "note", stands before it in yellow."""
    err().print(f"[yellow]{kind}[/yellow]: {escape(str(text))}" if kind else escape(str(text)), soft_wrap=True)


def complain(error: WbcError, more: str = "") -> None:
    """An error as one line, and what else there is to say of it."""
    line = Text.assemble(("error: ", "bold red"), " ".join(str(error).split()), more)
    err().print(line, soft_wrap=True)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], title: str = "", left: Sequence[str] = ()) -> Table:
    """Rows under heads; the first column and those whose heads are ``left`` stand left, all others right."""
    found = Table(title=title, title_justify="left", header_style="bold", box=None, pad_edge=False)
    found.title_style = "bold" if title else None
    found.title = title or None
    for k, head in enumerate(heads):
        beside = k == 0 or head in left
        found.add_column(head, justify="left" if beside else "right", no_wrap=k == 0)
    for row in rows:
        found.add_row(*row)
    return found


def show_figures(
    title: str, figures: Iterable[tuple[str, str]], folder: Path | None = None, files: Iterable[Path] = ()
) -> None:
    """A title, names and texts in two columns; then the folder, and the files in it."""
    shown = table(("", ""), ((name, escape(text)) for name, text in figures if name), left=("",))
    shown.show_header, shown.columns[0].style = False, "cyan"
    # A title of the table would be broken where its columns are narrower
    out().print(f"[bold]{escape(title)}[/bold]", soft_wrap=True)
    out().print(shown)
    if folder is not None:
        out().print(f"[bold]{escape(str(folder))}[/bold]: {', '.join(file.name for file in files)}", soft_wrap=True)


def progress_bar() -> Progress:
    """A progress bar on the error stream; none where that is no terminal."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

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


def write_json(file: Path, found: object) -> Path:
    """A document of results."""
    file.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return file


def _finite(found: object) -> object:
    if isinstance(found, dict):
        return {str(key): _finite(value) for key, value in found.items()}
    if isinstance(found, (list, tuple)):
        return [_finite(value) for value in found]
    return None if isinstance(found, float) and not math.isfinite(found) else found


def _rows(shown: Table) -> list[dict[str, Any]] | dict[str, Any]:
    cells = [[_number(cell) for cell in column.cells] for column in shown.columns]
    if not shown.show_header and len(cells) == 2:
        return dict(zip(map(str, cells[0]), cells[1], strict=True))
    names = [_plain(column.header) or f"column {k + 1}" for k, column in enumerate(shown.columns)]
    return [dict(zip(names, row, strict=True)) for row in zip(*cells, strict=True)]


def _number(cell: Any) -> str | float:
    try:
        return float(_plain(cell))
    except ValueError:
        return _plain(cell)


def _plain(text: Any, markup: bool = True) -> str:
    return Text.from_markup(text).plain if isinstance(text, str) and markup else str(text)
