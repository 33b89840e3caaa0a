"""Arguments and fields that have another name now: the old one works for one version, and warns."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def renamed(**names: str) -> Callable[[F], F]:
    """A decorator of a function or a class: old name of an argument -> the name that it has now.

    Of a class the arguments are those of its constructor, and the old attributes can still be read.

    Raises:
        TypeError: on a call that gives an argument by both names.
    """

    def decorate(named: F) -> F:
        if inspect.isclass(named):
            _class(named, names)
            return named
        return cast("F", _function(named, named.__qualname__, names))

    return decorate


def old_attribute(name: str, old: str = "") -> Any:
    """A property under the old name of attribute ``name``; whoever reads it is warned, with the old name if given.

    For classes whose constructor takes no old names, as wrapping it would cost time wherever they are made.
    """

    def get(owner: Any) -> Any:
        kind = type(owner).__name__
        text = f"{kind}.{old} is {kind}.{name} now" if old else f"this attribute of {kind} is called {name} now"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(owner, name)

    return property(get, doc=f"Old name of ``{name}``.")


def _function(function: Callable[..., Any], title: str, names: dict[str, str]) -> Callable[..., Any]:
    @functools.wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        for old in names.keys() & given.keys():
            if names[old] in given:
                raise TypeError(f"{title}: {old} is {names[old]} now, and both were given")
            warnings.warn(f"{title}: {old} is {names[old]} now", DeprecationWarning, stacklevel=2)
            given[names[old]] = given.pop(old)
        return function(*args, **given)

    return call


def _class(kind: Any, names: dict[str, str]) -> None:
    kind.__init__ = _function(kind.__init__, kind.__name__, names)
    for old, new in names.items():
        setattr(kind, old, old_attribute(new, old))
