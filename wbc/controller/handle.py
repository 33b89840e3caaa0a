"""Run-time values: of one item, ``controller["hand"].target = pose``, and of several that are written together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import hypot, isfinite
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from wbc import validation
from wbc.controller.ramps import Ramps
from wbc.errors import NotFiniteError, RangeError, UnknownAttributeError
from wbc.multibody import is_pose
from wbc.robot import Robot
from wbc.stack.declaration import Declaration
from wbc.stack.layout import CLOSED, Block, Layout, Slot
from wbc.tasks import inputs
from wbc.tasks._direction import DIRECTION_PRICE, Direction
from wbc.tasks.base import Item
from wbc.tick.buffers import Buffers
from wbc.validation import LARGEST, Array

_ARRAY = np.ndarray
_FLOAT = np.dtype(np.float64)
_MATRIX = (4, 4)
#: Kind of a value that native code checks (``native/values.h``): any finite numbers
NUMBERS = 0
#: The same: the matrix of a pose
POSE = 1
#: The same: a configuration of the robot
CONFIGURATION = 2


class Owner(Protocol):
    """What a handle needs of what it belongs to: :class:`wbc.controller.core.Core`."""

    @property
    def stack(self) -> Declaration: ...
    @property
    def layout(self) -> Layout: ...
    @property
    def tick(self) -> Buffers: ...
    @property
    def ramps(self) -> Ramps: ...
    @property
    def row_costs(self) -> Array: ...
    @property
    def directions(self) -> Directions: ...

    def write(self, slot: Slot, numbers: Array) -> None:
        """See :meth:`Core.write`."""

    def write_pose(self, slot: Slot, matrix: Array) -> bool:
        """See :meth:`Core.write_pose`."""

    def require_value(self, slot: Slot, field: str) -> None:
        """See :meth:`Core.require_value`."""

    def start_ramp(self, handle: Handle, weight: float, seconds: float) -> None:
        """See :meth:`Handle.ramp`."""


class Handle:
    """Run-time values of one item as attributes; reading gives copies, writing validates.

    Besides the item's own inputs: ``enabled``, ``mask`` (one number >= 0 a row of a task, 0 or 1 a row of a
    constraint), for tasks ``weight`` and ``gain``, for margins ``rate`` [1/s], for soft constraints ``price``.
    """

    __slots__ = (
        "_block",
        "_enabled",
        "_fields",
        "_mask",
        "_ordered",
        "_owner",
        "_plain",
        "_poses",
        "_ramped",
        "_rate",
        "_robot",
        "_row_weights",
        "_weight",
        "switched",
    )

    _block: Block
    _enabled: bool
    _fields: Mapping[str, str]
    _mask: Array
    _ordered: Mapping[str, tuple[Slot, Slot]]
    _owner: Owner
    _plain: Mapping[str, tuple[int, ...]]
    _poses: frozenset[str]
    _ramped: Slot | None
    _rate: Slot | None
    _robot: Robot
    _row_weights: Array
    _weight: float
    #: 1 or 0, as ``enabled`` is, for native code
    switched: Array
    # For type checkers; the methods below answer. Values of items: see handles.pyi
    enabled: bool
    mask: Any

    def __init__(self, owner: Owner, block: Block) -> None:
        put = super().__setattr__
        put("_owner", owner)
        put("_block", block)
        put("_robot", owner.stack.robot)
        # the one input with a limit that the item does not know: rate dt <= 1
        bounded = block.form == "margins" or owner.layout.command != "velocity"
        put("_rate", block.slots.get("rate") if bounded else None)
        put("_ramped", None if isinstance(block.entry.item, Direction) else block.slots.get("price"))
        put("_fields", {name: f"{block.entry.name}.{name}" for name in block.slots})
        # inputs that may not exceed another, by the name of either
        pairs = [(slot, block.slots[slot.input.below]) for slot in block.slots.values() if slot.input.below]
        put("_ordered", {slot.input.name: pair for pair in pairs for slot in pair})
        # inputs of any finite numbers, with their shapes
        plain = {name: slot.input for name, slot in block.slots.items() if name != "rate" and name not in self._ordered}
        put("_plain", {name: (inputs.size(self._robot, i),) for name, i in plain.items() if inputs.is_plain(i)})
        put("_poses", frozenset(name for name, slot in block.slots.items() if slot.input.kind == "pose"))
        put("_enabled", True)
        put("switched", np.ones(1))
        put("_weight", block.entry.weight)
        put("_mask", np.ones(len(block.rows)))
        put("_row_weights", np.asarray(block.entry.item.row_weights(self._robot), dtype=np.float64))

    @property
    def quick(self) -> Mapping[str, int]:
        """Inputs that native code can check, and what they are."""
        slots = self._block.slots.items()
        whole = {n for n, s in slots if s.input.kind == "configuration" and s.input.joints is None}
        return (
            dict.fromkeys(self._plain, NUMBERS) | dict.fromkeys(self._poses, POSE) | dict.fromkeys(whole, CONFIGURATION)
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all run-time values that can be set; sensed ones can also be read."""
        own = ("weight",) if self._block.form == "task" else ()
        given = [name for name, slot in self._block.slots.items() if not slot.input.sensed]
        return (*given, *own, "enabled", "mask")

    def __dir__(self) -> list[str]:
        return [*self.names, "get", "names", "ramp", "set", "switch"]

    def _get(self, name: str) -> Any:
        """Not an attribute that is there: a run-time value."""
        if name.startswith("__"):
            raise AttributeError(name)
        if name == "enabled":
            return self._enabled
        if name == "mask":
            return self._mask.copy()
        if name == "weight" and self._block.form == "task":
            return self._weight
        slot = self.slot(name)
        self._owner.require_value(slot, self._field(name))
        return _as_written(slot, self._owner.tick.p[slot.span])

    def _set(self, name: str, value: Any) -> None:
        """A run-time value; other attributes do not change."""
        slot = self._block.slots.get(name)
        if slot is not None:
            # Set every tick, so with as few calls as can be
            numbers = value if type(value) is _ARRAY or not is_pose(value) else value.homogeneous
            if type(numbers) is _ARRAY and numbers.dtype is _FLOAT:
                if name in self._poses:
                    if numbers.shape == _MATRIX and self._owner.write_pose(slot, numbers):
                        return
                # not for NaN; numpy would warn where squares overflow
                elif numbers.shape == self._plain.get(name) and hypot(*numbers.tolist()) < LARGEST:
                    self._owner.write(slot, numbers)
                    return
            if slot.input.sensed:
                raise RangeError(self._field(name), value, "is measured in every tick and cannot be set")
            numbers = self._checked(slot, value)
            if name in self._ordered:
                self._check_order({name: numbers})
            self._write(slot, numbers)
            return
        field = self._field(name)
        if name == "enabled":
            super().__setattr__("_enabled", validation.flag(field, value))
        elif name == "mask":
            super().__setattr__("_mask", self._checked_mask(field, value))
        elif name == "weight" and self._block.form == "task":
            weight = validation.scalar(field, value, low=0.0)
            self._owner.ramps.stop(self.item_name)
            super().__setattr__("_weight", weight)
        else:
            raise UnknownAttributeError(field, name, self.names)
        self.apply()

    if not TYPE_CHECKING:
        # Hidden from type checkers, which would take any name for a value
        __getattr__, __setattr__ = _get, _set

    def get(self, name: str) -> Any:
        """A run-time value by its name.

        Raises:
            UnknownNameError: there is none of that name.
        """
        if not isinstance(name, str) or name not in {*self.names, *self._block.slots}:
            raise UnknownAttributeError(self._field("get"), name, self.names)
        return self._get(name)

    def ramp(self, weight: float, seconds: float) -> None:
        """Let a task's weight, or a soft constraint's price, change smoothly to ``weight`` over ``seconds`` of ticks:
        joining (from 0), leaving (to 0) or changing rank without a jerk. ln w follows 3 s^2 - 2 s^3. Setting the weight
        or the price ends it.

        Raises:
            UnknownNameError: neither a task nor soft. RangeError, ShapeError: a negative weight or time.
        """
        if self._block.form != "task" and self._ramped is None:
            raise UnknownAttributeError(self._field("ramp"), "ramp", self.names)
        last = validation.scalar(self._field("ramp.weight"), weight, low=0.0)
        if self._ramped is not None:
            last = float(self._checked(self._ramped, last)[0])
        self._owner.start_ramp(self, last, validation.scalar(self._field("ramp.seconds"), seconds, low=0.0, unit="s"))

    @property
    def ramped(self) -> float:
        """What a ramp changes: the weight of a task, the price of a soft constraint."""
        return self._weight if self._ramped is None else float(self._owner.tick.p[self._ramped.start])

    def put_ramped(self, value: float) -> None:
        """A checked weight or price on its way along a ramp."""
        if self._ramped is None:
            super().__setattr__("_weight", value)
            self.apply()
        else:
            self._owner.tick.p[self._ramped.start] = value

    def set(self, **values: Any) -> None:
        """Set several of the item's inputs at once: all are checked, bounds against each other, before any is written.

        Raises:
            WbcError: as for one of them; nothing is changed.
        """
        self.write_together(self.checked_together(values))

    def checked_together(self, values: Mapping[str, Any]) -> dict[str, Array]:
        """Numbers of several inputs, validated, bounds against each other too.

        Raises:
            WbcError: as of :meth:`set`.
        """
        settable = [name for name, slot in self._block.slots.items() if not slot.input.sensed]
        for name in values:
            if name not in settable:
                raise UnknownAttributeError(self._field(name), name, settable)
        numbers = {name: self.checked(name, value) for name, value in values.items()}
        self._check_order(numbers)
        return numbers

    def write_together(self, numbers: Mapping[str, Array]) -> None:
        """Write numbers of :meth:`checked_together`."""
        for name, given in numbers.items():
            self._write(self.slot(name), given)

    def switch(self, on: Any) -> None:
        """Set ``enabled``, for those who know only that it is a handle."""
        self._set("enabled", on)

    def _write(self, slot: Slot, numbers: Array) -> None:
        if slot is self._ramped:
            self._owner.ramps.stop(self.item_name)
        self._owner.write(slot, numbers)

    def _check_order(self, numbers: Mapping[str, Array]) -> None:
        p = self._owner.tick.p
        for name in numbers:
            if name in self._ordered:
                low, high = self._ordered[name]
                lower, upper = (numbers.get(s.input.name, p[s.span]) for s in (low, high))
                reason = f"{low.input.name} is above {high.input.name}"
                inputs.require_order(self._field(name), lower, upper, reason)

    def is_of(self, kind: type[Item]) -> bool:
        """Whether its item is of a class."""
        return isinstance(self._block.entry.item, kind)

    @property
    def item_name(self) -> str:
        """Name of the item in the stack."""
        return str(self._block.entry.name)

    def checked(self, name: str, value: Any) -> Array:
        """The numbers of an input's value, validated.

        Raises:
            WbcError: not a value of this input.
        """
        return self._checked(self.slot(name), value)

    def _checked(self, slot: Slot, value: Any) -> Array:
        field = self._fields[slot.input.name]
        numbers = inputs.flat(self._robot, field, slot.input, value)
        if slot is not self._rate:
            return numbers
        longest = self._owner.stack.dt_range[1]
        if not 0.0 < numbers[0] * longest <= 1.0:
            reason = (
                f"rate * dt must be in (0, 1] for every dt up to {longest:g} s, so rate in (0, {1 / longest:g}] 1/s"
            )
            raise RangeError(field, value, reason)
        return numbers

    def assume(self, other: Handle) -> None:
        """Take the weight and switches of a handle of the same item over, without writing them to the buffers."""
        for name in ("_enabled", "_weight"):
            super().__setattr__(name, getattr(other, name))
        super().__setattr__("_mask", other._mask.copy())
        self.switched[0] = other._enabled

    def unit_weights(self) -> Array:
        """What a weight of 1 puts on each row of a task, its switches counted."""
        return self._mask * float(self._enabled) * self._row_weights * self._owner.row_costs[self._block.span]

    def apply(self) -> None:
        """Write weights or row switches to the buffers."""
        tick, block, form = self._owner.tick, self._block, self._block.form
        on = self._mask * float(self._enabled)
        self.switched[0] = self._enabled
        if form == "task":
            tick.weight[block.span] = self._weight * on * self._row_weights * self._owner.row_costs[block.span]
        elif form == "bounds":
            start = block.start * self._owner.layout.variables
            tick.bound_enabled[start : start + len(on)] = on
        else:
            tick.enabled[block.span] = on
            if CLOSED in block.slots:
                tick.p[block.slots[CLOSED].span] = float(self._enabled)
        self._owner.directions.follow(block.entry.name)

    def _checked_mask(self, field: str, value: Any) -> Array:
        raw = validation.real_array(field, value)
        count = len(self._block.rows)
        mask = np.full(count, float(raw)) if raw.shape == () else validation.real_array(field, raw, (count,))
        for k, number in enumerate(mask.tolist()):
            where = f"{field}[{k}]"
            validation.scalar(where, number, low=0.0)
            if self._block.form != "task" and number not in (0.0, 1.0):
                raise RangeError(where, number, "a constraint's row is on (1) or off (0)")
        return mask

    def slot(self, name: str) -> Slot:
        """Where an input is in the buffer.

        Raises:
            UnknownAttributeError: there is no such input.
        """
        slot: Slot | None = self._block.slots.get(name)
        if slot is None:
            raise UnknownAttributeError(self._field(name), name, self.names)
        return slot

    def _field(self, name: str) -> str:
        return f"{self._block.entry.name}.{name}"

    def __repr__(self) -> str:
        return f"<{type(self._block.entry.item).__name__} {self._block.entry.name!r}: {', '.join(self.names)}>"


def _as_written(slot: Slot, numbers: Array) -> Any:
    """An input's numbers as the user writes them."""
    kind = slot.input.kind
    if kind == "pose":
        # Imported here: a pose is Pinocchio's, which a tick does without
        from wbc.controller.read_pose import ReadPose

        return ReadPose(numbers[:9].reshape(3, 3, order="F"), numbers[9:])
    if kind == "rotation":
        return numbers.reshape(3, 3, order="F").copy()
    if kind == "vector" and slot.input.size == 0:
        return float(numbers[0])
    return numbers.copy()


class Directions:
    """The scaled tasks of one controller: what keeps the direction of one follows its weight and switches."""

    def __init__(self, layout: Layout, tick: Buffers, handles: Mapping[str, Handle]) -> None:
        self._layout, self._tick, self._handles = layout, tick, handles
        named = [(b.entry.name, b.entry.item.of) for b in layout.of_form("rows") if isinstance(b.entry.item, Direction)]
        #: name of the task, by its own name and by that of what keeps its direction
        self._tasks = dict(named) | {task: task for _, task in named}
        self._keepers = {task: kept for kept, task in named}

    def follow(self, name: str) -> None:
        """A task, or what keeps its direction, has another weight or other switches: rows that count, and the price."""
        task = self._tasks.get(name)
        if task is None:
            return
        kept = self._keepers[task]
        block, keeper = self._layout.blocks[task], self._layout.blocks[kept]
        counts = (self._tick.weight[block.span] > 0.0) & self._handles[kept].enabled
        on = np.append(counts, counts.any()) * self._handles[kept].mask
        self._tick.enabled[keeper.span] = on
        self._tick.p[keeper.slots["price"].span] = DIRECTION_PRICE * self._handles[task].get("weight")


class InputGroup:
    """Parts of a buffer of inputs as one array, for the packages above; users' values are checked by :class:`Handle`.

    Args:
        inputs: (item, input, which of its numbers; None: all), in the order of the array. Poses are rotations by
            columns, then positions.

    Attributes:
        size: how many numbers it has. places: where they are in the buffer. written: the last ones, None before the
            first.
    """

    def __init__(self, owner: Owner, inputs: Sequence[tuple[str, str, slice | None]]) -> None:
        self._owner, self._p = owner, owner.tick.p
        self._slots = [owner.layout.blocks[item].slots[name] for item, name, _ in inputs]
        self._field = ", ".join(f"{item}.{name}" for item, name, _ in inputs)
        spans = [np.arange(slot.span.start, slot.span.stop) for slot in self._slots]
        self.places = index = np.concatenate(
            [span if part is None else span[part] for span, (*_, part) in zip(spans, inputs, strict=True)]
        )
        self.size = len(index)
        whole = self.size == index[-1] - index[0] + 1 and bool((np.diff(index) == 1).all())
        # Numbers that lie side by side are written in half the time
        self._index: slice | np.ndarray = slice(int(index[0]), int(index[-1]) + 1) if whole else index
        self.written: Array | None = None

    def write(self, numbers: Array) -> None:
        """Write all numbers ``[size]``; that rotations are rotations and directions of length 1 is up to the caller.

        Raises:
            NotFiniteError: nothing is written.
        """
        if not isfinite(numbers.dot(numbers)):
            raise NotFiniteError(self._field, numbers, "expected finite numbers")
        self._p[self._index] = numbers
        if self.written is None:
            # They no longer follow the first configuration
            for slot in self._slots:
                self._owner.write(slot, self._p[slot.span].copy())
        self.written = numbers
