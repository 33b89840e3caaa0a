"""Reading the table of robots: TOML files, one a family, checked against the fields of :class:`Recipe`.

A file holds one TOML table for each robot:

    [panda]
    about = "..."                      text
    file = "folder/file.urdf"          below the wheel's folder ``robots``
    base = "fixed"                     fixed | floating | planar | differential
    lock = ["finger_*"]                joints to lock, or a table joint = value
    srdf = "folder/file.srdf"          collision rules, rotors; with state = "name" also the neutral configuration
    neutral = { joint = 1.0 }          rad or m, on top of it
    frames = { tip = "frame" }         role = frame
    acceleration = { joint = 15.0 }    rad/s^2 or m/s^2, needs ``source``
    source = "..."                     where the acceleration limits were published
    mimic_leaders = { joint = "joint"} corrections of misspelt leaders
    pairs = "pairs/file.toml"          below this folder, needs ``shapes``: pairs of links that must not touch
    problem = "..."                    why the file cannot be loaded
    shapes = [{ link = "...", a = [x, y, z], b = [x, y, z], radius = r, excess = e }]
"""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from typing import Any

from wbc import validation
from wbc.errors import DuplicateNameError, RangeError, RobotFileError, ShapeError, UnknownNameError
from wbc.robot.recipe import LinkShape, Recipe, lock_mapping
from wbc.robot.robot import BASES


def read_table(folder: pathlib.Path) -> dict[str, Recipe]:
    """All robots in the ``.toml`` files of a folder, by name.

    Raises:
        RobotFileError: a file that is no TOML.
        UnknownNameError, ShapeError, RangeError, DuplicateNameError: a row that breaks the schema.
    """
    table: dict[str, Recipe] = {}
    for path, text in _files(folder):
        for name, row in _rows(path, text).items():
            if name in table:
                raise DuplicateNameError(f"{path.name}", name, "a robot of this name exists")
            table[name] = read_row(f"{path.name} [{name}]", name, row)
    return table


def read_robot(folder: pathlib.Path, name: str) -> Recipe | None:
    """One robot of the ``.toml`` files of a folder; None where they have no robot of that name. Only the file that has
    a line ``[name]`` is parsed, which takes a fifth of the time of :func:`read_table`.

    Raises:
        as of :func:`read_table`.
    """
    for path, text in _files(folder):
        if f"\n[{name}]\n" in f"\n{text}\n" and name in (rows := _rows(path, text)):
            return read_row(f"{path.name} [{name}]", name, rows[name])
    return None


def _files(folder: pathlib.Path) -> Iterator[tuple[pathlib.Path, str]]:
    for path in sorted(folder.glob("*.toml")):
        try:
            yield path, path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise RobotFileError("table", str(path), f"cannot be read: {error}") from error


def _rows(path: pathlib.Path, text: str) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RobotFileError("table", str(path), f"cannot be read: {error}") from error


def read_row(where: str, name: str, row: Any) -> Recipe:
    """One robot of the table; see the module for its fields.

    Raises:
        UnknownNameError: a field or a base that does not exist.
        ShapeError: a value of the wrong type, or a field that must be there and is not.
        RangeError: an acceleration limit or a radius below 0, or an acceleration without its source.
    """
    if not isinstance(row, Mapping):
        raise ShapeError(where, row, "expected a table")
    known = {f.name for f in fields(Recipe)} - {"name"}
    values: dict[str, Any] = {}
    for key, value in row.items():
        label = f"{where} {key}"
        if key not in known:
            raise UnknownNameError(where, key, known)
        reader: Callable[[str, Any], Any] = _READERS.get(key, _text)
        values[key] = reader(label, value)
    recipe = Recipe(name, **values)
    if not recipe.file:
        raise ShapeError(f"{where} file", None, "this field must be there")
    if bool(recipe.acceleration) != bool(recipe.source):
        raise RangeError(f"{where} source", recipe.source, "acceleration and source come together or not at all")
    if recipe.state and not recipe.srdf:
        raise RangeError(f"{where} state", recipe.state, "a state needs its srdf")
    if recipe.pairs and not recipe.shapes:
        raise RangeError(f"{where} pairs", recipe.pairs, "pairs are found with shapes of the table, and need them")
    return recipe


def _text(label: str, value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ShapeError(label, value, "expected a non-empty text")
    return value


def _base(label: str, value: Any) -> str:
    return validation.one_of(label, value, BASES)


def _texts(label: str, value: Any) -> dict[str, str]:
    if not isinstance(value, Mapping):
        raise ShapeError(label, value, "expected a table of texts")
    return {str(k): _text(f"{label}.{k}", v) for k, v in value.items()}


def _numbers(label: str, value: Any) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise ShapeError(label, value, "expected a table of numbers")
    return {str(k): validation.scalar(f"{label}.{k}", v) for k, v in value.items()}


def _limits(label: str, value: Any) -> dict[str, float]:
    return {k: validation.scalar(f"{label}.{k}", v, low=0.0) for k, v in _numbers(label, value).items()}


def _lock(label: str, value: Any) -> dict[str, float | None]:
    return lock_mapping(value)


def _shapes(label: str, value: Any) -> tuple[LinkShape, ...]:
    if not isinstance(value, list):
        raise ShapeError(label, value, "expected a list of shapes")
    out = []
    for i, item in enumerate(value):
        if not isinstance(item, Mapping) or not {"link", "a", "b", "radius"} <= set(item):
            raise ShapeError(f"{label}[{i}]", item, "expected link, a, b, radius and excess")
        for key in item:
            validation.one_of(f"{label}[{i}]", key, ("link", "a", "b", "radius", "excess"))
        a, b = (tuple(validation.real_array(f"{label}[{i}].{k}", item[k], (3,)).tolist()) for k in ("a", "b"))
        numbers = [validation.scalar(f"{label}[{i}].{k}", item.get(k, 0.0), low=0.0) for k in ("radius", "excess")]
        out.append(LinkShape(_text(f"{label}[{i}].link", item["link"]), a, b, *numbers))
    return tuple(out)


_READERS: dict[str, Callable[[str, Any], Any]] = {
    "base": _base,
    "lock": _lock,
    "neutral": _numbers,
    "frames": _texts,
    "acceleration": _limits,
    "mimic_leaders": _texts,
    "shapes": _shapes,
}
