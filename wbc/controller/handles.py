"""The handles of a stack's items. Which run-time values the items of each class have, for editors, type checkers and
``dir``, is in the stub beside this file, which ``make docs`` writes from their declarations.

    hand = wbc.tasks.EndEffector("panda_hand_tcp")
    controller = wbc.Stack(robot, dt=0.005).add(hand, name="hand").compile()
    controller[hand].target = pose        # an EndEffectorHandle
    controller["hand"].target = pose      # the same handle; the checker knows only that it is one of these classes

A misspelt value is an error of the type checker in both, and an :class:`UnknownAttributeError` when it runs. Values
that an item of the user's own declares pass the checker through the item; through its name they are set and read with
:meth:`Handle.set` and :meth:`Handle.get`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wbc.controller.handle import Handle
from wbc.errors import DuplicateNameError, UnknownNameError
from wbc.sealed import Sealed
from wbc.stack.declaration import Declaration
from wbc.tasks.base import Item


class Handles(Sealed):
    """Run-time values of the items of a stack, by name or by the item itself as it was added."""

    def __init__(self, handles: Mapping[str, Handle], stack: Declaration) -> None:
        self._handles = handles
        self._names: dict[int, list[str]] = {}
        for entry in stack.entries:
            self._names.setdefault(id(entry.added or entry.item), []).append(entry.name)

    def __getitem__(self, item: str | Item) -> Any:
        """The handle of an item.

        Raises:
            UnknownNameError: no item of that name, or an item that was not added. DuplicateNameError: it was added more
                than once, so that its name has to say which is meant.
        """
        if isinstance(item, Item):
            names = self._names.get(id(item), [])
            if len(names) > 1:
                reason = f"is in the stack {len(names)} times, as {', '.join(names)}: say which by its name"
                raise DuplicateNameError("item", type(item).__name__, reason)
            if not names:
                alike = [name for name, handle in self._handles.items() if handle.is_of(type(item))]
                raise UnknownNameError("item", type(item).__name__, alike or self._handles)
            return self._handles[names[0]]
        try:
            return self._handles[item]
        except (KeyError, TypeError):
            raise UnknownNameError("item", item, self._handles) from None

    def __contains__(self, item: object) -> bool:
        return id(item) in self._names if isinstance(item, Item) else isinstance(item, str) and item in self._handles
