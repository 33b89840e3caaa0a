"""What a controller, its steps and its stack offer and packages above this one do: imported when it is used."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any


def _above(module: str, name: str) -> Callable[..., Any]:
    """A function or class of a package above, which is imported when it is called."""

    def call(*arguments: Any) -> Any:
        return getattr(importlib.import_module(module), name)(*arguments)

    return call


#: For :meth:`wbc.Step.explain`: (a step's copy of its tick, what its controller's steps share, status, what gave the
#: command) -> Explanation
explain = _above("wbc.explain", "explain")
#: For :meth:`wbc.Step.derivative`: (the same two, item, value) -> numbers [nv, k]
derivative = _above("wbc.explain", "derivative")
#: For ``Policy.escape``: (the same two, the way out so far or None) -> step of the joints [nv], or None
escape = _above("wbc.explain", "escape")
#: For :meth:`wbc.Controller.record`: (controller, file, overwrite) -> Recorder
record = _above("wbc.record", "record")
#: For :meth:`wbc.Stack.inverse_kinematics`: (stack, goals, back end) -> InverseKinematics
inverse_kinematics = _above("wbc.ik", "InverseKinematics")
#: For :meth:`wbc.Controller.batch`: (controller, count, threads) -> Batch
batch = _above("wbc.batch", "Batch")
#: For :meth:`wbc.Controller.export`: (controller, and its arguments) -> folder
export = _above("wbc.export", "export")
