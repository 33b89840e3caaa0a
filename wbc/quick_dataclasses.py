"""``dataclass`` that takes a tenth of the time to declare a class: nothing is written and compiled for it until it has
an object.

Python writes and compiles five functions for every class, 0.1 ms each. A first command declares 90 classes, and makes
objects of a third of them. Here comparison, hash and text are one function for all classes, and ``__init__`` is written
when it is first asked for. What a class declares is read by :mod:`dataclasses`; it has no ``InitVar``.
"""

from __future__ import annotations

import dataclasses
import inspect
import reprlib
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(
        declared: type | None = None,
        /,
        *,
        eq: bool = True,
        repr: bool = True,
        frozen: bool = False,
        slots: bool = False,
    ) -> type | Callable[[type], type]:
        """The decorator of :mod:`dataclasses`, with its answers."""

        def made(declared: type) -> type:
            own = set(vars(declared))
            out, shared = declared, {}
            if slots:
                out = dataclasses.dataclass(init=False, eq=False, repr=False, frozen=frozen, slots=True)(declared)
            else:
                _read(declared)
                shared |= _frozen(declared) if frozen else {}
            shared |= {"__init__": _Init(out)}
            if repr:
                shared |= {"__repr__": _text}
            if eq:
                shared |= {"__eq__": _equal, "__hash__": _hash if frozen else None}
            for name, function in shared.items():
                if name not in own:
                    setattr(out, name, function)
            for option, value in {"init": True, "repr": repr, "eq": eq, "frozen": frozen}.items():
                setattr(out.__dataclass_params__, option, value)
            return out

        return made if declared is None else made(declared)


#: What the signature of an ``__init__`` shows where a field's default is made anew for every object
_MADE = type("_Made", (), {"__repr__": lambda _: "<factory>"})()


def _read(declared: Any) -> None:
    """Fields and defaults of a class, which :mod:`dataclasses` reads of one with the same fields and without bases."""
    types = inspect.get_annotations(declared)
    given = {name: getattr(declared, name) for name in types if hasattr(declared, name)}
    given |= {name: value for name, value in vars(declared).items() if isinstance(value, dataclasses.Field)}
    about = {"__module__": declared.__module__, "__qualname__": declared.__qualname__, "__annotations__": types}
    alone: Any = dataclasses.dataclass(init=False, eq=False, repr=False)(
        type(declared.__name__, (), {**given, **about, "__doc__": declared.__qualname__})
    )
    fields: dict[str, Any] = {}
    for base in declared.__mro__[:0:-1]:
        fields |= getattr(base, "__dataclass_fields__", {})
    declared.__dataclass_fields__ = fields | alone.__dataclass_fields__
    for name, value in given.items():
        if isinstance(value, dataclasses.Field):
            if value.default is dataclasses.MISSING:
                delattr(declared, name)
            else:
                setattr(declared, name, value.default)
    taken = {name: vars(alone)[name] for name in ("__dataclass_params__", "__replace__") if name in vars(alone)}
    taken["__match_args__"] = tuple(f.name for f in dataclasses.fields(declared) if f.init and not f.kw_only)
    for name, value in taken.items():
        setattr(declared, name, value)


def _frozen(declared: Any) -> dict[str, Any]:
    """What keeps attributes of its objects as they are."""
    names = frozenset(f.name for f in dataclasses.fields(declared))

    def __setattr__(self: Any, name: str, value: Any) -> None:
        if type(self) is declared or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(declared, self).__setattr__(name, value)

    def __delattr__(self: Any, name: str) -> None:
        if type(self) is declared or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(declared, self).__delattr__(name)

    return {"__setattr__": __setattr__, "__delattr__": __delattr__}


class _Init:
    """``__init__`` of a class before it is first asked for, which then takes its place."""

    def __init__(self, of: Any) -> None:
        self._of = of

    def __get__(self, thing: object, owner: type | None = None) -> Any:
        if vars(self._of).get("__init__") is self:
            self._of.__init__ = _written(self._of)
        return vars(self._of)["__init__"].__get__(thing, owner)


def _written(of: Any) -> Callable[..., None]:
    """The ``__init__`` of a class."""
    known: dict[str, Any] = {"_MADE": _MADE, "_set": object.__setattr__}
    taken: list[tuple[bool, str]] = []
    lines = ["pass"]
    for f in dataclasses.fields(of):
        value, parameter = f.name, f.name
        if f.default_factory is not dataclasses.MISSING:
            known[f"_new_{f.name}"], parameter = f.default_factory, f"{f.name}=_MADE"
            value = f"_new_{f.name}() if {f.name} is _MADE else {f.name}" if f.init else f"_new_{f.name}()"
        elif f.default is not dataclasses.MISSING:
            known[f"_default_{f.name}"], parameter = f.default, f"{f.name}=_default_{f.name}"
            value = f.name if f.init else f"_default_{f.name}"
        elif not f.init:
            continue
        taken += [(bool(f.kw_only), parameter)] if f.init else []
        lines += [f"_set(self, {f.name!r}, {value})" if of.__dataclass_params__.frozen else f"self.{f.name} = {value}"]
    lines += ["self.__post_init__()"] if hasattr(of, "__post_init__") else []
    named = [text for last, text in taken if last]
    head = ", ".join(["self", *(text for last, text in taken if not last), *(["*", *named] if named else [])])
    text = f"def made({', '.join(known)}):\n def __init__({head}):\n  " + "\n  ".join(lines) + "\n return __init__"
    # Hints of types are evaluated among the names of the module
    made: dict[str, Any] = {}
    exec(text, vars(sys.modules[of.__module__]), made)
    init: Callable[..., None] = made["made"](**known)
    init.__qualname__, init.__module__ = f"{of.__qualname__}.__init__", of.__module__
    init.__annotations__ = {f.name: f.type for f in dataclasses.fields(of) if f.init} | {"return": None}
    return init


def _values(value: Any, hashed: bool) -> tuple[Any, ...]:
    """Of the fields that are compared, or hashed."""
    every = dataclasses.fields(value)
    return tuple([getattr(value, f.name) for f in every if (f.compare if not hashed or f.hash is None else f.hash)])


def _equal(self: Any, other: object) -> Any:
    return _values(self, False) == _values(other, False) if other.__class__ is self.__class__ else NotImplemented


def _hash(self: Any) -> int:
    return hash(_values(self, True))


@reprlib.recursive_repr()
def _text(self: Any) -> str:
    shown = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self) if f.repr)
    return f"{self.__class__.__qualname__}({shown})"
