"""What items of a controller measure before every tick, for the C of the tick that asks their sensors."""

from __future__ import annotations

import numpy as np

from wbc.controller.handle import Handle
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.tasks.base import Constraint, Sensor
from wbc.tick.native import CompiledTick


class MeasuredItem:
    """An item with sensed rows, and the sensor that writes them.

    Attributes:
        handle: of the item. sensor: of this controller.
        drift: where in ``p`` the drift of its first sensed row is.
        entries: a ``wbc_sensor`` of ``native/watch.h``.
    """

    def __init__(self, stack: Declaration, layout: Layout, tick: CompiledTick, handle: Handle) -> None:
        name = handle.item_name
        item, slots, frame = stack[name].item, layout.blocks[name].slots, stack[name].frame
        assert isinstance(item, Constraint)
        numbers = {key: tick.p[slot.span] for key, slot in slots.items()}
        carried = [0] * 6
        if frame:
            own = {key: tick.p[slot.span] for key, slot in layout.blocks[frame].slots.items()}
            given = [own["pose"], own["twist"], numbers["pose"], numbers["velocity"]]
            numbers |= {"pose": np.zeros(12), "velocity": np.zeros(6)}
            carried = [array.ctypes.data for array in (*given, numbers["pose"], numbers["velocity"])]
        self.handle, self.drift = handle, slots["drift"].start
        # Its sensor holds the numbers
        self.sensor: Sensor = item.sensor(stack.robot, numbers)
        self.entries = [*self.sensor.addresses, handle.switched.ctypes.data, *carried]


def measured_items(
    stack: Declaration, layout: Layout, tick: CompiledTick, handles: dict[str, Handle]
) -> list[MeasuredItem]:
    """Those of a controller, which its tick asks from now on."""
    sensed = [name for name in layout.blocks if has_sensor(stack, name)]
    items = [MeasuredItem(stack, layout, tick, handles[name]) for name in sensed]
    if items:
        tick.watch_sensors(np.array([item.entries for item in items], np.int64))
    return items


def has_sensor(stack: Declaration, name: str) -> bool:
    """Whether an item has rows that are measured."""
    item, robot = stack[name].item, stack.robot
    return isinstance(item, Constraint) and item.sensed_rows(robot) > 0
