"""What a study says: scenario, parameters, seeds and metrics, as a schema that Python and YAML share."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import yaml
from pydantic import ConfigDict, Field, StrictBool, StrictFloat, StrictInt, StrictStr, ValidationError
from pydantic.dataclasses import dataclass

from wbc import validation
from wbc.errors import RobotFileError, UnknownNameError, WbcError
from wbc.study.scenario import Scenario, StudyTrial, Value

#: Most trials of a study, and most values of a parameter
MOST = 10**6

_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


class StudyError(WbcError):
    """A study that does not follow the schema: ``field`` says where, ``value`` what stands there."""


@dataclass(frozen=True, config=_STRICT)
class Evenly:
    """Evenly spaced values: first, last, and how many."""

    low: StrictFloat | StrictInt
    high: StrictFloat | StrictInt
    count: Annotated[StrictInt, Field(ge=2, le=MOST)]

    def values(self) -> tuple[float, ...]:
        """All of them."""
        return tuple(float(x) for x in np.linspace(self.low, self.high, self.count))


_Value = StrictBool | StrictInt | StrictFloat | StrictStr


@dataclass(frozen=True, config=_STRICT)
class _Content:
    """What a file may hold."""

    scenario: StrictStr
    parameters: dict[StrictStr, _Value | Annotated[tuple[_Value, ...], Field(min_length=1)] | Evenly] = Field(
        default_factory=dict
    )
    seeds: Annotated[StrictInt, Field(ge=1, le=MOST)] | Annotated[tuple[StrictInt, ...], Field(min_length=1)] = 1
    metrics: tuple[StrictStr, ...] = ()


class Study:
    """Trials of a scenario: every combination of the parameters' values with every seed.

        Study(scenario="reach", parameters={"robot": ["panda", "ur5"], "poses": 1000}, seeds=20, metrics=["reached"])

    Args:
        scenario: a built-in name, ``module:function`` or ``file.py:function``, see :class:`Scenario`.
        parameters: name -> a value, a list of values, or ``{low, high, count}``; others keep their defaults.
        seeds: how many, counted from 0, or a list.
        metrics: which of the scenario's results are kept; none: all.
        beside: folder that a relative ``file.py`` is looked for in.

    Raises:
        StudyError: what does not follow the schema, with the place and the value. UnknownNameError: no such scenario,
            parameter or metric. RobotFileError: a file that cannot be read.
    """

    def __init__(self, beside: Path | None = None, **content: Any) -> None:
        try:
            self.content = _Content(**content)
        except ValidationError as error:
            raise _explained(error) from None
        self.scenario = Scenario(self.content.scenario, beside)
        known, needed = self.scenario.parameters, self.scenario.needed
        self._values: dict[str, tuple[Value, ...]] = {}
        for name, given in self.content.parameters.items():
            field = f"parameters.{name}"
            if name not in known:
                raise UnknownNameError(field, name, known)
            values = given.values() if isinstance(given, Evenly) else given if isinstance(given, tuple) else (given,)
            self._values[name] = tuple(self.scenario.checked(field, name, value) for value in values)
        for name in needed:
            if name not in self._values:
                raise StudyError(f"parameters.{name}", None, "has no default and must be given")
        for name in self.content.metrics:
            if self.scenario.metrics:
                validation.one_of("metrics", name, self.scenario.metrics)
        seeds = self.content.seeds
        self.seeds = tuple(range(seeds)) if isinstance(seeds, int) else tuple(dict.fromkeys(seeds))
        for seed in self.seeds:
            validation.integer("seeds", seed, 0, 2**63 - 1)
        self.count = len(self.seeds) * int(np.prod([len(v) for v in self._values.values()], dtype=object))
        if self.count > MOST:
            raise StudyError("parameters", self.count, f"there are more than {MOST} trials")

    @property
    def metrics(self) -> tuple[str, ...]:
        """Results that are kept; none: all."""
        return self.content.metrics

    @property
    def varied(self) -> tuple[str, ...]:
        """Parameters of several values."""
        return tuple(name for name, values in self._values.items() if len(values) > 1)

    def trials(self) -> Iterator[StudyTrial]:
        """All trials; the last parameter changes fastest, seeds before it."""
        for values in itertools.product(*self._values.values()):
            for seed in self.seeds:
                yield StudyTrial(dict(zip(self._values, values, strict=True)), seed)

    def data(self) -> dict[str, Any]:
        """What :meth:`read` takes."""
        out: dict[str, Any] = json.loads(json.dumps(asdict(self.content)))
        return out | {"scenario": self.scenario.name}

    @classmethod
    def read(cls, path: str | Path, seeds: int | None = None) -> Study:
        """A study from a YAML file, with other seeds than the file's where they are given.

            scenario: reach                  # built in; or module:function, or file.py:function
            parameters:
              robot: [panda, ur5]
              poses: 1000
              radius: {low: 0.5, high: 1.0, count: 3}
            seeds: 20
            metrics: [x, y, z, reached]

        Raises:
            RobotFileError: no such file, or no YAML. StudyError, UnknownNameError: another content.
        """
        path = validation.file_path("study", path)
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
        except FileNotFoundError as error:
            raise RobotFileError("study", str(path), validation.no_such(path)) from error
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            raise RobotFileError("study", str(path), " ".join(str(error).split())) from error
        if not isinstance(content, dict):
            raise StudyError("study", content, "expected a mapping with a scenario")
        content = {str(key): value for key, value in content.items()}
        if "beside" in content:
            raise UnknownNameError("beside", content["beside"], _names(_Content))
        return cls(beside=path.resolve().parent, **content | ({} if seeds is None else {"seeds": seeds}))


def _names(kind: type[Any]) -> tuple[str, ...]:
    return tuple(one.name for one in fields(kind))


def _explained(error: ValidationError) -> WbcError:
    """The first thing that is wrong, by its place."""
    unknown = ("extra_forbidden", "unexpected_keyword_argument")
    first = min(error.errors(), key=lambda one: one["type"] not in unknown)
    if first["type"] in unknown:
        # A union adds names of types to the place
        owner, name = ".".join(map(str, first["loc"][:2])), first["loc"][-1]
        if len(first["loc"]) == 1:
            return UnknownNameError(str(name), name, _names(_Content))
        return UnknownNameError(owner, name, _names(Evenly))
    place = [str(part) for part in first["loc"]][: 2 if first["loc"][0] == "parameters" else 1]
    expected = {
        "seeds": "expected a number of seeds of at least 1, or a list of them",
        "parameters": "expected a value, a list of values, or {low, high, count}",
    }
    reason = expected.get(place[0], first["msg"].lower())
    return StudyError(".".join(place), first["input"], reason)
