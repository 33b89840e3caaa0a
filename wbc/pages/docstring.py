"""What a class says of itself: summary, formula, and the entries of its sections."""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass

from wbc.errors import WbcError

#: Headings of sections, each on a line of its own
HEADING = re.compile(r"(Attributes|Inputs|Example|Raises):")
#: ``name: text`` or ``name, other: text``
ENTRY = re.compile(r"(\w+(?:, \w+)*): (.*)")
#: A reference of Sphinx, with or without a tilde, and code in double quotes
REFERENCE = re.compile(r":\w+:`~?([^`]*)`")
CODE = re.compile(r"``([^`]*)``")


class PageError(WbcError):
    """A page, or the docstring that it is made from, lacks something."""


@dataclass(frozen=True)
class Docstring:
    """The parts of a docstring, as Markdown.

    Attributes:
        opening: everything up to the end of the first indented block, which is the formula.
        attributes: of the section Attributes, name -> text.
        inputs: of the section Inputs, name -> text.
        other_inputs: first words of that section that belong to no name, "" for none.
    """

    opening: str
    attributes: dict[str, str]
    inputs: dict[str, str]
    other_inputs: str

    @property
    def summary(self) -> str:
        """The first sentence."""
        words = " ".join(self.opening.split("\n\n")[0].split())
        return re.split(r"(?<=[.:;]) ", words)[0].rstrip(".:;") + "."


def read(cls: type) -> Docstring:
    """The docstring of a class.

    Raises:
        PageError: there is none, or none with a formula.
    """
    lines = (inspect.getdoc(cls) or "").splitlines()
    where = f"{cls.__name__}.__doc__"
    opening = _opening(lines)
    if not opening:
        raise PageError(where, "", "expected a first sentence and a formula, indented by four")
    attributes, _ = _entries(_section(lines, "Attributes"))
    inputs, rest = inputs_of(cls)
    other = re.split(r"\. |, and", rest)[0].rstrip(".")
    return Docstring(opening, _resolved(attributes), inputs, other)


def inputs_of(cls: type) -> tuple[dict[str, str], str]:
    """The section Inputs of a class: name -> text, and what belongs to no name."""
    return _entries(_section((inspect.getdoc(cls) or "").splitlines(), "Inputs"))


def markdown(text: str) -> str:
    """Markup of docstrings as Markdown: references and code in single backquotes."""
    named = REFERENCE.sub(lambda m: f"`{m.group(1).rsplit('.', 1)[-1]}`", text)
    return CODE.sub(r"`\1`", named)


def _opening(lines: list[str]) -> str:
    """Text and formula; an indented line that follows an empty one within the formula belongs to it."""
    inside = False
    for k, line in enumerate(lines):
        if HEADING.fullmatch(line):
            return ""
        if line.startswith("    "):
            inside = True
        elif inside and line:
            return _joined(lines[:k])
    return _joined(lines) if inside else ""


def _joined(lines: list[str]) -> str:
    return "\n".join(line if line.startswith("    ") else markdown(line) for line in lines).strip()


def _section(lines: list[str], name: str) -> list[str]:
    """The indented lines under a heading, without their indentation."""
    if f"{name}:" not in lines:
        return []
    start = lines.index(f"{name}:") + 1
    end = next((k for k in range(start, len(lines)) if lines[k] and not lines[k].startswith(" ")), len(lines))
    return inspect.cleandoc("\n" + "\n".join(lines[start:end])).splitlines()


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
