"""Generated code in the cache: a CasADi function, or any text made of such."""

from __future__ import annotations

import hashlib
import pathlib
from collections.abc import Callable

import casadi as ca

from wbc.errors import CompileError
from wbc.native import cache, toolchain

_LIBRARY = "function.so"


def compiled(function: ca.Function) -> ca.Function:
    """The function as a library, named in the cache by what it computes.

    Returns:
        The function itself, which runs on the virtual machine, where there is no compiler or it fails; the log says so.
    """
    library = function_library(function)
    return function if library is None else ca.external(function.name(), str(library))


def function_library(function: ca.Function) -> pathlib.Path | None:
    """The library of a function; None where there is no compiler or it fails; the log says so."""
    if not toolchain.available():
        return None

    def text() -> str:
        generator = ca.CodeGenerator("function.c", {"with_header": False})
        generator.add(function)
        return str(generator.dump())

    try:
        return generated_library(function.serialize(), text)
    except CompileError as error:
        toolchain.fall_back(str(error))
        return None


def generated_library(meaning: str, text: Callable[[], str]) -> pathlib.Path:
    """The library of a C text that is made where it is not in the cache, named there by what the text stands for.

    Raises:
        CompileError: there is no compiler, or it fails.
    """
    name = hashlib.sha256(f"{meaning}\n{toolchain.identity()}".encode()).hexdigest()

    def fill(folder: pathlib.Path) -> None:
        toolchain.compile_rows(text(), folder / _LIBRARY)

    folder, _ = cache.fetch(name, fill, library=True)
    return folder / _LIBRARY
