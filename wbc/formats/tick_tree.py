"""Columns of a run as nested objects of JSON, and their schema."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

#: Members of a group that keep their names in each tick, at most
NAMED = 3


def schema_of(example: Any, title: str = "") -> dict[str, Any]:
    """The schema of messages such as an example, of which nothing is empty."""
    if isinstance(example, dict):
        made = {"type": "object", "properties": {key: schema_of(part) for key, part in example.items()}}
        return made | ({"title": title} if title else {})
    if isinstance(example, list):
        return {"type": "array", "items": schema_of(example[0])}
    return {"type": {bool: "boolean", int: "integer", float: "number", str: "string"}[type(example)]}


class TickTree:
    """A run's columns ``group.member`` as nested objects.

    Where more than :data:`NAMED` members stand alone beside each other they are an array, as names would take a third
    of a file: the schema says which is which.

    Attributes:
        names: columns in the order of the numbers of a tick. schema: of its messages.

    Args:
        units: column -> unit. apart: columns that are left out.
    """

    def __init__(self, units: Mapping[str, str], apart: Collection[str] = ()) -> None:
        self.names, self._units, self._shapes = list[str](), units, dict[str, Any]()
        self.schema = schema_of({"status": ""}, "wbc.Tick")
        for key, members in by_first({name: name for name in units if name not in apart}).items():
            self.schema["properties"][key], self._shapes[key] = self._laid_out(members)

    def _laid_out(self, members: dict[str, str]) -> tuple[dict[str, Any], Any]:
        """(schema, shape) of columns by the rests of their names; a shape is a place, a slice, or shapes by key."""
        begin = len(self.names)
        if members.keys() == {""}:
            self.names.append(members[""])
            unit = self._units[members[""]]
            return schema_of(0.0) | ({"description": f"[{unit}]"} if unit else {}), begin
        parts = by_first(members)
        if len(parts) > NAMED and all(below.keys() == {""} for below in parts.values()):
            columns = {key: below[""] for key, below in parts.items()}
            self.names += columns.values()
            said = [f"{key} [{unit}]" if (unit := self._units[name]) else key for key, name in columns.items()]
            return schema_of([0.0]) | {"description": ", ".join(said)}, slice(begin, len(self.names))
        laid_out = {key: self._laid_out(below) for key, below in parts.items()}
        schemas = {key: schema for key, (schema, _) in laid_out.items()}
        return {"type": "object", "properties": schemas}, {key: shape for key, (_, shape) in laid_out.items()}

    def tick(self, numbers: list[float]) -> dict[str, Any]:
        """The message of a tick, from its numbers in the order of :attr:`names`."""
        return {key: _filled(shape, numbers) for key, shape in self._shapes.items()}


def by_first(members: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """First part of a name -> rest of the name -> column. A column may be called as what others begin with."""
    out: dict[str, dict[str, str]] = {}
    for name, column in members.items():
        first, _, rest = name.partition(".")
        out.setdefault(first, {})[rest] = column
    return out


def _filled(shape: Any, numbers: list[float]) -> Any:
    if isinstance(shape, dict):
        return {key: _filled(below, numbers) for key, below in shape.items()}
    return numbers[shape]
