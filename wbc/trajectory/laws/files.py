"""Paths, timings and limits of laws in files: arrays in one ``.npz``, which come back bit for bit."""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import LawFileError, WbcError
from wbc.trajectory.laws.limits import MotionLimits
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.paths.from_function import FunctionPath
from wbc.trajectory.paths.path import JoinedPath, Path, PolynomialPath
from wbc.trajectory.paths.pose_path import Circle, PosePath
from wbc.trajectory.paths.turning import QuaternionSpline, TwoTurns

#: What this version writes and reads
FORMAT = 1

Parts = dict[str, Any]


@dataclass(frozen=True)
class SavedKind:
    """Paths, or parts of them, of one class.

    Attributes:
        kind: the class; what is derived from it is of another kind.
        parts: attributes that make an object again: arrays, numbers, or objects of a kind.
        build: the class and these -> the object.
    """

    kind: type
    parts: tuple[str, ...]
    build: Callable[[Any, Parts], Any] = lambda make, parts: make(**parts)


def _from_function(make: type[FunctionPath], p: Parts) -> FunctionPath:
    return make(p["knots"], p["coefficients"], (p["start"], p["end"]), p["deviation"], int(p["intervals"]))


#: Every kind of path that a file can hold, by the word for it in the file
KINDS = {
    "polynomial": SavedKind(PolynomialPath, ("knots", "coefficients")),
    "joined": SavedKind(JoinedPath, ("first", "second")),
    "function": SavedKind(
        FunctionPath, ("knots", "coefficients", "start", "end", "deviation", "intervals"), _from_function
    ),
    "poses": SavedKind(PosePath, ("position", "turning")),
    "circle": SavedKind(Circle, ("center", "x", "y", "rate", "knots")),
    "turns": SavedKind(TwoTurns, ("angles", "first", "second", "base")),
    "quaternions": SavedKind(QuaternionSpline, ("spline",), lambda make, parts: make(parts["spline"], "path.poses")),
}


@dataclass(frozen=True, eq=False)
class Saved:
    """What a file holds of a law: its path, timing and limits, and whether other motions meet its ends."""

    path: Path
    timing: Timing
    limits: MotionLimits
    moving: tuple[bool, bool]


def save(law: Saved, file: str | os.PathLike[str]) -> None:
    """Write a law into a file of this name, as ``numpy.savez`` does; one that is there is replaced when all is written.

    Raises:
        LawFileError: the file cannot be written, or the path is of a kind that files do not hold.
    """
    target = validation.file_path("file", file)
    arrays: Parts = {"format": np.array(FORMAT), "moving": np.array(law.moving)}
    arrays |= {"timing.times": law.timing.times, "timing.coefficients": law.timing.coefficients}
    for field in fields(law.limits):
        value = getattr(law.limits, field.name)
        if value is not None:
            arrays[f"limits.{field.name}"] = value
    _put(arrays, "path", law.path)
    if not target.name:
        raise LawFileError("file", str(target), "is a folder")
    with validation.replacing("file", target, LawFileError) as fresh, fresh.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def read(file: str | os.PathLike[str]) -> Saved:
    """What :func:`save` wrote.

    Raises:
        LawFileError: no such file, not of a law, damaged, or of another format.
    """
    source, name = validation.file_path("file", file), str(file)
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
        limits = {field.name: arrays.get(f"limits.{field.name}") for field in fields(MotionLimits)}
        timing = Timing(arrays["timing.times"], arrays["timing.coefficients"])
        before, after = (bool(x) for x in arrays["moving"])
        return Saved(_taken(arrays, "path"), timing, MotionLimits(**limits), (before, after))
    except (WbcError, AttributeError, KeyError, TypeError, ValueError, IndexError) as error:
        raise LawFileError("file", name, f"damaged: {error}") from error


def _put(arrays: Parts, name: str, thing: object) -> None:
    """Arrays of a path or of a part of it, by names with dots."""
    if isinstance(thing, (np.ndarray, np.generic, float, int)):
        arrays[name] = np.asarray(thing)
        return
    for word, kind in KINDS.items():
        if type(thing) is kind.kind:
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
    kind = KINDS[word]
    return kind.build(kind.kind, {part: _taken(arrays, f"{name}.{part}") for part in kind.parts})
