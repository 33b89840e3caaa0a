"""What a controller, its steps and its stack offer and packages above this one do.

Each of them puts its function here when it is imported, which ``import wbc`` does, so that no import points up.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

#: By ``wbc.explain``, for :meth:`wbc.Step.explain`: (a step's copy of its tick, what its controller's steps share,
#: status, what gave the command) -> Explanation
explain: Callable[..., Any]
#: By ``wbc.explain``, for :meth:`wbc.Step.derivative`: (the same two, item, value) -> numbers [nv, k]
derivative: Callable[..., Any]
#: By ``wbc.export``, for :meth:`wbc.Controller.export`: (controller, and its arguments) -> folder
export: Callable[..., Any]
#: By ``wbc.record``, for :meth:`wbc.Controller.record`: (controller, file, overwrite) -> Recorder
record: Callable[..., Any]
#: By ``wbc.ik``, for :meth:`wbc.Stack.inverse_kinematics`: (stack, goals, back end) -> InverseKinematics
inverse_kinematics: Callable[..., Any]
