"""Records of the parts of a run, measured one after the other until Ctrl-C."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.progress import Progress

Record = dict[str, Any]
Parts = dict[str, list[Record]]


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
