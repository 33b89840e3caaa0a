"""Types of the run-time values of all items, for editors and type checkers: the stub of ``wbc.controller.handles``."""

from __future__ import annotations

import inspect
from pathlib import Path

from wbc.controller import handles
from wbc.pages import docstring
from wbc.pages.folder import shipped
from wbc.tasks import MovingFrame
from wbc.tasks._contact import ContactForce
from wbc.tasks.base import Constraint, Item, Task
from wbc.tasks.inputs import SENSED

#: Where it is written
FILE = Path(inspect.getfile(handles)).with_suffix(".pyi")
HEAD = '''"""Run-time values of every class of items, from their declarations; `make docs` writes this file."""

from collections.abc import Mapping
from typing import Any, overload

from wbc.controller.handle import Handle
from wbc.stack.declaration import Declaration
'''
TAIL = """    @overload
    def __getitem__(self, item: Item) -> Any: ...
    def __contains__(self, item: object) -> bool: ...
"""


def values(cls: type[Item]) -> dict[str, str]:
    """Name of each value that items of a class may have -> its type; what a stack of accelerations has is among them.

    A value is a number where the field of its name is one.
    """
    fields = {name: str(p.annotation) for name, p in inspect.signature(cls).parameters.items()}
    named, _ = docstring.inputs_of(cls)
    found = {name: "float" if fields.get(name) in ("float", "float | None") else "Any" for name in named}
    if issubclass(cls, Task):
        found |= dict.fromkeys(("weight", "gain", "stiffness", "damping"), "float")
        if "feedforward" in named:
            found["acceleration"] = "Any"
    if issubclass(cls, Constraint):
        found["price"] = "float"
        if cls.equality or cls.margins is not Constraint.margins:
            found["rate"] = "float"
        if cls.sensed_rows is not Constraint.sensed_rows:
            found |= dict.fromkeys(SENSED, "Any")
    return found


def text() -> str:
    """The stub."""
    kinds = {**shipped(), "ContactForce": ContactForce, "MovingFrame": MovingFrame}
    # What a user declares in them the checker cannot know
    kinds = {name: cls for name, cls in kinds.items() if not docstring.inputs_of(cls)[1]}
    owned = {name: values(cls) for name, cls in kinds.items()}
    every = {value: of for own in owned.values() for value, of in own.items()}
    imports = [f"from {cls.__module__} import {name}" for name, cls in {**kinds, "Item": Item}.items()]
    classes = [_declared(f"{name}Handle", own) for name, own in owned.items()]
    overloads = [("str", "NamedHandle"), *((name, f"{name}Handle") for name in kinds)]
    getters = [
        f"    @overload\n    def __getitem__(self, item: {item}) -> {handle}: ...\n" for item, handle in overloads
    ]
    head = HEAD + "\n".join(sorted(imports, key=str.casefold)) + "\n\n"
    room = "class Handles:\n    def __init__(self, handles: Mapping[str, Handle], stack: Declaration) -> None: ...\n"
    return head + "\n".join([*classes, _declared("NamedHandle", every)]) + "\n" + room + "".join(getters) + TAIL


def _declared(name: str, own: dict[str, str]) -> str:
    return "\n".join([f"class {name}(Handle):", *(f"    {value}: {of}" for value, of in own.items())]) + "\n"


def stale() -> list[str]:
    """The stub's name where it differs from what :func:`update` would write."""
    return [] if FILE.is_file() and FILE.read_text(encoding="utf-8") == text() else [FILE.name]


def update() -> list[str]:
    """Write the stub; returns its name where it changed."""
    changed = stale()
    if changed:
        FILE.write_text(text(), encoding="utf-8")
    return changed
