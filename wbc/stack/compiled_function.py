"""A CasADi function as compiled code in the cache."""

from __future__ import annotations

import hashlib
import pathlib

import casadi as ca

from wbc.errors import CompileError
from wbc.stack import cache, toolchain


def compiled(function: ca.Function) -> ca.Function:
    """The function as a library, named in the cache by what it computes.

    Returns:
        The function itself, which runs on the virtual machine, where there is no compiler or it fails; the log says so.
    """
    if not toolchain.available():
        return function
    name = hashlib.sha256(f"{function.serialize()}\n{toolchain.identity()}".encode()).hexdigest()

    def fill(folder: pathlib.Path) -> None:
        generator = ca.CodeGenerator("function.c", {"with_header": False})
        generator.add(function)
        toolchain.compile_rows(generator.dump(), folder / "function.so")

    try:
        folder, _ = cache.fetch(name, fill, library=True)
    except CompileError as error:
        toolchain.fall_back(str(error))
        return function
    return ca.external(function.name(), str(folder / "function.so"))
