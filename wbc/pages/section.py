"""A page: formula, fields and run-time inputs, rows, text, example and limits, as Markdown."""

from __future__ import annotations

import inspect
import itertools
import math
import re
from typing import Any

import numpy as np

from wbc.pages.docstring import Docstring, PageError
from wbc.stack.declaration import Declaration, Entry
from wbc.stack.layout import Block, Layout, Slot
from wbc.tasks import registry
from wbc.tasks.base import Constraint, Input, Item, Task

#: Letters that a list of rows may take; of a longer one only the first and the last are named
LISTED = 60
#: Types of fields as a reader would say them, the longer names first
TYPES = {
    "tuple[float, float, float]": "3 numbers",
    "tuple[float, float]": "2 numbers",
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
#: Inputs that the index of the pages explains
COMMON = ("gain", "rate", "weight", "enabled", "mask")
#: What a field says that is the first value of an input of its name
FIRST = re.compile(r"(?:(?:first|initial) values? of the inputs?(?: `\w+`)?(?: \[[^]]*\])?|the same)[;:,.]? ?")
#: Words up to which a text is repeated
SHORT = 3


def page(cls: type[Item], text: Docstring, stack: Declaration, entry: Entry) -> str:
    """The page of a class; rows and defaults are those of an item in a stack.

    Raises:
        PageError: the docstring lacks a field, an input, an example or what the item cannot do.
    """
    if not text.cannot:
        raise PageError(f"{cls.__name__}.__doc__", "", "no paragraph that begins with 'What it cannot do: '")
    block = Layout(stack).blocks[entry.name]
    parts = [
        f"# {cls.__name__}",
        text.opening,
        text.text,
        _names(cls, text, block),
        _every(entry.item, block, text),
        f"```python\n{text.example}\n```",
        f"## What it cannot do\n\n{text.cannot}",
    ]
    return "\n\n".join(part for part in parts if part)


def _names(cls: type[Item], text: Docstring, block: Block) -> str:
    """A list of fields and run-time inputs, one entry for what is both; what several share is said once."""
    slots = {name: slot for name, slot in block.slots.items() if not slot.input.sensed}
    entries: list[tuple[tuple[str, str], list[str]]] = []
    said: dict[str, str] = {}
    elsewhere: list[str] = []
    for name, parameter in inspect.signature(cls).parameters.items():
        meaning = text.attributes.get(name, "")
        if name == "gain" and issubclass(cls, Task):
            assert not meaning
            continue
        if not meaning:
            raise PageError(f"{cls.__name__}.__doc__", name, "no text for this field under Attributes")
        if name in text.borrowed:
            other = inspect.signature(registry()[text.others]).parameters[name]
            if other != parameter.replace(kind=other.kind):
                raise PageError(
                    f"{cls.__name__}.__doc__", name, f"it is {parameter}, and that of {text.others} {other}"
                )
            elsewhere.append(name)
            slots.pop(name, None)
            continue
        kind, meaning = _type(str(parameter.annotation)), _without_stop(meaning)
        if name in slots:
            kind, _, told = _input(cls, text, slots.pop(name), said)
            first = _once(FIRST.sub("", meaning, count=1), name, said)
            meaning = "; ".join([told, first] if told and first and not told.startswith(first) else [told or first])
        required = parameter.default is inspect.Parameter.empty
        left_out = required or (parameter.default is None and kind.endswith("or None"))  # the type has said it
        about = (kind if left_out else f"{kind}, default {_default(parameter.default)}", meaning)
        # Fields that a docstring describes together stay together
        if entries and entries[-1][0] == about:
            entries[-1][1].append(name)
        else:
            entries.append((about, [name]))
    for name, slot in slots.items():
        if name in text.borrowed:
            elsewhere.append(name)
        elif name not in COMMON or name in text.inputs:
            kind, default, meaning = _input(cls, text, slot, said)
            entries.append(((f"{kind}, default {default}", meaning), [name]))
    lines = [f"- {', '.join(f'`{name}`' for name in names)} ({kind}): {meaning}" for (kind, meaning), names in entries]
    if elsewhere:
        lines.append(f"- {', '.join(f'`{name}`' for name in elsewhere)}: as in `{text.others}`")
    return "\n".join(line if line.endswith(".") else f"{line}." for line in lines)


def _once(meaning: str, name: str, said: dict[str, str]) -> str:
    """The text, or the name that has it already."""
    if len(meaning.split()) > SHORT and said.setdefault(meaning, name) != name:
        return f"as `{said[meaning]}`"
    return meaning


def _every(item: Item, block: Block, text: Docstring) -> str:
    """What the item is, what is measured, and the rows."""
    if isinstance(item, Task):
        task = "[task](README.md#every-item)"
        kind = f"A {task}" if type(item).jacobian is Task.jacobian else f"A {task} with a Jacobian of its own"
    else:
        assert isinstance(item, Constraint)
        form = "equalities" if item.equality and block.form == "rows" else block.form
        kind = f"A [constraint](README.md#every-item): {form}, order of sacrifice {item.order}"
    own = [name for name in ("gain", "rate") if name in block.slots and name not in text.inputs]
    first = "".join(f", `{name}` {_number(block.slots[name].input)} 1/s" for name in own)
    out = f"{kind}{first}."
    if sensed := [slot.input for slot in block.slots.values() if slot.input.sensed]:
        names = ", ".join(f"`{one.name}`" for one in sensed)
        out += f" Read-only, measured before every tick: {names}."
    return f"{out} {_rows(block)}".strip()


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


def _input(cls: type[Item], text: Docstring, slot: Slot, told: dict[str, str]) -> tuple[str, str, str]:
    """(numbers and unit, default, meaning)."""
    declared = slot.input
    meaning = text.inputs.get(declared.name, "" if declared.name in COMMON else text.other_inputs)
    if not meaning and declared.name not in COMMON:
        raise PageError(f"{cls.__name__}.__doc__", declared.name, "no text for this input under Inputs")
    meaning, default = _first_value(cls, declared, meaning)
    rate = f"its rate is `{declared.rate}`" if declared.rate else ""
    meaning = _once(meaning.replace(f" [{declared.unit}]", ""), declared.name, told)
    limits = _range(declared)
    said = "; ".join(part for part in (meaning, "" if limits in meaning else limits, rate) if part)
    numbers = ("number" if slot.size == 1 else f"{slot.size} numbers") if declared.kind == "vector" else declared.kind
    return f"input: {numbers} [{declared.unit or '1'}]", default, said


def _first_value(cls: type[Item], declared: Input, meaning: str) -> tuple[str, str]:
    """(meaning without its words on the default, default)."""
    said = DEFAULT.search(meaning)
    rest = _without_stop(". ".join(part.strip() for part in DEFAULT.split(meaning)[::2] if part.strip()))
    number = _number(declared)
    if said and STATED.fullmatch(said.group(1)) and float(said.group(1)) != float(number or "nan"):
        reason = f"the docstring says that its default is {said.group(1)}, and it is {number or declared.default}"
        raise PageError(f"{cls.__name__}.__doc__", declared.name, reason)
    if declared.name in inspect.signature(cls).parameters and not issubclass(cls, Task):
        return _without_stop(meaning), ""
    if declared.default is None:
        return rest, said.group(1) if said else "what it is at the first step"
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
    return ", ".join(words)


def _rows(block: Block) -> str:
    rows = block.rows
    if not rows:
        return ""
    where = f"{len(rows)} rows in the example" if len(rows) > 1 else "Row"
    if len(rows) > 2 and sum(len(row.label) + 4 for row in rows) > LISTED:
        return f"{where}: `{rows[0].label}` [{rows[0].unit}] to `{rows[-1].label}` [{rows[-1].unit}]."
    groups = []
    for unit, group in itertools.groupby(rows, key=lambda row: row.unit):
        groups.append(f"{', '.join(f'`{row.label}`' for row in group)} [{unit}]")
    return f"{where}: {'; '.join(groups)}."
