"""The example of a page: its stack, declared but not compiled."""

from __future__ import annotations

import ast
import re
from typing import Any

from wbc.pages.docstring import PageError
from wbc.stack.declaration import Declaration, Entry

BLOCK = re.compile(r"```python\n(.*?)```", flags=re.DOTALL)


def find(cls: type, page: str, text: str) -> tuple[Declaration, Entry]:
    """The first item of a class in the examples of a page, and the stack that it is in.

    Every block runs by itself, up to where a stack is compiled: what is declared is known by then.

    Raises:
        PageError: no example has such an item.
    """
    for block in BLOCK.findall(text):
        names: dict[str, Any] = {}
        exec(compile(_declaring(block), page, "exec"), names)
        for value in names.values():
            if isinstance(value, Declaration):
                for entry in value.entries:
                    if type(entry.item) is cls:
                        return value, entry
    raise PageError(page, cls.__name__, "no example of the page adds one to a stack that has a name")


def _declaring(block: str) -> ast.Module:
    tree = ast.parse(block)
    for k, statement in enumerate(tree.body):
        if any(isinstance(node, ast.Attribute) and node.attr == "compile" for node in ast.walk(statement)):
            tree.body = tree.body[:k]
            break
    return tree
