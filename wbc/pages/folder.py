"""The folder of pages: which there must be, which are stale, and how they are written."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

from wbc.pages import docstring, section
from wbc.pages.docstring import PageError
from wbc.stack.declaration import Declaration, Entry
from wbc.tasks.base import Item, Task, registry

INDEX = "README.md"
#: A page of this project that a docstring names, with a heading of it
PAGE = re.compile(r"\bdocs/(\w+\.md)((?:#[\w-]+)?)")
#: What an index leaves out of a sentence
APART = re.compile(r" \([^()]*\)")
#: What stands above the tables of the index
INDEX_HEAD = """# Tasks and constraints

A page an item, made from its docstring by `make docs`. [Your own tasks](expression.md) have the same rights.

## Every item

A task gives rows J v + de/dt = -gain e, met in the least-squares sense, with J = de/dq. A constraint gives margins
h >= 0, kept by dh/dq v + dh/dt >= -rate h, rows lower <= A v <= upper, equalities A v = b, or bounds of v. Where they
cannot all hold, those of the highest
[order of sacrifice](../controller.md#when-rows-cannot-all-hold-the-order-of-sacrifice) give way first.

A tick is linear and looks one tick ahead: a margin may be passed by the curvature of a point's path, at most
(1/2) rho w^2 dt^2 for a point within rho of joint axes that turn at w in all. At an error of half a turn noise may
choose the sense of rotation.

Fields are given when the item is declared. An input can also be set afterwards, `controller["name"].field = value`,
from the next tick on. A bad value raises a typed error of `wbc.errors` that names it, and changes nothing. All have

| Input | Of | Meaning |
|---|---|---|
| `gain` [1/s] | tasks | >= 0; the error decays like exp(-gain t) where nothing hinders it; above 1/dt it changes sign |
| `weight` | tasks | >= 0; of all rows, against other tasks; first value: that of `stack.add` |
| `rate` [1/s] | margins | above 0, at most 1/dt; h decays no faster than exp(-rate t) |
| `enabled` | all | False: as if the item were not there |
| `mask` | all | one number a row: times a task's row weight, >= 0; 1 on, 0 off for a constraint |
"""


def example_of(cls: type, code: str) -> tuple[Declaration, Entry]:
    """The first item of a class in an example, and the stack that it is in.

    The example runs up to where a stack is compiled: what is declared is known by then.

    Raises:
        PageError: it has no such item.
    """
    names: dict[str, Any] = {}
    exec(compile(_declaring(code), cls.__name__, "exec"), names)
    for value in names.values():
        if isinstance(value, Declaration):
            for entry in value.entries:
                if type(entry.item) is cls:
                    return value, entry
    raise PageError(f"{cls.__name__}.__doc__", "Example", "it adds no such item to a stack that has a name")


def _declaring(code: str) -> ast.Module:
    tree = ast.parse(code)
    for k, statement in enumerate(tree.body):
        if any(isinstance(node, ast.Attribute) and node.attr == "compile" for node in ast.walk(statement)):
            tree.body = tree.body[:k]
            break
    return tree


def shipped() -> dict[str, type[Item]]:
    """The classes of this package by name; others, a user's too, are in the registry but have no page here."""
    return {name: cls for name, cls in sorted(registry().items()) if cls.__module__.startswith("wbc.tasks.")}


def page_name(cls: type[Item]) -> str:
    """File name of a class's page: that of its module."""
    return f"{cls.__module__.rsplit('.', 1)[-1]}.md"


def made(cls: type[Item]) -> str:
    """The page of a class, with links to the items and pages that it names.

    Raises:
        PageError: the docstring lacks something.
    """
    text = docstring.read(cls)
    part = section.page(cls, text, *example_of(cls, text.example))
    pages = {name: page_name(other) for name, other in shipped().items() if other is not cls}
    names = re.compile(rf"(?<!\[)`({'|'.join(pages)})`")

    def linked(line: str) -> str:
        return PAGE.sub(r"[\1](../\1\2)", names.sub(lambda m: f"[{m[0]}]({pages[m[1]]})", line))

    before, code, after = re.split(r"(```python\n.*?```\n)", part, flags=re.DOTALL)
    return docstring.prose(before, linked) + code + docstring.prose(after, linked) + "\n"


def index() -> str:
    """The list of all items, a line each, without the symbols and remarks that stand in parentheses on their pages."""
    lists = []
    for title, wanted in (("Tasks", True), ("Constraints", False)):
        lines = [
            f"- [{name}]({page_name(cls)}): {APART.sub('', docstring.read(cls).summary)}"
            for name, cls in shipped().items()
            if issubclass(cls, Task) is wanted
        ]
        lists.append("\n".join([f"## {title}\n", *lines]))
    return INDEX_HEAD + "\n" + "\n\n".join(lists) + "\n"


def stale(folder: Path) -> list[str]:
    """Names of the files that differ from what :func:`update` would write."""
    return [name for name, text in _wanted().items() if not _same(folder / name, text)]


def update(folder: Path) -> list[str]:
    """Write the pages and the index; returns the names of the files that changed.

    Raises:
        PageError: see :func:`made`; nothing is written.
    """
    changed = []
    for name, text in _wanted().items():
        if not _same(folder / name, text):
            (folder / name).write_text(text, encoding="utf-8")
            changed.append(name)
    return changed


def _wanted() -> dict[str, str]:
    return {page_name(cls): made(cls) for cls in shipped().values()} | {INDEX: index()}


def _same(file: Path, text: str) -> bool:
    return file.is_file() and file.read_text(encoding="utf-8") == text
