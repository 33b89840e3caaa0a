"""Packages whose names are imported when they are first used.

A package writes the imports of its public names under ``if TYPE_CHECKING``, as ``from module import Name as Name``,
which type checkers and editors read as public; :func:`attach` reads them there as well, so that each is written once
and importing the package costs next to nothing.
"""

from __future__ import annotations

import gc
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


def attach(package: str, file: str, *more: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__`` (public names, then modules), ``__dir__`` and ``__all__`` of a package.

    Args:
        package: its ``__name__``.
        file: its ``__file__``.
        more: public names that it defines itself.
    """
    with open(file, encoding="utf-8") as source:
        found_at = imports_in(source.read())

    def find(name: str) -> Any:
        if name in found_at:
            module, original = found_at[name]
            whole = module == package
            with _no_collection():
                value = importlib.import_module(f"{module}.{original}" if whole else module)
            value = value if whole else getattr(value, original)
            setattr(sys.modules[package], name, value)
            return value
        if not name.startswith("_") and importlib.util.find_spec(f"{package}.{name}") is not None:
            return importlib.import_module(f"{package}.{name}")
        raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=sys.modules[package])

    public = sorted({*found_at, *more})
    return find, lambda: public, public


@contextmanager
def _no_collection() -> Iterator[None]:
    """Without looking for garbage: imports leave none, and looking takes a fifteenth of their time."""
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            if gc.get_freeze_count() == 0:
                # What was imported lives as long as the process: both together make it old without looking through it
                gc.freeze()
                gc.unfreeze()
            gc.enable()


def imports_in(text: str) -> dict[str, tuple[str, str]]:
    """Public name -> (module, name there), from the imports under ``if TYPE_CHECKING``: nothing else stands there, and
    Python's parser takes ten times as long.
    """
    block = text.partition("\nif TYPE_CHECKING:\n")[2].partition("\nelse:\n")[0]
    out = {}
    for statement in " ".join(line.partition("#")[0] for line in block.splitlines()).split(" from ")[1:]:
        module, _, names = statement.partition(" import ")
        for name in filter(str.strip, names.strip(" ()").split(",")):
            original, _, public = name.strip().partition(" as ")
            out[public or original] = (module, original)
    return out
