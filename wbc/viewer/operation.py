"""What a message does to a controller: targets, weights and switches, rates, and the stop that brakes within limits."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wbc import validation
from wbc.api import Controller
from wbc.controller import core_of
from wbc.controller.handle import Handle
from wbc.multibody import pin
from wbc.stack.layout import Block, Slot
from wbc.tasks import Posture
from wbc.tasks.base import Constraint, Task
from wbc.validation import Array
from wbc.viewer.messages import PAIRED, RATE_LASTS, WALKED, MessageError, value_of

#: What is dragged and has a velocity goes to where it was dragged at this speed at most [m/s, rad/s]
FASTEST = (1.0, 4.0)
#: Nearer than this it is there [m, rad]
ARRIVED = 1e-6


@dataclass(eq=False)
class FollowedPath:
    """Configurations ``q`` [n, nq], ``dt`` [s] apart, that the posture ``leader`` leads along, at a time [s].

    Attributes:
        kept: what was set before: (handle, name, value).
    """

    leader: str
    q: Array
    dt: float
    time: float = 0.0
    kept: list[tuple[Handle, str, Any]] = field(default_factory=list)


class Operation:
    """Obeys messages for one controller, between its ticks.

    **Stop** switches every task off. What is left of the QP is the least velocity under the constraints, so that joints
    brake as fast as their acceleration limits allow and no obstacle, limit or hold is given up for it. Where the stack
    commands accelerations, tasks keep their damping and lose stiffness and feed-forward. **Resume** puts the targets
    where the robot is and switches on what was on.

    A dragged obstacle does not jump: it goes there at no more than :data:`FASTEST`, and its ``velocity`` says so, so
    that links are moved out of its way in time.

    A path that is to be followed is led by the posture of all joints, with the weight of the task that it is for; that
    task and lighter ones are off until its end, or until something else is asked for.

    Attributes:
        stopped: the reason, or "" where the loop is not stopped. operated: somebody has control.
        note: what a page is told beside the ticks; another object where it has changed.
    """

    def __init__(self, controller: Controller) -> None:
        self._core = core_of(controller)
        self._command = self._core.layout.command
        self.stopped, self.operated, self.waiting = "", False, ""
        self.note: dict[str, Any] = {}
        #: value of each task before a stop: (handle, name, value)
        self._kept: list[tuple[Handle, str, Any]] = []
        self._goals: dict[str, pin.SE3] = {}
        self._rates: dict[str, tuple[Array, float]] = {}
        self._path: FollowedPath | None = None
        self.moving = False

    def obey(self, message: Mapping[str, Any]) -> None:
        """Do what a message says.

        Raises:
            WbcError: it names no item or value, or the value is none of that input; nothing has changed.
        """
        kind = message["type"]
        if kind == "stop":
            self.stop(str(message.get("reason", "stopped by the operator")))
        elif kind == "resume":
            self.resume()
        elif kind in ("operate", "release"):
            self.operated = kind == "operate"
        elif kind == "set":
            self._set(message["item"], message["values"])
        elif kind == "rate":
            self._rate(message["item"], message["rate"])
        elif kind == "follow":
            self._follow(message)
        else:
            raise MessageError("message.type", kind, _owner(kind))

    def check(self, message: Mapping[str, Any]) -> None:
        """Raise what :meth:`obey` would raise for values, and change nothing."""
        if message["type"] in (*WALKED, *PAIRED):
            raise MessageError("message.type", message["type"], _owner(message["type"]))
        if message["type"] == "follow":
            self._path_of(message)
        if message["type"] in ("set", "rate"):
            handle = self._handle(message["item"])
            if message["type"] == "rate":
                self._rate_of(handle, message["rate"])
            else:
                self._split(handle, message["values"])

    def stop(self, reason: str) -> None:
        """Brake, see the class; the first reason stays."""
        if self.stopped:
            return
        self.stopped = reason
        self._leave_path()
        for name in list(self._rates):
            self._end_rate(name)
        for name in list(self._goals):
            self._arrive(name)
        for name, block in self._core.layout.blocks.items():
            if block.form != "task":
                continue
            handle = self._core.handles[name]
            if self._command == "velocity":
                self._kept.append((handle, "enabled", handle.get("enabled")))
                handle.switch(False)
                continue
            for value in ("stiffness", "feedforward", "acceleration"):
                if value in block.slots:
                    self._kept.append((handle, value, handle.get(value)))
                    handle.set(**{value: np.zeros_like(self._kept[-1][2]) if value != "stiffness" else 0.0})

    def resume(self) -> None:
        """Go on from where the robot is."""
        if not self.stopped:
            return
        slots: dict[Slot, str] = {}
        for name, block in self._core.layout.blocks.items():
            if block.form == "task" and "target" in block.slots and block.slots["target"].input.default is None:
                slots[block.slots["target"]] = name
        self._core.initialise(slots, self._core.tick.q.copy())
        for handle, value, before in self._kept:
            if value == "enabled":
                handle.switch(before)
            elif value == "stiffness":
                handle.set(stiffness=before)
        self._kept, self.stopped = [], ""

    def advance(self, dt: float) -> None:
        """Move on what moves, for the next tick."""
        now = time.monotonic()
        for name, (rate, until) in list(self._rates.items()):
            if now > until:
                self._end_rate(name)
            else:
                self._shift(name, rate, dt)
        for name in list(self._goals):
            self._approach(name, dt)
        if self._path is not None:
            self._along(self._path, dt)
        self.moving = bool(self._rates or self._goals or self._path)

    # Values

    def _handle(self, item: Any) -> Handle:
        validation.one_of("message.item", item, self._core.handles)
        return self._core.handles[item]

    def _split(self, handle: Handle, values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """(inputs, other values), checked."""
        slots = self._core.layout.blocks[handle.item_name].slots
        inputs: dict[str, Any] = {}
        others: dict[str, Any] = {}
        for name, sent in values.items():
            validation.one_of(f"message.values of {handle.item_name}", name, handle.names)
            if name in slots:
                inputs[name] = value_of(slots[name].input.kind, sent)
                handle.checked(name, inputs[name])
            elif name == "enabled":
                others[name] = validation.flag(f"{handle.item_name}.enabled", sent)
            elif name == "weight":
                others[name] = validation.scalar(f"{handle.item_name}.weight", sent, low=0.0)
            else:
                raise MessageError(f"message.values.{name}", sent, "cannot be sent", [*slots, "enabled", "weight"])
        return inputs, others

    def _set(self, item: Any, values: Mapping[str, Any]) -> None:
        handle = self._handle(item)
        inputs, others = self._split(handle, values)
        name, block = handle.item_name, self._core.layout.blocks[handle.item_name]
        if self.stopped and block.form == "task":
            raise MessageError("message", name, f"the robot is stopped ({self.stopped}); resume first")
        if "pose" in inputs and "velocity" in block.slots and isinstance(block.entry.item, Constraint):
            goal = validation.pose(f"{name}.pose", inputs.pop("pose"))
            self._goals[name], self.moving = goal, True
        if "target" in inputs or (others and block.form == "task"):
            self._rates.pop(name, None)
            self._leave_path()
        handle.set(**inputs)
        for value, number in others.items():
            setattr(handle, value, number)

    def _rate_of(self, handle: Handle, sent: Any) -> Array:
        slots = self._core.layout.blocks[handle.item_name].slots
        rate = slots["target"].input.rate if "target" in slots else None
        if rate is None:
            raise MessageError("message.item", handle.item_name, "has no target that moves at a rate")
        return handle.checked(rate, sent)

    def _rate(self, item: Any, sent: Any) -> None:
        handle = self._handle(item)
        rate = self._rate_of(handle, sent)
        if self.stopped:
            raise MessageError("message", item, f"the robot is stopped ({self.stopped}); resume first")
        self._leave_path()
        if not rate.any():
            self._end_rate(handle.item_name)
            return
        self._rates[handle.item_name] = rate.copy(), time.monotonic() + RATE_LASTS
        self.moving = True

    def _path_of(self, message: Mapping[str, Any]) -> FollowedPath:
        robot, handle = self._core.stack.robot, self._handle(message["item"])
        leader = posture_of(self._core.layout.blocks, robot.nq)
        if not leader or self._command != "velocity" or not handle.is_of(Task):
            raise MessageError("message.item", handle.item_name, "a path leads a task, by a posture of all joints")
        rows = validation.real_array("message.q", message["q"])
        if rows.ndim != 2 or len(rows) < 2:
            raise MessageError("message.q", np.shape(rows), "expected two configurations or more")
        q = np.array([robot.configuration(f"message.q[{k}]", row) for k, row in enumerate(rows)])
        dt = validation.scalar("message.dt", message["dt"], low=0.0, open_low=True, unit="s")
        return FollowedPath(leader, q, dt)

    def _follow(self, message: Mapping[str, Any]) -> None:
        path = self._path_of(message)
        if self.stopped:
            raise MessageError("message", message["item"], f"the robot is stopped ({self.stopped}); resume first")
        self._leave_path()
        weight = float(self._core.handles[message["item"]].get("weight"))
        for name, block in self._core.layout.blocks.items():
            handle = self._core.handles[name]
            if block.form != "task" or name == path.leader:
                continue
            if name == message["item"] or float(handle.get("weight")) < weight:
                path.kept.append((handle, "enabled", handle.get("enabled")))
                handle.switch(False)
        leader = self._core.handles[path.leader]
        path.kept += [(leader, name, leader.get(name)) for name in ("enabled", "weight", "target", "feedforward")]
        for name, value in (("enabled", True), ("weight", weight)):
            setattr(leader, name, value)
        self._path, self.moving = path, True

    def _along(self, path: FollowedPath, dt: float) -> None:
        path.time += dt
        k = int(path.time / path.dt)
        if k >= len(path.q) - 1:
            self._leave_path()
            return
        robot, leader = self._core.stack.robot, self._core.handles[path.leader]
        rate = robot.difference(path.q[k], path.q[k + 1]) / path.dt
        leader.set(target=robot.integrate(path.q[k], rate, path.time - k * path.dt), feedforward=rate)

    def _leave_path(self) -> None:
        path, self._path = self._path, None
        for handle, name, value in [] if path is None else path.kept:
            setattr(handle, name, value)

    # Motion

    def _shift(self, name: str, rate: Array, dt: float) -> None:
        handle, slot = self._core.handles[name], self._core.layout.blocks[name].slots["target"]
        target, kind = handle.get("target"), slot.input.kind
        if kind == "pose":
            turn = turned(target.rotation, rate[3:] * dt)
            target = pin.SE3(turn, target.translation + rate[:3] * dt)
        elif kind == "rotation":
            target = turned(target, rate * dt)
        elif kind == "configuration":
            target = self._core.stack.robot.integrate(target, rate, dt)
        else:
            target = target + (rate if np.ndim(target) else float(rate[0])) * dt
        handle.set(**{"target": target, str(slot.input.rate): rate if np.ndim(rate) else float(rate)})

    def _end_rate(self, name: str) -> None:
        """The feed-forward ends with the rate."""
        if self._rates.pop(name, None) is not None:
            slots = self._core.layout.blocks[name].slots
            slot = slots[str(slots["target"].input.rate)]
            self._core.write(slot, np.zeros(slot.size))

    def _approach(self, name: str, dt: float) -> None:
        handle = self._core.handles[name]
        pose, goal = handle.get("pose"), self._goals[name]
        off = goal.translation - pose.translation
        turn = pin.log3(goal.rotation @ pose.rotation.T)
        need = max(float(np.linalg.norm(off)) / FASTEST[0], float(np.linalg.norm(turn)) / FASTEST[1])
        if need <= ARRIVED:
            self._arrive(name)
            return
        share = min(1.0, dt / need)
        step = pin.SE3(pin.exp3(share * turn) @ pose.rotation, pose.translation + share * off)
        # The pose is that of now, the velocity that until the next tick
        handle.set(pose=step if share < 1.0 else goal, velocity=np.concatenate([off, turn]) * (share / dt))

    def _arrive(self, name: str) -> None:
        del self._goals[name]
        slot = self._core.layout.blocks[name].slots["velocity"]
        self._core.write(slot, np.zeros(slot.size))


def posture_of(blocks: Mapping[str, Block], nq: int) -> str:
    """The name of the first posture of all joints among a stack's items, by which a path is followed; "": none."""
    for name, block in blocks.items():
        if isinstance(block.entry.item, Posture) and block.slots["target"].size == nq:
            return name
    return ""


def _owner(kind: str) -> str:
    """Who obeys a message that a stack does not."""
    return "only a walk obeys it" if kind in WALKED else "only an arm that is driven by pairs obeys it"


def turned(rotation: Array, angles: Array) -> Array:
    """exp([angles]) R, orthonormal again after any number of turns: X (3 I - X'X) / 2 squares what is missing."""
    turn: Array = pin.exp3(angles) @ rotation
    polished: Array = 0.5 * turn @ (3.0 * np.eye(3) - turn.T @ turn)
    return polished
