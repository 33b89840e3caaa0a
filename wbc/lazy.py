"""Packages whose names are imported when they are first used.

A package writes the imports of its public names under ``if TYPE_CHECKING``, where type checkers and editors read them;
:func:`attach` reads them there as well, so that each is written once and importing the package costs next to nothing.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import pathlib
import sys
from collections.abc import Callable
from typing import Any


def attach(package: str, file: str) -> Callable[[str], Any]:
    """The ``__getattr__`` of a package: its public names, then its modules.

    Args:
        package: its ``__name__``.
        file: its ``__file__``.
    """
    found_at = _imports(ast.parse(pathlib.Path(file).read_text(encoding="utf-8")))

    def find(name: str) -> Any:
        if name in found_at:
            module, original = found_at[name]
            whole = module == package
            value = importlib.import_module(f"{module}.{original}" if whole else module)
            value = value if whole else getattr(value, original)
            setattr(sys.modules[package], name, value)
            return value
        if not name.startswith("_") and importlib.util.find_spec(f"{package}.{name}") is not None:
            return importlib.import_module(f"{package}.{name}")
        raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=sys.modules[package])

    return find


def _imports(tree: ast.Module) -> dict[str, tuple[str, str]]:
    """Public name -> (module, name there), from the imports under ``if TYPE_CHECKING``."""
    blocks = (n for n in tree.body if isinstance(n, ast.If) and getattr(n.test, "id", "") == "TYPE_CHECKING")
    imports = (n for block in blocks for n in block.body if isinstance(n, ast.ImportFrom))
    return {a.asname or a.name: (node.module or "", a.name) for node in imports for a in node.names}
