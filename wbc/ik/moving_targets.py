"""Targets over a path coordinate: functions of it, or values at some coordinates with what lies between them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.tasks.base import Input
from wbc.validation import Array

#: Coordinate -> numbers in the parameters
Numbers = Callable[[float], Array]


class MovingTargets:
    """Targets of tasks, written into a controller's parameters.

    Args:
        targets: name of a task -> function of s, or a sequence with one target for each entry of s.
        s: increasing [count].

    Between two entries poses and rotations turn about one axis, a pose on a screw, configurations go along their
    joints, and other targets straight.

    Raises:
        UnknownNameError: no such task, or one without a target. ShapeError: another number of targets than of
            coordinates. WbcError: a target that is none.
    """

    def __init__(self, controller: CompiledStack, targets: Mapping[str, Any], s: Array) -> None:
        self._p = core_of(controller).tick.p
        targets = validation.mapping("targets", targets, "tasks to targets")
        #: between neighbouring coordinates all targets go straight
        self.smooth = not any(callable(given) for given in targets.values())
        self._parts: list[tuple[slice, Numbers]] = []
        robot = controller.stack.robot
        for name, given in targets.items():
            handle = controller[name]
            if callable(given):
                numbers = _called(functools.partial(handle.checked, "target"), given)
                numbers(float(s[0]))
            else:
                given = validation.items(f"targets[{name}]", given, f"{len(s)} targets, or a function of s")
                if len(given) != len(s):
                    raise ShapeError(f"targets[{name}]", len(given), f"expected a function of s, or {len(s)} targets")
                values = np.array([handle.checked("target", value) for value in given])
                numbers = _between(robot, core_of(controller).layout.blocks[name].slots["target"].input, s, values)
            self._parts.append((core_of(controller).layout.blocks[name].slots["target"].span, numbers))

    def aim(self, s: float) -> None:
        """Write the targets of a coordinate."""
        found = [(span, numbers(s)) for span, numbers in self._parts]
        for span, values in found:
            self._p[span] = values


def _called(checked: Callable[[Any], Array], function: Callable[[float], Any]) -> Numbers:
    return lambda s: checked(function(s))


def _between(robot: Robot, declared: Input, s: Array, values: Array) -> Numbers:
    def numbers(at: float) -> Array:
        k = int(np.searchsorted(s, at))
        if at == s[k]:
            return np.asarray(values[k])
        low, high = values[k - 1], values[k]
        share = float((at - s[k - 1]) / (s[k] - s[k - 1]))
        if declared.kind == "configuration":
            return np.asarray(pin.interpolate(robot.model, low, high, share))
        if declared.kind == "pose":
            return _flat(pin.SE3.Interpolate(_pose(low), _pose(high), share))
        if declared.kind == "rotation":
            first, last = (n.reshape(3, 3, order="F") for n in (low, high))
            turned: Array = first @ pin.exp3(share * pin.log3(first.T @ last))
            return turned.ravel(order="F")
        straight = (1.0 - share) * low + share * high
        return validation.unit_vector("target", straight) if declared.direction else straight

    return numbers


def _pose(numbers: Array) -> pin.SE3:
    return pin.SE3(numbers[:9].reshape(3, 3, order="F"), numbers[9:])


def _flat(pose: pin.SE3) -> Array:
    out: Array = np.ravel(pose.homogeneous[:3], order="F")
    return out
