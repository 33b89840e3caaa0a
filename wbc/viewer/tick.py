"""A tick as the viewer has it: its step again, poses of frames, values of items, from the bytes of its state."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.api import Controller
from wbc.controller import Step, core_of
from wbc.multibody import pin
from wbc.stack.layout import Block
from wbc.symbolic.kinematics import WORLD
from wbc.tasks.base import Item
from wbc.validation import Array
from wbc.viewer.link import SharedTick


class Tick:
    """One state of a controller, looked at.

    Attributes:
        number, time: of the tick. step: the step that the loop had. q: configuration.
    """

    def __init__(self, controller: Controller, state: SharedTick) -> None:
        core = core_of(controller)
        self.number, self.time, self.state = state.number, state.time, state
        self.step = Step(state.data, core.context)
        self._memory, self._layout, self._stack = core.context.memory, core.layout, controller.stack
        self._numbers = np.frombuffer(state.data)
        robot = controller.stack.robot
        self.robot = robot
        self.q = self.part("q")
        self._data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, self._data, self.q)

    def block(self, item: str) -> Block:
        """An item's place in the layout."""
        return self._layout.blocks[item]

    def part(self, name: str) -> Array:
        """A part of the tick's memory."""
        return self._numbers[self._memory[name]]

    def pose(self, frame: str) -> pin.SE3:
        """Of a frame in the world."""
        if frame == WORLD:
            return pin.SE3.Identity()
        return self._data.oMf[self.robot.model.getFrameId(frame)]

    def joint(self, number: int) -> pin.SE3:
        """A joint's place in the world, by its number in the model."""
        return self._data.oMi[number]

    def center_of_mass(self) -> Array:
        """In the world [3]."""
        return np.asarray(pin.centerOfMass(self.robot.model, self.robot.model.createData(), self.q))

    def numbers(self, item: str, value: str) -> Array | None:
        """An input's numbers in the buffer, None where the item has no such input."""
        slot = self._layout.blocks[item].slots.get(value)
        return None if slot is None else self.part("p")[slot.span]

    def is_on(self, block: Block) -> bool:
        """Any of an item's rows counts."""
        if block.form == "task":
            return bool(self.part("weight")[block.span].any())
        if block.form == "bounds":
            nv = self._layout.variables
            return bool(self.part("bound_enabled")[block.start * nv : (block.start + len(block.rows)) * nv].any())
        return bool(self.part("enabled")[block.span].any())

    def reference(self, name: str) -> pin.SE3:
        """The frame that an item's target or pose is given in, in the world."""
        entry = self._stack[name]
        if entry.frame:
            numbers = self.numbers(entry.frame, "pose")
            assert numbers is not None
            return se3(numbers)
        return self.pose(relative_to(entry.item))

    def world_pose(self, name: str, value: str) -> pin.SE3 | None:
        """An input that is a pose, or a position, in the world; None for other inputs."""
        slot, numbers = self._layout.blocks[name].slots.get(value), self.numbers(name, value)
        if slot is None or numbers is None:
            return None
        if slot.input.kind == "pose":
            return self.reference(name) * se3(numbers)
        if slot.input.kind == "vector" and slot.size == 3 and slot.input.unit == "m":
            reference = self.reference(name)
            return pin.SE3(reference.rotation, reference.act(numbers))
        return None


def se3(numbers: Array) -> pin.SE3:
    """A pose from the 12 numbers of a buffer."""
    return pin.SE3(numbers[:9].reshape(3, 3, order="F"), numbers[9:])


def relative_to(item: Item) -> str:
    """The frame of the robot that an item's target is given in."""
    frame: Any = getattr(item, "relative_to", getattr(item, "frame_a", WORLD))
    return frame if isinstance(frame, str) else WORLD
