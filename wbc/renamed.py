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

        def read(instance: Any, old: str = old, new: str = new) -> Any:
            warnings.warn(f"{kind.__name__}.{old} is {kind.__name__}.{new} now", DeprecationWarning, stacklevel=2)
            return getattr(instance, new)

        setattr(kind, old, property(read))
