"""The name of a compiled stack in the cache: a hash of everything that its code is a function of."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import json
import marshal
import pathlib
import sys

import casadi as ca
import numpy as np

from wbc.multibody import algebra
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
    "wbc.robot",
    "wbc.rotations",
    "wbc.shapes",
    "wbc.stack",
    "wbc.symbolic",
    "wbc.tasks",
    "wbc.validation",
)


def key(stack: Declaration, version: str, toolchain: str) -> str:
    """Hash of the declaration, of the code that builds from it, and of package and compiler versions.

    ``toolchain`` is :func:`wbc.native.toolchain.identity`, or ``vm``. Weights, targets, gains and masks are run-time
    values and not in it. Of an item that is not this package's own, the file that its class stands in is in the hash,
    but not what that file imports.
    """
    versions = [ca.CasadiMeta.version(), algebra(stack.robot.tree).__version__, np.__version__, version, toolchain]
    classes = {base for entry in stack.entries for item in inner_items(entry.item) for base in type(item).__mro__}
    items = sorted({_source(base) for base in classes})
    text = json.dumps([stack.key_data(), versions, _own_code(), items], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@functools.cache
def _own_code() -> str:
    """Hash of this package's builders; about 7 ms, once a process."""
    digest = hashlib.sha256()
    for name, path in sorted((name, path) for part in PARTS for name, path in files_of(part)):
        digest.update(f"{name}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def files_of(part: str) -> list[tuple[str, pathlib.Path]]:
    """(name, path) of the Python and C files of a part of this package."""
    # Not imported for it
    spec = importlib.util.find_spec(part)
    assert spec is not None
    file = pathlib.Path(str(spec.origin))
    if file.name != "__init__.py":
        return [(part, file)]
    found = (path for path in file.parent.rglob("*") if path.suffix in (".py", ".c", ".h"))
    return [(f"{part}/{path.relative_to(file.parent).as_posix()}", path) for path in found]


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
