"""Stacks out of pickles that somebody else may have made.

A plain ``pickle.load`` runs whatever the file says. Here only what declarations are made of is looked up: classes of
this package that declare (items, robots, shapes, stacks), Pinocchio's models and poses, and numpy's arrays. Nothing
else is imported or called.
"""

from __future__ import annotations

import dataclasses
import io
import pickle
from typing import Any

from wbc.errors import PicklingError
from wbc.stack.declaration import Declaration

_PLACES = (
    *("wbc.tasks.", "wbc.robot.", "wbc.shapes", "wbc.stack.declaration", "wbc.api.stack"),
    *("wbc.coordinates.items", "wbc.coordinates.rows", "wbc.coordinates.point_sets", "wbc.analysis.rows"),
)
_OTHERS = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy.core.multiarray", "_reconstruct"),
    ("numpy.core.multiarray", "scalar"),
    ("pinocchio.pinocchio_pywrap_default", "Model"),
    ("pinocchio.pinocchio_pywrap_default", "SE3"),
}


class _Careful(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in _OTHERS:
            return super().find_class(module, name)
        if module.startswith(_PLACES) and "." not in name:
            found = super().find_class(module, name)
            declares = isinstance(found, type) and (dataclasses.is_dataclass(found) or issubclass(found, Declaration))
            if declares and found.__module__ == module:
                return found
        reason = "the pickle asks for code that is not this package's; trust it, or give the stack"
        raise PicklingError("stack", f"{module}.{name}", reason)


def load_stack(data: bytes, *, trust: bool = False) -> Declaration:
    """The stack in a pickle.

    Args:
        trust: look up and run whatever the pickle says: needed for items and functions of the user's own, and safe only
            where the file is.

    Raises:
        PicklingError: it holds something else, is damaged, or needs ``trust``.
    """
    try:
        stack = pickle.loads(data) if trust else _Careful(io.BytesIO(data)).load()
    except PicklingError:
        raise
    except Exception as error:
        raise PicklingError(
            "stack", len(data), f"the pickle cannot be read: {type(error).__name__}: {error}"
        ) from error
    if not isinstance(stack, Declaration):
        raise PicklingError("stack", type(stack).__name__, "the pickle holds no stack")
    return stack
