"""What declarations leave out of a pickle, and what they put in where Python has only a name to offer.

A pickle holds what was declared, not what was worked out from it (cached properties). Python pickles functions by name,
which a lambda or a local function does not have: these go by value if the package ``cloudpickle`` is there.
"""

from __future__ import annotations

import copy
import sys
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from wbc.errors import PicklingError
from wbc.multibody import CONVERTED

T = TypeVar("T")


def declared(thing: object) -> dict[str, Any]:
    """The attributes of an object without those that are worked out from the others."""
    kind = type(thing)
    worked_out = {
        k for k in vars(thing) if k.endswith(CONVERTED) or isinstance(getattr(kind, k, None), cached_property)
    }
    return {k: v for k, v in vars(thing).items() if k not in worked_out}


def restore(thing: object, state: dict[str, Any], fields: set[str]) -> None:
    """Put the state of a frozen object back.

    Raises:
        PicklingError: a field is missing, so the pickle is of another version of the class.
    """
    missing = sorted(fields - set(state))
    if missing:
        reason = f"the pickle is of another version of this class, without {', '.join(missing)}"
        raise PicklingError(type(thing).__name__, sorted(state), reason)
    for name, value in state.items():
        object.__setattr__(thing, name, value)


def freeze(thing: object) -> None:
    """Make the arrays of an object read-only, which a pickle does not say of them."""
    for value in vars(thing).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False


def deep_copy(thing: T, memo: dict[int, Any]) -> T:
    """A copy of an object with copies of what was declared; unlike a pickle it takes functions as they are."""
    out: T = object.__new__(type(thing))
    memo[id(thing)] = out
    for name, value in declared(thing).items():
        object.__setattr__(out, name, copy.deepcopy(value, memo))
    return out


def has_name(thing: object) -> bool:
    """Whether another process finds a function by its module and name."""
    found: object = sys.modules.get(getattr(thing, "__module__", None) or "")
    for part in str(getattr(thing, "__qualname__", "")).split("."):
        found = getattr(found, part, None)
    return found is thing


class ByValue:
    """A function in a pickle that has no name to be found by."""

    def __init__(self, function: object) -> None:
        self._function = function

    def __reduce__(self) -> tuple[Any, ...]:
        import cloudpickle

        return cloudpickle.loads, (cloudpickle.dumps(self._function),)


def by_name_or_value(field: str, function: object) -> object:
    """What stands for a function in a pickle.

    Raises:
        PicklingError: it has no name, and ``cloudpickle`` is not installed or cannot pickle it either.
    """
    # Callable objects without a name of their own pickle as their class says
    if not hasattr(function, "__qualname__") or has_name(function):
        return function
    cure = "define it at the top of a module"
    try:
        import cloudpickle

        cloudpickle.dumps(function)
    except ImportError:
        reason = f"a lambda or local function has no name to pickle it by: {cure}, or install cloudpickle"
        raise PicklingError(field, function, reason) from None
    except Exception as error:
        reason = f"has no name and cannot be pickled by value ({type(error).__name__}: {error}): {cure}"
        raise PicklingError(field, function, reason) from error
    return ByValue(function)
