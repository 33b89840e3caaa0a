"""The example of a docstring: its stack, declared but not compiled."""

from __future__ import annotations

import ast
from typing import Any

from wbc.pages.docstring import PageError
from wbc.stack.declaration import Declaration, Entry


def find(cls: type, code: str) -> tuple[Declaration, Entry]:
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
