"""What a class says of itself: summary, formula, text, example, and the entries of its sections."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass

from wbc.errors import WbcError

#: Headings of sections, each on a line of its own
HEADING = re.compile(r"(Attributes|Inputs|Example|Raises):")
#: What the paragraph on limits begins with
CANNOT = "What it cannot do: "
#: ``name: text`` or ``name, other: text``
ENTRY = re.compile(r"(\w+(?:, \w+)*): (.*)")
#: A reference of Sphinx, with or without a tilde, and code in double quotes
REFERENCE = re.compile(r":\w+:`~?([^`]*)`")
CODE = re.compile(r"``([^`]*)``")


class PageError(WbcError):
    """A docstring that a page is made from lacks something."""


@dataclass(frozen=True)
class Docstring:
    """The parts of a docstring, as Markdown.

    Attributes:
        opening: everything up to the end of the first indented block, which is the formula.
        text: what stands in no section.
        cannot: the paragraph "What it cannot do", without these words.
        attributes: of the section Attributes, name -> text.
        inputs: of the section Inputs, name -> text.
        other_inputs: first words of that section that belong to no name, "" for none.
        example: Python.
    """

    opening: str
    text: str
    cannot: str
    attributes: dict[str, str]
    inputs: dict[str, str]
    other_inputs: str
    example: str

    @property
    def summary(self) -> str:
        """The first sentence."""
        words = " ".join(self.opening.split("\n\n")[0].split())
        return re.split(r"(?<=[.:;]) (?![^(]*\))", words)[0].rstrip(".:;,") + "."


def read(cls: type) -> Docstring:
    """The docstring of a class.

    Raises:
        PageError: there is none, or none with a formula.
    """
    lines = (inspect.getdoc(cls) or "").splitlines()
    start = _end_of_formula(lines)
    if not start:
        raise PageError(f"{cls.__name__}.__doc__", "", "expected a first sentence and a formula, indented by four")
    sections, free = _sections(lines[start:])
    paragraphs = re.split(r"\n{2,}(?! )", "\n".join(free).strip())
    cannot = [" ".join(one.removeprefix(CANNOT).split()) for one in paragraphs if one.startswith(CANNOT)]
    text = "\n\n".join(one for one in paragraphs if not one.startswith(CANNOT))
    attributes, _ = _entries(sections.get("Attributes", []))
    inputs, rest = inputs_of(cls)
    return Docstring(
        opening=_shown("\n".join(lines[:start])),
        text=_shown(text),
        cannot="".join(f"{one[0].upper()}{one[1:]}" for one in map(markdown, cannot)),
        attributes=_resolved(attributes),
        inputs=inputs,
        other_inputs=re.split(r"\. |, and", rest)[0].rstrip("."),
        example="\n".join(line[4:] for line in sections.get("Example", [])),
    )


def inputs_of(cls: type) -> tuple[dict[str, str], str]:
    """The section Inputs of a class: name -> text, and what belongs to no name."""
    sections, _ = _sections((inspect.getdoc(cls) or "").splitlines())
    return _entries(sections.get("Inputs", []))


def markdown(text: str) -> str:
    """Markup of docstrings as Markdown: references and code in single backquotes."""
    named = REFERENCE.sub(lambda m: f"`{m.group(1).rsplit('.', 1)[-1]}`", text)
    return CODE.sub(r"`\1`", named)


def prose(text: str, change: Callable[[str], str]) -> str:
    """The text with its lines changed, but for indented ones, which are formulas."""
    return "\n".join(line if line.startswith("    ") else change(line) for line in text.split("\n"))


def _end_of_formula(lines: list[str]) -> int:
    """Lines up to the end of the first indented block, 0 for none; an empty line within it belongs to it."""
    inside = False
    for k, line in enumerate(lines):
        if HEADING.fullmatch(line):
            return k if inside else 0
        if line.startswith("    "):
            inside = True
        elif inside and line:
            return k
    return len(lines) if inside else 0


def _shown(text: str) -> str:
    return prose(text, markdown).strip()


def _sections(lines: list[str]) -> tuple[dict[str, list[str]], list[str]]:
    """The indented lines under each heading, without their indentation, and the lines under none."""
    sections: dict[str, list[str]] = {}
    free: list[str] = []
    into = free
    for line in lines:
        if HEADING.fullmatch(line):
            into = sections.setdefault(line[:-1], [])
        elif into is not free and line and not line.startswith(" "):
            into = free
            into.append(line)
        else:
            into.append(line)
    return {name: inspect.cleandoc("\n" + "\n".join(held)).splitlines() for name, held in sections.items()}, free


def _entries(lines: list[str]) -> tuple[dict[str, str], str]:
    """Texts by name, and what stands under no name."""
    found: list[tuple[list[str], list[str]]] = []
    rest: list[str] = []
    for line in lines:
        entry = ENTRY.fullmatch(line)
        if entry is not None:
            found.append((entry.group(1).split(", "), [entry.group(2)]))
        elif line.startswith(" ") and found:
            found[-1][1].append(line.strip())
        else:
            rest.append(line.strip())
    texts = {name: markdown(" ".join(words)) for names, words in found for name in names}
    return texts, markdown(" ".join(rest)).strip()


def _resolved(attributes: dict[str, str]) -> dict[str, str]:
    """``others: as in :class:`wbc.tasks.Name``` stands for the attributes of that class."""
    reference = re.fullmatch(r"as in `(\w+)`\.?", attributes.get("others", ""))
    if reference is None:
        return attributes
    from wbc.tasks import registry

    own = {name: text for name, text in attributes.items() if name != "others"}
    return read(registry()[reference.group(1)]).attributes | own
