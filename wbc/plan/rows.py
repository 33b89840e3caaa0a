"""The rows that every configuration of a path keeps, compiled from the expressions of the stack's own items."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from wbc.controller.core import Core
from wbc.errors import CommandError, CompileError
from wbc.native import toolchain
from wbc.native.compiled_function import generated_library
from wbc.native.library import load_library
from wbc.plan.coordinates import PlanningCoordinates
from wbc.plan.stand_in import MeasuredApart
from wbc.stack.layout import Block
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import Kinematics, Pose
from wbc.symbolic.tracer import Carrier, Tracer
from wbc.tasks import FrameVelocityLimit, MovingFrame
from wbc.tasks._linkage_speed import LinkageSpeed
from wbc.tasks.base import Constraint, Task
from wbc.tasks.inputs import as_value

#: Constraints that say nothing of configurations: of speeds, or of what measured bodies do, which the scene has
OTHERS = (MeasuredApart, FrameVelocityLimit, LinkageSpeed, MovingFrame)

_NUMBERS = ctypes.POINTER(ctypes.POINTER(ctypes.c_double))
_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int, _NUMBERS, _NUMBERS, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)


@dataclass(frozen=True, eq=False)
class PlanningRows:
    """Rows c(x, p) of the coordinates x and the run-time values p: equalities, which come first, and margins.

    Attributes:
        equalities, margins: how many.
        labels: of all rows, "item.row". units: theirs.
        function: (x, p) -> (c, dc/dx).
    """

    equalities: int
    margins: int
    labels: tuple[str, ...]
    units: tuple[str, ...]
    function: ca.Function
    _kept: list[Any] = field(default_factory=list, repr=False)

    @property
    def count(self) -> int:
        """All of them."""
        return self.equalities + self.margins

    def compiled(self) -> tuple[int, int, int]:
        """(address of the C function, sizes of its integer and real memory); it lives as long as this.

        Without a compiler it is one that calls CasADi's virtual machine.
        """
        if toolchain.available():
            try:
                library = load_library(generated_library(self.function.serialize(), self._text))
                self._kept.append(library)
                address = ctypes.cast(library.rows, ctypes.c_void_p).value or 0
                return address, int(self.function.sz_iw()), int(self.function.sz_w())
            except CompileError as error:
                toolchain.fall_back(str(error))
        joined = ca.Function(
            "joined", self.function.sx_in(), [ca.vertcat(*map(ca.vec, self.function(*self.function.sx_in())))]
        )
        call = _FUNCTION(_on_machine(SingleState(joined), self.count))
        self._kept.append(call)
        return ctypes.cast(call, ctypes.c_void_p).value or 0, 1, 1

    def _text(self) -> str:
        generator = ca.CodeGenerator("rows.c", {"with_header": False})
        generator.add(self.function)
        return str(generator.dump())


def _on_machine(state: SingleState, count: int) -> Callable[..., int]:
    parts = state.output[:count], state.output[count:]

    def call(given: Any, out: Any, _iw: int, _w: int, _memory: int) -> int:
        for k, array in enumerate(state.inputs):
            array[:] = given[k][: len(array)]
        state.run()
        for k, part in enumerate(parts):
            # Nobody asks for the derivatives where they are not needed
            if out[k] and len(part):
                np.ctypeslib.as_array(out[k], part.shape)[:] = part
        return 0

    return call


class RowsBuilder:
    """Rows of a stack for some tasks that are to be kept or met.

    Args:
        kept: names of tasks whose errors stay 0 on the whole path.
    """

    def __init__(self, core: Core, coordinates: PlanningCoordinates, kept: Collection[str]) -> None:
        self._core, self._coordinates, self._kept = core, coordinates, kept
        self._kinematics = Kinematics(core.stack.robot.model)
        self._p = ca.SX.sym("p", core.layout.parameters)

    def rows(self, goals: Collection[str] = ()) -> PlanningRows:
        """Those of a path, and of the tasks in ``goals`` besides.

        Raises:
            CommandError: a hard constraint says something of velocities that no configuration keeps.
        """
        equal, margins = list[tuple[Block, ca.SX]](), list[tuple[Block, ca.SX]]()
        for block in self._core.layout.blocks.values():
            entry, item = block.entry, block.entry.item
            if isinstance(item, Task):
                if entry.name in self._kept or entry.name in goals:
                    equal.append((block, self._expanded(block, item.error)))
                continue
            if isinstance(item, OTHERS) or entry.price is not None or not entry.hard or entry.level > 0:
                continue
            if not self._core.handles[entry.name].enabled or not isinstance(item, Constraint):
                continue
            if block.form == "margins":
                margins.append((block, self._expanded(block, item.margins)))
            elif block.form == "rows":
                self._check(block, item)
                error = self._expanded(block, item.residual)
                if error.numel():
                    equal.append((block, error))
        return self._joined(equal, margins)

    def _joined(self, equal: list[tuple[Block, ca.SX]], margins: list[tuple[Block, ca.SX]]) -> PlanningRows:
        x = ca.SX.sym("x", self._coordinates.count)
        q = self._coordinates.expression(x)
        labels, units, values = list[str](), list[str](), list[ca.SX]()
        for block, expression in [*equal, *margins]:
            inside = ca.substitute(expression, self._kinematics.q, q)
            rows = [k for k in range(inside.numel()) if not inside[k].is_zero()]
            # What is written in other units counts as much as a radian
            scale = [block.rows[k].scale(1.0) for k in rows]
            values.append(inside[rows] / ca.DM(scale))
            labels += [f"{block.entry.name}.{block.rows[k].label}" for k in rows]
            units += [block.rows[k].unit.removesuffix("/s") for k in rows]
        count = sum(v.numel() for v in values[: len(equal)])
        whole = ca.densify(ca.vertcat(ca.SX(0, 1), *values))
        function = ca.Function("rows", [x, self._p], ca.cse([whole, ca.densify(ca.jacobian(whole, x))]))
        return PlanningRows(count, whole.numel() - count, tuple(labels), tuple(units), function)

    def _expanded(self, block: Block, expression: Callable[..., ca.SX | None]) -> ca.SX:
        values = {name: as_value(slot.input, self._p[slot.span]) for name, slot in block.slots.items()}
        tracer = Tracer(self._kinematics, self._carrier(block))
        found = expression(self._core.stack.robot, tracer, values)
        return ca.SX(0, 1) if found is None else ca.SX(tracer.expanded(ca.SX(found))[0])

    def _carrier(self, block: Block) -> Carrier | None:
        if not block.entry.frame:
            return None
        slot = self._core.layout.blocks[block.entry.frame].slots["pose"]
        pose = as_value(slot.input, self._p[slot.span])
        assert isinstance(pose, Pose)
        return Carrier(pose, ca.SX(6, 1))

    def _check(self, block: Block, item: Constraint) -> None:
        """Refuse rows on velocities that are no rows on configurations.

        Raises:
            CommandError: they are such.
        """
        robot = self._core.stack.robot
        error = self._expanded(block, item.residual)
        free = error.numel() == 0 or any(error[k].is_zero() for k in range(error.numel()))
        coupled = type(item).__name__ == "Mechanism" and not robot.locked_dofs
        if free and not coupled:
            reason = "its rows are of velocities, which a path of configurations cannot keep; plan without it"
            raise CommandError(block.entry.name, type(item).__name__, reason)
