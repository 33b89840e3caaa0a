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
        others: the class that says what the ``borrowed`` attributes and inputs are, "" for none.
        example: Python.
    """

    opening: str
    text: str
    cannot: str
    attributes: dict[str, str]
    inputs: dict[str, str]
    other_inputs: str
    others: str
    borrowed: frozenset[str]
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
    own, _ = _entries(sections.get("Attributes", []))
    named, rest = _entries(_section(cls, "Inputs"))
    others = _others(own) or _others(named)
    attributes, inputs = _with_others(own, "Attributes"), inputs_of(cls)[0]
    kept = {*own, *named} - {"others"}
    return Docstring(
        opening=_shown("\n".join(lines[:start])),
        text=_shown(text),
        cannot="".join(f"{one[0].upper()}{one[1:]}" for one in map(markdown, cannot)),
        attributes=attributes,
        inputs=inputs,
        other_inputs=re.split(r"\. |, and", rest)[0].rstrip("."),
        others=others,
        borrowed=frozenset({*attributes, *inputs} - kept),
        example="\n".join(line[4:] for line in sections.get("Example", [])),
    )


def inputs_of(cls: type) -> tuple[dict[str, str], str]:
    """The section Inputs of a class: name -> text, and what belongs to no name."""
    named, rest = _entries(_section(cls, "Inputs"))
    return _with_others(named, "Inputs"), rest


def _section(cls: type, heading: str) -> list[str]:
    return _sections((inspect.getdoc(cls) or "").splitlines())[0].get(heading, [])


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


def _others(texts: dict[str, str]) -> str:
    """The class of ``others: as in :class:`wbc.tasks.Name```, "" for none."""
    reference = re.fullmatch(r"as in `(\w+)`\.?", texts.get("others", ""))
    return "" if reference is None else reference.group(1)


def _with_others(texts: dict[str, str], heading: str) -> dict[str, str]:
    """Texts by name; ``others`` stands for what that class has under the same heading."""
    if not (others := _others(texts)):
        return texts
    from wbc.tasks import registry

    own = {name: text for name, text in texts.items() if name != "others"}
    return _with_others(_entries(_section(registry()[others], heading))[0], heading) | own
