"""Run-time values of several items in one call: ``controller.set(hand=pose, posture=q)``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller.handle import POSE, Handle
from wbc.controller.step import Step
from wbc.errors import ShapeError
from wbc.stack.layout import Slot
from wbc.tick.context import Context

_POSE_SHAPE = (4, 4)


class Plan:
    """How some values are taken by one native call.

    Attributes:
        places: where each value's bytes wait. shapes: of its array. slots: of the inputs.
        take: check them all and write them; 0, and nothing written, where one is refused.
        cycle, request: the same by ``names``, and a tick, see :meth:`wbc.tick.native.CompiledTick.cycler`.
    """

    def __init__(self, context: Context, slots: list[Slot], kinds: list[int], names: Sequence[str] = ()) -> None:
        self.slots = slots
        self.shapes = [_POSE_SHAPE if kind == POSE else (slot.size,) for slot, kind in zip(slots, kinds, strict=True)]
        sizes = [int(np.prod(shape)) for shape in self.shapes]
        staged = np.zeros(sum(sizes))
        table = np.array(
            [(kind, slot.start, size) for kind, slot, size in zip(kinds, slots, sizes, strict=True)], np.intc
        )
        # A memoryview takes bytes in half the time in which an array takes an array
        ends = 8 * np.cumsum(sizes)
        whole = staged.data.cast("B")
        self.places = [whole[end - 8 * size : end] for end, size in zip(ends.tolist(), sizes, strict=True)]
        assembly = context.assembly
        assert assembly is not None
        self.take = assembly.taker(staged, table)
        self.cycle, self.request = assembly.cycler(staged, table, names, Step, context)


class Together:
    """Sets values of several items: quickly where one native call can check them, else one by one."""

    def __init__(self, handles: Mapping[str, Handle], context: Context) -> None:
        self._handles, self._context = handles, context
        #: of names that were given together and can be taken quickly
        self.plans: dict[tuple[str, ...], Plan] = {}
        #: of no names
        self.none = self.plans[()] = Plan(context, [], [])

    def plan(self, values: Mapping[str, Any]) -> Plan | None:
        """How the targets of these items are taken quickly, from now on; None where they cannot be.

        Raises:
            UnknownNameError: no such item. ShapeError: an item without a target.
        """
        if not values or any(isinstance(value, Mapping) for value in values.values()):
            return None
        handles = [self._handles[validation.one_of("set", name, self._handles)] for name in values]
        slots = [handle.slot(main_input(handle)) for handle in handles]
        kinds = [handle.quick.get(slot.input.name) for handle, slot in zip(handles, slots, strict=True)]
        known = [kind for kind in kinds if kind is not None]
        if len(known) < len(kinds):
            return None
        plan = self.plans[tuple(values)] = Plan(self._context, slots, known, tuple(values))
        return plan

    def carefully(self, values: Mapping[str, Any]) -> None:
        """All are checked before any is written.

        Raises:
            WbcError: as for one of them; nothing is changed.
        """
        found: list[tuple[Handle, dict[str, Any]]] = []
        for name, given in values.items():
            handle = self._handles[validation.one_of("set", name, self._handles)]
            own = given if isinstance(given, Mapping) else {main_input(handle): given}
            found.append((handle, handle.checked_together(own)))
        for handle, numbers in found:
            handle.write_together(numbers)


def main_input(handle: Handle) -> str:
    """The value that an item is about: its target, or the only one that it has.

    Raises:
        ShapeError: it has several, or none.
    """
    switches = ("weight", "enabled", "mask", "gain", "stiffness", "damping", "rate", "price")
    names = [name for name in handle.names if name not in switches]
    if "target" in names or len(names) == 1:
        return "target" if "target" in names else names[0]
    reason = f"has no target; say which of its values: a dictionary of {', '.join(map(repr, handle.names))}"
    raise ShapeError(handle.item_name, None, reason)
