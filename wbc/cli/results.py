"""What a command prints as data: `--json` of commands that have no form of their own."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

#: What has been printed so far: one where data is wanted
_found: list[dict[str, list[Any]]] = []


def collect() -> None:
    """From now on what goes to :func:`wbc.cli.console.out` is kept."""
    _found[:] = [{"lines": [], "tables": []}]


def taken() -> list[dict[str, list[Any]]]:
    """What was kept, one or none; nothing is kept from now on."""
    kept = list(_found)
    _found.clear()
    return kept


def console() -> Console | None:
    """A console that keeps what it is given; None where nobody wants data."""
    return _Kept(_found[0]) if _found else None


class _Kept(Console):
    def __init__(self, found: dict[str, list[Any]]) -> None:
        super().__init__(highlight=False)
        self._kept = found

    def print(self, *objects: Any, **options: Any) -> None:
        """Lines as text; a table as a title and one object a row, or one of names and texts; numbers as numbers."""
        for each in objects:
            if isinstance(each, Table):
                self._kept["tables"].append({"title": _plain(each.title or ""), "rows": _rows(each)})
            else:
                markup = options.get("markup") is not False
                self._kept["lines"].append(_plain(each) if markup else str(each))


def _rows(table: Table) -> list[dict[str, Any]] | dict[str, Any]:
    if not table.show_header and len(table.columns) == 2:
        return {_plain(name): _number(cell) for name, cell in zip(*(c.cells for c in table.columns), strict=True)}
    names = [_plain(column.header) or f"column {k + 1}" for k, column in enumerate(table.columns)]
    cells = zip(*(column.cells for column in table.columns), strict=True)
    return [dict(zip(names, map(_number, row), strict=True)) for row in cells]


def _number(cell: Any) -> str | float:
    text = _plain(cell)
    try:
        return float(text)
    except ValueError:
        return text


def _plain(text: Any) -> str:
    return Text.from_markup(text).plain if isinstance(text, str) else str(text)
