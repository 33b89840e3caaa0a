"""Every option of the command line is named on a page that names its command."""

from __future__ import annotations

import re
from collections.abc import Iterator

from tests.project.layout import ROOT
from wbc.cli.app import COMMANDS, command


def options() -> Iterator[tuple[str, list[str]]]:
    """(command, the names of one of its options) of every command and mode."""
    for name, entry in COMMANDS.items():
        for mode in entry.modes:
            for parameter in command(name, mode).params:
                if parameter.param_type_name == "option":
                    names = (*parameter.opts, *parameter.secondary_opts)
                    yield f"wbc {name}", [n for n in names if n.startswith("--")]


def test_every_option_is_on_a_page_of_its_command() -> None:
    pages = [path.read_text() for path in (*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md")]
    there = list(options())
    assert len(there) > 120
    missing = []
    for words, names in there:
        texts = [page for page in pages if words in page]
        if not any(re.search(rf"{re.escape(name)}(?![\w-])", page) for name in names for page in texts):
            missing.append(f"{words} {names[0]}")
    assert missing == []
