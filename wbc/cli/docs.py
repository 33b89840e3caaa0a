"""``wbc docs``: the pages of tasks and constraints and the types of their values, from their declarations."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from wbc import pages
from wbc.cli.bench import ROOT
from wbc.cli.console import out
from wbc.errors import WbcError
from wbc.pages import stub

FOLDER = ROOT / "docs" / "tasks"


class DocsError(WbcError):
    """There are no pages: they are part of the repository, not of the installed package."""


def docs(
    check: Annotated[bool, typer.Option("--check", help="Write nothing; exit code 1 where a page is stale.")] = False,
    folder: Annotated[pathlib.Path, typer.Option(help="Where the pages are.")] = FOLDER,
) -> None:
    """Write what the code declares into the pages of tasks and constraints (needs the repository)."""
    if not folder.is_dir():
        raise DocsError("folder", str(folder), "no such folder; run it from a clone of the repository")
    names = pages.stale(folder) + stub.stale() if check else pages.update(folder) + stub.update()
    for name in names:
        out().print(f"{'stale' if check else 'written'}: {name}")
    if check and names:
        raise typer.Exit(1)
