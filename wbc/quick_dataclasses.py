"""``dataclass`` that takes half as long to declare a class: comparison, hash and text are one function for all classes.

Python writes and compiles each of them anew for every class, 0.1 ms each, and a first command declares 90 classes.
"""

from __future__ import annotations

import dataclasses
import reprlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(
        declared: type | None = None, /, *, eq: bool = True, repr: bool = True, frozen: bool = False, **options: bool
    ) -> type | Callable[[type], type]:
        """The decorator of :mod:`dataclasses`, with its answers."""

        def made(declared: type) -> type:
            own = set(vars(declared))
            out = dataclasses.dataclass(eq=False, repr=False, frozen=frozen, **options)(declared)
            shared = {"__repr__": _text} if repr else {}
            if eq:
                shared |= {"__eq__": _equal, "__hash__": _hash if frozen else None}
            for name, function in shared.items():
                if name not in own:
                    setattr(out, name, function)
            return out

        return made if declared is None else made(declared)


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
