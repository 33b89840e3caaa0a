"""Every option of the command line is named on a page that names its command."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer

from tests.project.layout import ROOT
from wbc.cli.app import app


def options(command: Any, words: tuple[str, ...]) -> Iterator[tuple[str, list[str]]]:
    """(command, the names of one of its options) of a command and of those below it."""
    for name, below in getattr(command, "commands", {}).items():
        yield from options(below, (*words, name))
    if not hasattr(command, "commands"):
        for parameter in command.params:
            if parameter.param_type_name == "option":
                names = (*parameter.opts, *parameter.secondary_opts)
                yield " ".join(words), [name for name in names if name.startswith("--")]


def test_every_option_is_on_a_page_of_its_command() -> None:
    pages = [path.read_text() for path in (*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md")]
    there = list(options(typer.main.get_command(app), ("wbc",)))
    assert len(there) > 120
    missing = []
    for command, names in there:
        texts = [page for page in pages if command in page]
        if not any(re.search(rf"{re.escape(name)}(?![\w-])", page) for name in names for page in texts):
            missing.append(f"{command} {names[0]}")
    assert missing == []
