"""The name of a compiled stack in the cache: a hash of everything that its code is a function of."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import importlib.util
import json
import marshal
import os
import pathlib
import sys

import casadi as ca
import numpy as np

from wbc.multibody import algebra
from wbc.native.library import file_bytes
from wbc.stack.declaration import Declaration, inner_items

#: Everything that runs when a program is built: all parts that this one imports, and what those import. A test compares
#: this with the imports themselves, and with what runs. The robots' data are not here: they are in the key.
PARTS = (
    "wbc.errors",
    "wbc.extras",
    "wbc.geometry",
    "wbc.lazy",
    "wbc.multibody",
    "wbc.native",
    "wbc.pickling",
    "wbc.proximity",
    "wbc.quick_dataclasses",
    "wbc.robot",
    "wbc.rotations",
    "wbc.sealed",
    "wbc.shapes",
    "wbc.stack",
    "wbc.symbolic",
    "wbc.tasks",
    "wbc.validation",
)


def key(stack: Declaration, version: str) -> str:
    """Hash of the declaration, of the code that builds from it, and of package versions.

    Weights, targets, gains and masks are run-time values and not in it. Of an item that is not this package's own, and
    of dataclasses that are its fields, the files that the classes stand in are in the hash, not what those import.
    """
    versions = [ca.CasadiMeta.version(), algebra(stack.robot.tree).__version__, np.__version__, version]
    all_items = [item for entry in stack.entries for item in inner_items(entry.item)]
    values = [type(value) for item in all_items for value in vars(item).values() if dataclasses.is_dataclass(value)]
    classes = {base for kind in (*map(type, all_items), *values) for base in kind.__mro__}
    items = sorted({_source(base) for base in classes})
    text = json.dumps([stack.key_data(), versions, _own_code(), items], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def library_key(stack_key: str, toolchain: str) -> str:
    """Name of a stack's library: its :func:`key`, and a hash of :func:`wbc.native.toolchain.identity`."""
    return f"{stack_key}-{hashlib.sha256(toolchain.encode()).hexdigest()[:16]}"


@functools.cache
def _own_code() -> str:
    """Hash of this package's builders; about 3 ms, once a process."""
    digest = hashlib.sha256()
    for name, path in sorted(named for part in PARTS for named in files_of(part)):
        digest.update(f"{name}\n".encode())
        digest.update(file_bytes(path))
    return digest.hexdigest()


def files_of(part: str) -> list[tuple[str, str]]:
    """(name, path) of the Python and C files of a part of this package."""
    # Not imported for it
    spec = importlib.util.find_spec(part)
    assert spec is not None
    file = str(spec.origin)
    if os.path.basename(file) != "__init__.py":
        return [(part, file)]
    out, waiting = [], [(part, os.path.dirname(file))]
    for name, folder in waiting:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.endswith((".py", ".c", ".h")):
                    out.append((f"{name}/{entry.name}", entry.path))
                elif "." not in entry.name and entry.is_dir():
                    waiting.append((f"{name}/{entry.name}", entry.path))
    return out


def _source(of: type) -> str:
    """Hash of what a user's class says; empty for classes that came with a package version of their own."""
    module = of.__module__
    if module in ("builtins", "abc", "typing") or module.startswith(tuple(f"{part}." for part in PARTS)):
        return ""
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is not None and pathlib.Path(file).is_file():
        return hashlib.sha256(pathlib.Path(file).read_bytes()).hexdigest()
    # Typed at a prompt: there is no file, so the byte code speaks for it
    codes = [f.__code__ for _, f in sorted(vars(of).items()) if hasattr(f, "__code__")]
    return hashlib.sha256(b"".join(marshal.dumps(code) for code in codes)).hexdigest()
