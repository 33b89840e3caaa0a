"""The declared part of a page: formula, fields, run-time inputs and rows, as Markdown."""

from __future__ import annotations

import inspect
import itertools
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc.pages import docstring
from wbc.pages.docstring import Docstring, PageError
from wbc.stack.declaration import Declaration, Entry
from wbc.stack.layout import Block, Layout
from wbc.tasks.base import Constraint, Input, Item, Task

#: Letters that a list of rows may take; of a longer one only the first and the last are named
LISTED = 120
#: Types of fields as a reader would say them, the longer names first
TYPES = {
    "tuple[float, float, float]": "3 numbers",
    "tuple[float, ...]": "numbers",
    "tuple[Triple, ...]": "rows of 3 numbers",
    "tuple[str, ...]": "names",
    "tuple[tuple[str, str], ...]": "pairs of names",
    "tuple[Wheel, ...]": "`Wheel` or several",
    "Callable[[Tracer, Values], Any]": "function",
    "Sequence[Mapping[str, float]]": "several",
    "Mapping[str, float]": "mapping of names to numbers",
    "Sequence[float]": "numbers",
    "Iterable[float]": "numbers",
    "Iterable[str]": "names",
    "Iterable[Input]": "`Input` or several",
    "Sequence[Convex]": "`Convex` parts",
    "LimitValues": "number or numbers or None",
    "Triple": "3 numbers",
    "float": "number",
    "bool": "True or False",
    "str": "text",
    "int": "whole number",
}
#: Where a text on an input says its first value; the column of defaults has it then
DEFAULT = re.compile(r"[.;]? Default:? ((?:[^.]|\.(?=\S))*)\.?")
STATED = re.compile(r"-?\d+(?:\.\d+)?")
#: Inputs that every item has, or every one of a form
COMMON = {
    "gain": "the error decays like exp(-gain t) where nothing hinders it",
    "rate": "h decays no faster than exp(-rate t)",
    "weight": "of all rows, against those of other tasks",
    "enabled": "False: as if it were not there",
}
MASK = {"task": "one number a row, multiplies its weight", "other": "one number a row: 1 on, 0 off"}
#: What a constraint is made of, by form
FORMS = {
    "margins": "h >= 0 is kept by dh/dq v + dh/dt >= -rate h",
    "rows": "lower <= A v <= upper",
    "bounds": "lower <= v <= upper",
}
ORDER = ("actuator limits", "joint positions", "holds", "margins", "soft")


def declared(cls: type[Item], stack: Declaration, entry: Entry) -> str:
    """The section for a class; rows and defaults are those of an item in a stack.

    Raises:
        PageError: the docstring lacks a formula, a field or an input.
    """
    text = docstring.read(cls)
    block = Layout(stack).blocks[entry.name]
    parts = [text.opening, _kind(entry.item, block), _fields(cls, text), _inputs(cls, text, block), _rows(stack, block)]
    return "\n\n".join(part for part in parts if part)


def _kind(item: Item, block: Block) -> str:
    if isinstance(item, Task):
        rows = "J v + de/dt = -gain e, in the least-squares sense"
        derived = type(item).jacobian is Task.jacobian
        return f"A task: {rows}, {'J = de/dq' if derived else 'with rows J that the class states itself'}."
    assert isinstance(item, Constraint)
    rows = "equalities on v" if item.equality and block.form == "rows" else FORMS[block.form]
    return f"A constraint: {rows}. In the order of sacrifice it stands with {ORDER[item.order]}, {item.order} of 4."


def _fields(cls: type[Item], text: Docstring) -> str:
    rows: list[tuple[tuple[str, ...], list[str]]] = []
    for name, parameter in inspect.signature(cls).parameters.items():
        meaning = text.attributes.get(name, "")
        if name == "gain" and issubclass(cls, Task):
            assert not meaning
            meaning = f"first value of the input `gain` [1/s]; None: {cls.default_gain:g}"
        if not meaning:
            raise PageError(f"{cls.__name__}.__doc__", name, "no text for this field under Attributes")
        required = parameter.default is inspect.Parameter.empty
        default = "required" if required else _default(parameter.default)
        row = (_type(str(parameter.annotation)), default, _without_stop(meaning))
        # Fields that a docstring describes together stay together
        if rows and rows[-1][0] == row:
            rows[-1][1].append(f"`{name}`")
        else:
            rows.append((row, [f"`{name}`"]))
    return _table(("Field", "Type", "Default", "Meaning"), [(", ".join(names), *row) for row, names in rows])


def _type(annotation: str) -> str:
    words = annotation
    for name, said in TYPES.items():
        words = words.replace(name, said)
    if words.startswith("Literal["):
        return " or ".join(f"`{choice}`" for choice in words[8:].split("]")[0].replace("'", '"').split(", "))
    return words.replace(" | None", " or None").replace(" | ", " or ")


def _default(value: Any) -> str:
    if isinstance(value, tuple) and value:
        return f"({', '.join(f'{number:g}' for number in value)})"
    if isinstance(value, float):
        return f"{value:g}"
    return f'`"{value}"`' if isinstance(value, str) else f"{value}"


def _without_stop(text: str) -> str:
    return text if text.endswith("..") else text.removesuffix(".")


def _inputs(cls: type[Item], text: Docstring, block: Block) -> str:
    rows = []
    sensed = [slot.input for slot in block.slots.values() if slot.input.sensed]
    for name, slot in block.slots.items():
        if slot.input.sensed:
            continue
        common = name in COMMON and name not in text.inputs
        meaning = COMMON[name] if common else text.inputs.get(name, text.other_inputs)
        if not meaning:
            raise PageError(f"{cls.__name__}.__doc__", name, "no text for this input under Inputs")
        meaning, default = _first_value(cls, slot.input, meaning)
        rate = f"`{slot.input.rate}`" if slot.input.rate else "-"
        numbers = f"{slot.size}" if slot.input.kind == "vector" else f"{slot.input.kind} ({slot.size})"
        limits = "above 0, at most 1/dt" if common and name == "rate" else _range(slot.input)
        rows.append((f"`{name}`", numbers, slot.input.unit or "1", default, limits, rate, meaning))
    task = block.form == "task"
    if task:
        rows.append(("`weight`", "1", "1", "that of `stack.add`", ">= 0", "-", COMMON["weight"]))
    rows.append(("`enabled`", "flag", "-", "True", "-", "-", COMMON["enabled"]))
    limits, meaning = (">= 0", MASK["task"]) if task else ("0 or 1", MASK["other"])
    rows.append(("`mask`", f"{len(block.rows)}", "1", "1", limits, "-", meaning))
    out = _table(("Input", "Numbers", "Unit", "Default", "Range", "Its rate", "Meaning"), rows)
    if sensed:
        names = ", ".join(f"`{d.name}`" for d in sensed)
        out += f"\n\nMeasured before every tick and only read: {names} of {sensed[0].size} rows."
    return out


def _first_value(cls: type[Item], declared: Input, meaning: str) -> tuple[str, str]:
    """(meaning without its words on the default, default)."""
    said = DEFAULT.search(meaning)
    rest = _without_stop(DEFAULT.sub("", meaning))
    number = _number(declared)
    if said and STATED.fullmatch(said.group(1)) and float(said.group(1)) != float(number or "nan"):
        reason = f"the docstring says that its default is {said.group(1)}, and it is {number or declared.default}"
        raise PageError(f"{cls.__name__}.__doc__", declared.name, reason)
    if declared.name in inspect.signature(cls).parameters:
        return _without_stop(meaning), f"field `{declared.name}`"
    if declared.default is None:
        return rest, said.group(1) if said else "at the first step"
    return rest, number if number or said is None else said.group(1)


def _number(declared: Input) -> str:
    """A default as one number or pose, "" for any other."""
    if declared.kind == "pose":
        numbers = np.asarray(getattr(declared.default, "homogeneous", declared.default))
        return "identity" if numbers.shape == (4, 4) and (numbers == np.eye(4)).all() else ""
    numbers = np.unique(np.asarray(declared.default, dtype=np.float64))
    return f"{numbers[0]:g}" if numbers.size == 1 else ""


def _range(declared: Input) -> str:
    low, high = declared.low, declared.high
    words = []
    if math.isfinite(low) and math.isfinite(high):
        words.append(f"{low:g} to {high:.4g}")
    elif math.isfinite(low):
        words.append(f">= {low:g}")
    elif math.isfinite(high):
        words.append(f"<= {high:g}")
    if declared.below is not None:
        words.append(f"<= `{declared.below}`")
    if declared.infinite is not None:
        words.append(f"{declared.infinite:g}: no limit")
    if declared.direction:
        words.append("not 0, made a unit vector")
    return ", ".join(words) or "-"


def _rows(stack: Declaration, block: Block) -> str:
    rows = block.rows
    count = f"{len(rows)} rows" if len(rows) > 1 else "One row"
    where = f"{count} for `{block.entry.name}` of the example below, on {stack.robot.name}"
    if len(rows) > 2 and sum(len(row.label) + 4 for row in rows) > LISTED:
        return f"{where}: `{rows[0].label}` [{rows[0].unit}] to `{rows[-1].label}` [{rows[-1].unit}]."
    groups = []
    for unit, group in itertools.groupby(rows, key=lambda row: row.unit):
        groups.append(f"{', '.join(f'`{row.label}`' for row in group)} [{unit}]")
    return f"{where}: {'; '.join(groups)}."


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    if not rows:
        return ""
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)
