"""A command's options are the fields of a dataclass, read once: types, defaults, help and units.

A command is a dataclass with a method ``run``, which returns an exit code, or None. The help of a field is a text in
its annotation, ``Annotated[float, "Gain of the hand [1/s]."]``, or its lines under Attributes in the docstring of its
class. A field that is a dataclass itself, such as the request of a walk, brings its own fields along. Its metadata may
have another name for the command line, ``option``, and say that the place gives it and not the name, ``placed``.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Protocol, get_args, get_origin

import typer
from rich.markup import escape

from wbc.errors import ShapeError

#: A line under Attributes
ENTRY = re.compile(r"(\w+(?:, \w+)*): (.*)")
#: Markup of docstrings: references and code
MARKUP = re.compile(r":\w+:`~?(?:\w+\.)*(\w+)`|``([^`]*)``")
#: Types that are read as they are; what is none of them is a text, which its class reads
PLAIN = (bool, int, float, str, Path)


class ReadCommand(Protocol):
    """A dataclass of options."""

    def run(self) -> int | None:
        """Do it; the exit code, None for 0."""


@dataclasses.dataclass(frozen=True)
class Option:
    """What an annotation says of a field besides its type.

    Attributes:
        help: what it is, with its unit.
        placed: given by its place, not by its name.
        complete: what the shell proposes for it.
    """

    help: str
    placed: bool = False
    complete: Callable[..., Any] | None = None


class OptionField(NamedTuple):
    """One option of a command.

    Attributes:
        path: names of the fields that lead to it.
        name: on the command line and in errors, without dashes.
        kind: its type.
        default: of the field; MISSING where it has to be given.
        said: help and more.
        panel: the heading that it stands under.
    """

    path: tuple[str, ...]
    name: str
    kind: Any
    default: Any
    said: Option
    panel: str

    @property
    def key(self) -> str:
        """As the parser names it."""
        return "__".join(self.path)

    @property
    def one(self) -> Any:
        """Its type where something is given: that of a union with None; of any other union a text."""
        union = get_origin(self.kind) in (typing.Union, types.UnionType)
        members = [kind for kind in (get_args(self.kind) if union else (self.kind,)) if kind is not type(None)]
        return members[0] if len(members) == 1 else str

    @property
    def choices(self) -> tuple[str, ...]:
        """Of a Literal, alone or repeated; () for none."""
        return next((get_args(kind) for kind in (self.one, *get_args(self.one)) if get_origin(kind) is Literal), ())

    @property
    def numbers(self) -> bool:
        """Whether it is a text of numbers with commas."""
        return get_origin(self.one) is tuple and float in get_args(self.one)

    @property
    def repeats(self) -> bool:
        """Whether it may be repeated."""
        return get_origin(self.one) is tuple and ... in get_args(self.one) and not self.numbers

    def value(self, given: Any) -> Any:
        """What the field is set to.

        Raises:
            UnknownNameError: none of its choices. ShapeError, NotFiniteError: no numbers.
        """
        if given is None or (self.repeats and not given):
            return () if self.repeats and self.default is dataclasses.MISSING else self.default
        if self.choices:
            from wbc import validation

            for one in given if self.repeats else (given,):
                validation.one_of(self.name, one, self.choices)
        if self.numbers:
            found, wanted = tuple(map(float, numbers(self.name, given))), get_args(self.one)
            if ... not in wanted and len(found) != len(wanted):
                raise ShapeError(self.name, given, f"expected {len(wanted)} numbers with commas between them")
            return found
        return tuple(given) if self.repeats else given

    def parameter(self) -> inspect.Parameter:
        """As typer reads it."""
        said = escape(MARKUP.sub(r"\1\2", self.said.help))
        shown: bool | str = self.default not in (None, "", (), False, dataclasses.MISSING) and not self.repeats
        if shown and self.numbers:
            shown = ",".join(f"{x:g}" for x in self.default)
        more: dict[str, Any] = {"help": said, "autocompletion": self.said.complete, "show_default": shown}
        if self.choices:
            more["metavar"] = "|".join(self.choices)
        elif self.numbers:
            more["metavar"] = "X,..."
        pair = get_origin(self.one) is tuple
        kind = self.one if self.one in PLAIN or pair else str
        kind, default = kind | None if type(None) in get_args(self.kind) else kind, self.default
        if self.numbers or self.repeats:
            kind, default = (list[str] if self.repeats else str) | None, None
        if self.said.placed:
            note: Any = typer.Argument(**{"metavar": self.name.upper(), **more})
        else:
            flag = f"--{self.name}/--no-{self.name}" if kind is bool and default is True else f"--{self.name}"
            note = typer.Option(flag, rich_help_panel=self.panel or None, **more)
        default = inspect.Parameter.empty if default is dataclasses.MISSING else default
        where = inspect.Parameter.KEYWORD_ONLY
        return inspect.Parameter(self.key, where, default=default, annotation=Annotated[kind, note])


def numbers(field: str, text: str) -> Any:
    """Numbers with commas between them.

    Raises:
        ShapeError, NotFiniteError: it is something else.
    """
    from wbc import validation

    try:
        return validation.real_array(field, [float(part) for part in text.split(",")])
    except ValueError as error:
        raise ShapeError(field, text, "expected numbers with commas between them") from error


def fields_of(kind: type, default: Any = None, path: tuple[str, ...] = (), panel: str = "") -> Iterator[OptionField]:
    """The options of a dataclass in the order of its fields.

    Args:
        default: an instance whose values are the defaults; None: those of the fields.
        path: fields that lead to it.
        panel: heading; "": the ``PANEL`` of the class that declares a field.
    """
    hints, texts = typing.get_type_hints(kind, include_extras=True), _attributes(kind)
    for field in dataclasses.fields(kind):
        own, *notes = (
            get_args(hints[field.name]) if get_origin(hints[field.name]) is Annotated else (hints[field.name],)
        )
        said, here = (notes or [texts.get(field.name, "")])[0], (*path, field.name)
        value = field.default if default is None else getattr(default, field.name)
        if dataclasses.is_dataclass(own) and isinstance(own, type):
            given = None if value is dataclasses.MISSING else value
            yield from fields_of(own, given, here, panel or (said if notes else ""))
            continue
        name = field.metadata.get("option", field.name.replace("_", "-"))
        said = Option(said, field.metadata.get("placed", False)) if isinstance(said, str) else said
        yield OptionField(here, name, own, value, said, panel or _panel(kind, field.name))


def made(kind: type, values: Mapping[str, Any], path: tuple[str, ...] = ()) -> Any:
    """A dataclass from the values of its options, by their keys."""
    hints, found = typing.get_type_hints(kind), {}
    for field in dataclasses.fields(kind):
        here = (*path, field.name)
        key = "__".join(here)
        found[field.name] = values[key] if key in values else made(hints[field.name], values, here)
    return kind(**found)


def parser(name: str, command: type[ReadCommand], as_json: bool = True) -> Any:
    """A command as typer runs it; with ``--json`` what it prints is data, see :mod:`wbc.cli.console`."""
    options = list(fields_of(command))

    def call(**given: Any) -> None:
        if given.pop("as_json", False):
            from wbc.cli import console

            console.collect()
        code = made(command, {option.key: option.value(given[option.key]) for option in options}).run()
        if code:
            raise typer.Exit(code)

    parameters = [option.parameter() for option in options]
    if as_json:
        note = typer.Option("--json", help="Print the results as JSON, and nothing else.")
        where = inspect.Parameter.KEYWORD_ONLY
        parameters.append(inspect.Parameter("as_json", where, default=False, annotation=Annotated[bool, note]))
    call.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    vars(call)["__signature__"] = inspect.Signature(parameters)
    text = re.split(r"^(?:Attributes|Raises):$", inspect.getdoc(command) or "", flags=re.M)[0]
    # Lines of a paragraph are one, which the terminal breaks anew
    text = re.sub(r"(?<=\S)\n(?=[^\s*-])", " ", text)
    call.__doc__ = escape(MARKUP.sub(r"\1\2", text)).strip()
    single = typer.Typer(add_completion=False, rich_markup_mode="rich")
    single.command(name)(call)
    return typer.main.get_command(single)


def _panel(kind: type, name: str) -> str:
    """The heading of the class that declares a field."""
    return next((vars(c).get("PANEL", "") for c in kind.__mro__ if name in vars(c).get("__annotations__", ())), "")


def _attributes(kind: type) -> dict[str, str]:
    """The texts under Attributes in the docstrings of a class and of those that it comes from, by name."""
    found: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        section = re.search(r"^ *Attributes:\n((?: +.*\n|\n)+)", inspect.cleandoc(one.__doc__ or "") + "\n", re.M)
        names: list[str] = []
        for line in inspect.cleandoc(section[1]).splitlines() if section else ():
            if (entry := ENTRY.fullmatch(line)) is not None:
                names = entry[1].split(", ")
                found |= dict.fromkeys(names, entry[2])
            else:
                found |= {name: f"{found[name]} {line.strip()}" for name in names if line.strip()}
    return found
