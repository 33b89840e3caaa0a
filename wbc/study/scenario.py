"""A scenario: the function that carries out one trial, by name, and what its signature says."""

from __future__ import annotations

import functools
import hashlib
import importlib
import inspect
import math
import sys
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, RobotFileError, ShapeError, UnknownNameError

Value = bool | int | float | str
#: A result of each metric: one number, or one for each row
Row = dict[str, list[float | None]]

#: Built-in scenarios: names of functions in :mod:`wbc.study.scenarios`
BUILT_IN = ("reach", "manipulability", "layouts", "ik")
#: Parameters that the study gives
GIVEN = ("seed", "threads")
_KINDS: dict[Any, tuple[type, ...]] = {float: (float, int), int: (int,), str: (str,), bool: (bool,)}


@dataclass(frozen=True)
class StudyTrial:
    """Parameters and a seed."""

    parameters: dict[str, Value]
    seed: int


@dataclass(frozen=True)
class Scenario:
    """The function of a trial: ``def function(*, seed: int, PARAMETERS) -> Mapping[str, float | Array]``.

    Parameters are declared as ``str``, ``int``, ``float`` or ``bool``; ``threads: int`` is given how many threads the
    trial may use. Metrics are numbers, or arrays of one length, a row of the results for each entry; a
    ``TypedDict`` as the declared result makes their names known before the first trial.

    Attributes:
        name: a built-in name, ``module:function`` or ``file.py:function``.
        source: text of the file, so that other machines need not have it.

    Raises:
        UnknownNameError: no such scenario or function. RobotFileError: no such file or module. RangeError: a function
            without ``seed``, or with parameters of other types.
    """

    name: str
    beside: Path | None = None
    source: str = field(default="", init=False)

    def __post_init__(self) -> None:
        place, colon, _ = self.name.rpartition(":")
        if not colon:
            validation.one_of("scenario", self.name, BUILT_IN)
        elif place.endswith(".py"):
            path = (self.beside or Path()) / place
            try:
                object.__setattr__(self, "source", path.read_text(encoding="utf-8"))
            except (OSError, UnicodeDecodeError) as error:
                raise RobotFileError("scenario", str(path), " ".join(str(error).split())) from error
            # Its own place, so that a run that is taken up again finds it from anywhere
            object.__setattr__(self, "name", f"{path.resolve()}:{self.name.rpartition(':')[2]}")
        object.__setattr__(self, "beside", None)
        _ = self.parameters

    @property
    def function(self) -> Callable[..., Mapping[str, Any]]:
        """What carries out a trial."""
        return _function(self.name, self.source)

    @property
    def parameters(self) -> dict[str, Any]:
        """Declared type of each parameter."""
        try:
            hints = typing.get_type_hints(self.function)
        except NameError as error:
            raise RangeError("scenario", self.name, f"has an annotation that is no type: {error}") from error
        found: dict[str, Any] = {}
        for name in inspect.signature(self.function).parameters:
            if name in GIVEN:
                continue
            if hints.get(name) not in _KINDS:
                raise RangeError("scenario", self.name, f"parameter {name} is not declared as str, int, float or bool")
            found[name] = hints[name]
        if "seed" not in inspect.signature(self.function).parameters:
            raise RangeError("scenario", self.name, "has no parameter seed")
        return found

    @property
    def needed(self) -> tuple[str, ...]:
        """Parameters without a default."""
        given = inspect.signature(self.function).parameters
        return tuple(name for name, one in given.items() if name not in GIVEN and one.default is one.empty)

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the results; none: not declared."""
        result = typing.get_type_hints(self.function).get("return")
        return tuple(typing.get_type_hints(result)) if typing.is_typeddict(result) else ()

    @property
    def version(self) -> str:
        """Hash of the text that the function stands in."""
        text = self.source or inspect.getsource(sys.modules[self.function.__module__])
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def checked(self, field_name: str, name: str, value: Value) -> Value:
        """A value of a parameter, of its declared type.

        Raises:
            RangeError: another type.
        """
        kind = self.parameters[name]
        if not isinstance(value, _KINDS[kind]) or (kind is not bool and isinstance(value, bool)):
            raise RangeError(field_name, value, f"expected {kind.__name__}")
        return float(value) if kind is float else value

    def run(self, trial: StudyTrial, metrics: tuple[str, ...], threads: int) -> Row:
        """Carry out a trial; numbers that are not finite become None.

        Raises:
            UnknownNameError: no such metric. ShapeError: results that are no numbers, or of different lengths.
        """
        more = {"threads": threads} if "threads" in inspect.signature(self.function).parameters else {}
        found = self.function(**trial.parameters, **more, seed=trial.seed)
        if not isinstance(found, Mapping) or not found:
            raise ShapeError("result", found, "expected names of metrics to numbers")
        for name in metrics:
            validation.one_of("metrics", name, [str(key) for key in found])
        arrays: dict[str, np.ndarray] = {}
        for name in metrics or tuple(map(str, found)):
            arrays[name] = validation.real_array(f"result.{name}", found[name], finite=False)
            if arrays[name].ndim > 1:
                raise ShapeError(f"result.{name}", found[name], "expected a number, or one for each row")
        rows = max((len(a) for a in arrays.values() if a.ndim), default=1)
        if any(a.ndim and len(a) != rows for a in arrays.values()):
            raise ShapeError("result", {n: a.shape for n, a in arrays.items()}, "expected arrays of one length")
        return {
            name: [x if math.isfinite(x) else None for x in np.broadcast_to(a, (rows,)).tolist()]
            for name, a in arrays.items()
        }


@functools.lru_cache(maxsize=16)
def _function(name: str, source: str) -> Callable[..., Mapping[str, Any]]:
    place, colon, wanted = name.rpartition(":")
    try:
        if source:
            module = types.ModuleType(f"wbc_study_{hashlib.sha256(source.encode()).hexdigest()[:16]}")
            # Annotations and classes of the file are looked up by its module's name
            sys.modules[module.__name__] = module
            module.__dict__["__file__"] = place
            exec(compile(source, place, "exec"), module.__dict__)
        else:
            module = importlib.import_module(place if colon else "wbc.study.scenarios")
    except (ImportError, SyntaxError, NameError, ValueError) as error:
        raise RobotFileError("scenario", name, " ".join(str(error).split())) from error
    functions = [n for n, value in vars(module).items() if inspect.isfunction(value)]
    if wanted not in functions:
        raise UnknownNameError("scenario", wanted, functions)
    found: Callable[..., Mapping[str, Any]] = getattr(module, wanted)
    return found
