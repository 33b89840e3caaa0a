"""The folder of pages: which there must be, which are stale, and how they are written."""

from __future__ import annotations

import re
from pathlib import Path

from wbc.pages import docstring, example, section
from wbc.pages.docstring import PageError
from wbc.tasks.base import Item, Task, registry

BEGIN, END = "<!-- declared -->", "<!-- end -->"
MARKED = re.compile(f"{re.escape(BEGIN)}\n.*?{re.escape(END)}\n", flags=re.DOTALL)
INDEX = "README.md"
#: What stands above the tables of the index
HEAD = """# Tasks and constraints

A page an item. The part of a page that stands between marks is made from the declaration by `make docs`, and so is this
list; a test fails where it is stale. [Your own tasks](expression.md) have the same rights.
"""


def shipped() -> dict[str, type[Item]]:
    """The classes of this package by name; others, a user's too, are in the registry but have no page here."""
    return {name: cls for name, cls in sorted(registry().items()) if cls.__module__.startswith("wbc.tasks.")}


def page_name(cls: type[Item]) -> str:
    """File name of a class's page: that of its module."""
    return f"{cls.__module__.rsplit('.', 1)[-1]}.md"


def made(cls: type[Item], folder: Path) -> str:
    """The page of a class as it should be: its own text, with the declared part made anew.

    Raises:
        PageError: there is no page, it has no marks or no example, or the docstring lacks something.
    """
    file = folder / page_name(cls)
    if not file.is_file():
        raise PageError("page", str(file), f"{cls.__name__} has no page; write one, with {BEGIN} and {END} in it")
    text = file.read_text(encoding="utf-8")
    if len(MARKED.findall(text)) != 1:
        raise PageError("page", str(file), f"expected lines {BEGIN} and {END}, once each")
    part = section.declared(cls, *example.find(cls, page_name(cls), text))
    return MARKED.sub(lambda _: f"{BEGIN}\n\n{part}\n\n{END}\n", text)


def index() -> str:
    """The list of all items, a line each."""
    tables = []
    for title, wanted in (("Tasks", True), ("Constraints", False)):
        rows = [
            f"| [{name}]({page_name(cls)}) | {docstring.read(cls).summary.replace('|', chr(92) + '|')} |"
            for name, cls in shipped().items()
            if issubclass(cls, Task) is wanted
        ]
        tables.append("\n".join([f"## {title}\n", "| | |", "|---|---|", *rows]))
    return HEAD + "\n" + "\n\n".join(tables) + "\n"


def stale(folder: Path) -> list[str]:
    """Names of the files that differ from what :func:`update` would write."""
    return [name for name, text in _wanted(folder).items() if not _same(folder / name, text)]


def update(folder: Path) -> list[str]:
    """Write the declared parts and the index; returns the names of the files that changed.

    Raises:
        PageError: see :func:`made`; nothing is written.
    """
    changed = []
    for name, text in _wanted(folder).items():
        if not _same(folder / name, text):
            (folder / name).write_text(text, encoding="utf-8")
            changed.append(name)
    return changed


def _wanted(folder: Path) -> dict[str, str]:
    return {page_name(cls): made(cls, folder) for cls in shipped().values()} | {INDEX: index()}


def _same(file: Path, text: str) -> bool:
    return file.is_file() and file.read_text(encoding="utf-8") == text
