"""Objects with state whose public attributes are known: a misspelt one is refused, not kept."""

from __future__ import annotations

import inspect
from abc import ABCMeta
from typing import TYPE_CHECKING, Any

from wbc.errors import FixedAttributeError, UnknownAttributeError

#: Attribute of an object whose constructor is over
SEALED = "_sealed"


class SealedClass(ABCMeta):
    """Makes objects that are sealed when their constructors are over, but of classes from outside of the package."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        made = super().__call__(*args, **kwargs)
        if cls.__module__.startswith("wbc."):
            vars(made)[SEALED] = True
        return made

    @property
    def __signature__(cls) -> inspect.Signature:
        """That of the constructor, which ``__call__`` would hide."""
        own = inspect.signature(cls.__init__)  # type: ignore[misc]  # that of this class is what is asked for
        return own.replace(parameters=list(own.parameters.values())[1:])


class Sealed(metaclass=SealedClass):
    """Once its constructor is over, public attributes are set through properties with a setter alone.

    What begins with an underscore is its own, and what its class names in ``_changing`` its methods change.

    Raises:
        UnknownAttributeError: it has no such attribute. FixedAttributeError: it has, and it cannot be set.
    """

    _changing: tuple[str, ...] = ()

    if not TYPE_CHECKING:
        # Hidden from type checkers, which know the attributes
        def __setattr__(self, name: str, value: Any) -> None:
            if name[0] != "_" and SEALED in self.__dict__ and not _settable(type(self), name):
                field, known = f"{type(self).__name__}.{name}", [other for other in dir(self) if other[0] != "_"]
                if name in known:
                    raise FixedAttributeError(field, value, "cannot be set")
                raise UnknownAttributeError(field, name, [a for a in known if _settable(type(self), a)] or known)
            object.__setattr__(self, name, value)


def _settable(kind: type[Sealed], name: str) -> bool:
    return getattr(getattr(kind, name, None), "fset", None) is not None or name in kind._changing
