"""What programs of the bench share: a terminal with bars, and tables and notes that are printed and kept in files."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from bench.sheet import Sheet

Record = dict[str, Any]
Parts = dict[str, list[Record]]


def terminal(width: int = 160) -> Console:
    """Standard output, of this many columns where it is no terminal."""
    console = Console()
    return console if console.is_terminal else Console(width=width)


@contextlib.contextmanager
def bars() -> Iterator[Progress]:
    """Bars on standard error: how much of each part is done, the time spent and the time left."""
    columns = TextColumn("{task.description:12}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)) as progress:
        yield progress


def measure(work: dict[str, tuple[int, Iterator[Record]]], progress: Progress) -> tuple[Parts, str | None]:
    """(records of every part, the part in which Ctrl-C came). ``work``: part -> (number of records, the records)."""
    found: Parts = {}
    name = "nothing"
    try:
        for name, (total, records) in work.items():
            found[name] = []
            bar = progress.add_task(name, total=total)
            for record in records:
                found[name].append(record)
                progress.advance(bar)
    except KeyboardInterrupt:
        return found, name
    return found, None


def publish(file: Path, sheets: Sequence[Sheet], notes: Sequence[str], data: dict[str, Any], width: int = 160) -> None:
    """Print tables and notes, and write them to ``file``.md, and what they are made of to ``file``.json."""
    console = terminal(width)
    for sheet in sheets:
        console.print(sheet.rich())
        console.print()
    for note in notes:
        console.print(note, markup=False, highlight=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.with_suffix(".md").write_text("\n\n".join([*(sheet.markdown() for sheet in sheets), *notes]) + "\n")
    file.with_suffix(".json").write_text(json.dumps(data, indent=1) + "\n")
    console.print(f"Written to {file}.md", markup=False, highlight=False)
