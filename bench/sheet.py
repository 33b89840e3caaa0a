"""A table of text, for the terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rich.table import Table


@dataclass(frozen=True)
class Sheet:
    """A table: a title, columns and rows of text."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]

    def rich(self) -> Table:
        """For the terminal."""
        table = Table(title=self.title, title_justify="left")
        for k, column in enumerate(self.columns):
            table.add_column(column, justify="left" if k == 0 else "right")
        for row in self.rows:
            table.add_row(*row)
        return table

    def markdown(self) -> str:
        """For a page."""
        lines = [f"**{self.title}**", "", line(self.columns), "|---|" + "---:|" * (len(self.columns) - 1)]
        return "\n".join(lines + [line(row) for row in self.rows])


def line(cells: Iterable[str]) -> str:
    """One row in Markdown."""
    return "| " + " | ".join(cells) + " |"


def us(value: float) -> str:
    """Microseconds with three digits."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"
