"""Laws in files: their path, timing and limits as arrays in one ``.npz``, which come back bit for bit."""

from __future__ import annotations

import contextlib
import importlib
import os
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import LawFileError, WbcError
from wbc.trajectory.certificate import Check, all_checks
from wbc.trajectory.law import Law
from wbc.trajectory.limits import Limits
from wbc.trajectory.timing import Timing

#: What this version writes and reads
FORMAT = 1

Parts = dict[str, Any]


@dataclass(frozen=True)
class Kind:
    """A class of paths, or of parts of them.

    Attributes:
        module, name: where it is, so that it is imported when a file has one.
        parts: its attributes that make it again: arrays, numbers, or objects of a kind.
        build: the class and these -> the object.
    """

    module: str
    name: str
    parts: tuple[str, ...]
    build: Callable[[Callable[..., Any], Parts], Any] = lambda make, parts: make(**parts)

    def of(self, thing: object) -> bool:
        """Whether something is of this class, and of none that is derived from it."""
        return (type(thing).__module__, type(thing).__name__) == (f"wbc.trajectory.{self.module}", self.name)

    def made(self, parts: Parts) -> Any:
        return self.build(getattr(importlib.import_module(f"wbc.trajectory.{self.module}"), self.name), parts)


def _from_function(make: Callable[..., Any], p: Parts) -> Any:
    return make(p["knots"], p["coefficients"], (p["start"], p["end"]), p["deviation"], int(p["intervals"]))


#: Every kind of path that a file can hold, by the word for it in the file
KINDS = {
    "polynomial": Kind("path", "PolynomialPath", ("knots", "coefficients")),
    "joined": Kind("path", "JoinedPath", ("first", "second")),
    "function": Kind(
        "from_function",
        "FunctionPath",
        ("knots", "coefficients", "start", "end", "deviation", "intervals"),
        _from_function,
    ),
    "poses": Kind("pose_path", "PosePath", ("position", "turning")),
    "circle": Kind("pose_path", "Circle", ("center", "x", "y", "rate", "knots")),
    "turns": Kind("turning", "Turns", ("angles", "first", "second", "base")),
    "quaternions": Kind(
        "turning", "QuaternionSpline", ("spline",), lambda make, parts: make(parts["spline"], "path.poses")
    ),
}


def save(law: Law, file: str | os.PathLike[str]) -> None:
    """Write a law into a file of this name, as ``numpy.savez`` does; one that is there is replaced when all is written.

    Its ``checks`` are functions and stay behind, see :func:`load`.

    Raises:
        LawFileError: the file cannot be written, or the path is of a kind that files do not hold.
    """
    target = validation.file_path("file", file)
    arrays = {"format": np.array(FORMAT), "moving": np.array(law.moving)}
    arrays |= {"timing.times": law.timing.times, "timing.coefficients": law.timing.coefficients}
    for field in fields(law.limits):
        value = getattr(law.limits, field.name)
        if value is not None:
            arrays[f"limits.{field.name}"] = value
    _put(arrays, "path", law.path)
    if not target.name:
        raise LawFileError("file", str(target), "is a folder")
    partial = target.with_name(f"{target.name}.{os.getpid()}.part")
    try:
        with partial.open("wb") as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]
        partial.replace(target)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise LawFileError("file", str(target), f"cannot be written: {error.strerror}") from error


def load(file: str | os.PathLike[str], checks: Sequence[Check] = ()) -> Law:
    """The law in a file that :meth:`Law.save` wrote: the same numbers, and so the same states and certificate.

    Args:
        checks: further quantities for its certificate, which files do not hold.

    Raises:
        LawFileError: no such file, not of a law, damaged, or of another format.
    """
    source, name = validation.file_path("file", file), str(file)
    checks = all_checks(checks)
    try:
        with source.open("rb") as stream:
            archive = np.load(stream, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise LawFileError("file", name, "not a saved law: one array")
            arrays = {key: archive[key] for key in archive.files}
    except OSError as error:
        raise LawFileError("file", name, f"cannot be read: {error.strerror or error}") from error
    except (ValueError, EOFError, AttributeError, zipfile.BadZipFile, zlib.error, NotImplementedError) as error:
        raise LawFileError("file", name, "not a saved law, or damaged") from error
    if "format" not in arrays or "path.kind" not in arrays:
        raise LawFileError("file", name, "holds arrays, but no law")
    if arrays["format"].shape != () or arrays["format"] != FORMAT:
        raise LawFileError("file", name, f"of format {arrays['format']}, expected {FORMAT}")
    try:
        limits = {field.name: arrays.get(f"limits.{field.name}") for field in fields(Limits)}
        timing = Timing(arrays["timing.times"], arrays["timing.coefficients"])
        before, after = (bool(x) for x in arrays["moving"])
        return Law(_taken(arrays, "path"), timing, Limits(**limits), checks, (before, after))
    except (WbcError, AttributeError, KeyError, TypeError, ValueError, IndexError) as error:
        raise LawFileError("file", name, f"damaged: {error}") from error


def _put(arrays: Parts, name: str, thing: object) -> None:
    """Arrays of a path or of a part of it, by names with dots."""
    if isinstance(thing, (np.ndarray, np.generic, float, int)):
        arrays[name] = np.asarray(thing)
        return
    for word, kind in KINDS.items():
        if kind.of(thing):
            arrays[f"{name}.kind"] = np.array(word)
            for part in kind.parts:
                _put(arrays, f"{name}.{part}", getattr(thing, part))
            return
    raise LawFileError(name, type(thing).__name__, "files do not hold paths of this kind", KINDS)


def _taken(arrays: Parts, name: str) -> Any:
    """What :func:`_put` put there."""
    if name in arrays:
        value = arrays[name]
        return value if value.shape else value.item()
    word = str(arrays[f"{name}.kind"])
    if word not in KINDS:
        raise LawFileError(f"{name}.kind", word, "no kind of path", KINDS)
    return KINDS[word].made({part: _taken(arrays, f"{name}.{part}") for part in KINDS[word].parts})
