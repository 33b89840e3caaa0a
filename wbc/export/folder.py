"""Writing an export."""

from __future__ import annotations

import os
import pathlib
import re
import shutil
import tempfile
from importlib import resources

import numpy as np

from wbc import validation
from wbc.errors import WbcError
from wbc.export.header import header
from wbc.export.memory import bytes_of_tick
from wbc.export.snapshot import Snapshot
from wbc.export.solver_code import from_source, from_wheel
from wbc.export.texts import build_files

#: First number of check.bin, see check.c
MARK = 1234567.0
#: Files that are the same in every export
_SAME = ("wbc_tick.c", "wbc_rows.c", "single.h", "check.c")
_EXPORTED = re.compile(r"^CASADI_SYMBOL_EXPORT [^(;]*?\b(\w+)\(", re.MULTILINE)


class ExportError(WbcError):
    """A folder that an export cannot be written to."""


def write(
    snapshot: Snapshot,
    folder: str | os.PathLike[str],
    overwrite: bool = False,
    solver_source: bool | str | os.PathLike[str] = False,
) -> pathlib.Path:
    """Write an export; the folder appears whole or not at all.

    Args:
        overwrite: an export that is there is replaced. Folders with anything else in them never are.
        solver_source: with the solver's source in place of the library: True to fetch it, or its archive.

    Raises:
        ExportError: the folder is not empty, holds something else, or cannot be written.
        SolverSourceError: the solver cannot be had.
    """
    place = checked_folder(folder, overwrite)
    files = _files(snapshot, solver_source)
    with validation.writing("folder", place, ExportError):
        place.parent.mkdir(parents=True, exist_ok=True)
        fresh = pathlib.Path(tempfile.mkdtemp(prefix=f".{place.name}-", dir=place.parent))
        try:
            for name, data in files.items():
                (fresh / name).parent.mkdir(parents=True, exist_ok=True)
                (fresh / name).write_bytes(data)
            fresh.chmod(0o755)
            old = fresh.with_name(f"{fresh.name}.old")
            if place.is_dir():
                # what was there goes only when the new one is complete
                place.rename(old)
            fresh.rename(place)
            shutil.rmtree(old, ignore_errors=True)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
    return pathlib.Path(folder)


def checked_folder(folder: str | os.PathLike[str], overwrite: bool) -> pathlib.Path:
    """Where an export may be written.

    Raises:
        ShapeError: no path, or no flag. ExportError: the folder is not empty, or holds something else.
    """
    place = validation.file_path("folder", folder).absolute()
    _check(place, validation.flag("overwrite", overwrite))
    return place


def _check(place: pathlib.Path, overwrite: bool) -> None:
    """Refuse a folder before any work is done."""
    try:
        if not place.exists():
            return
        present = {path.name for path in place.iterdir()} if place.is_dir() else None
    except OSError as error:
        raise ExportError("folder", str(place), f"cannot be read: {error.strerror}") from error
    if present is None:
        raise ExportError("folder", str(place), "is a file")
    if present and not overwrite:
        raise ExportError("folder", str(place), "is not empty; overwrite (--force) replaces an export")
    if present and not {"wbc_tick.h", "values.h"} <= present:
        raise ExportError("folder", str(place), "holds something else than an export, which is not overwritten")


def _files(snapshot: Snapshot, solver_source: bool | str | os.PathLike[str]) -> dict[str, bytes]:
    """Everything, by its place in the folder."""
    if solver_source is False:
        solver = from_wheel()
    else:
        solver = from_source(None if solver_source is True else solver_source)
    sources = snapshot.sources
    memory = bytes_of_tick(sources["tick.h"], sources["stack.h"], snapshot.layout)
    texts = {f"tick/{name}": text for name, text in sources.items()}
    texts |= {name: (resources.files("wbc.export") / "c" / name).read_text() for name in _SAME}
    texts |= {"wbc_tick.h": header(snapshot), "values.h": snapshot.values, "names.h": _names(sources["rows.c"])}
    texts |= build_files(snapshot, solver_source is not False, memory)
    layout = snapshot.layout
    head = [MARK, len(snapshot.states), layout.nq, layout.nv, layout.parameters, snapshot.agrees]
    states = np.concatenate([head, snapshot.states.ravel()]).astype("=f8").tobytes()
    return {name: text.encode() for name, text in texts.items()} | {"check.bin": states} | solver


def _names(rows: str) -> str:
    """``names.h``: what the parts call each other, so that no name without ``wbc_`` is visible to a program."""
    names = dict.fromkeys(_EXPORTED.findall(rows))
    lines = [f"#define {name} wbc_{name}" for name in names]
    return "\n".join(
        [
            "/* Names that a program sees begin with wbc_; generated */",
            "#ifdef WBC_SINGLE",
            '#include "single.h"',
            "#endif",
            "#define EXPORT static __attribute__((unused))",
            "#define CASADI_SYMBOL_EXPORT",
            "#define CASADI_CODEGEN_PREFIX",
            "#define CODEGEN_PREFIX wbc_generated_",
            *lines,
            "",
        ]
    )
