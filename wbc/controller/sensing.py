"""What items want measured with Coal before a tick, for ticks that no controller steps."""

from __future__ import annotations

from wbc.controller.controller import Controller
from wbc.controller.handle import Handle
from wbc.controller.tick import Assembly
from wbc.tasks.base import Constraint, Sensor


class Sensing:
    """Sensors of a controller's items that write into a tick's parameters; false where there are none."""

    def __init__(self, controller: Controller, tick: Assembly) -> None:
        robot, self._tick = controller.stack.robot, tick
        self._sensors: list[tuple[Sensor, Handle]] = []
        for entry in controller.stack.entries:
            item = entry.item
            if isinstance(item, Constraint) and item.sensed_rows(robot) > 0:
                slots = controller.layout.blocks[entry.name].slots
                places = {name: tick.p[slot.span] for name, slot in slots.items()}
                self._sensors.append((item.sensor(robot, places), controller[entry.name]))

    def __bool__(self) -> bool:
        return bool(self._sensors)

    def sense(self) -> None:
        """Measure at the tick's q what enabled items sense."""
        for sensor, handle in self._sensors:
            if handle.enabled:
                sensor.sense(self._tick.q)
