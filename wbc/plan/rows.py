"""The rows that every configuration of a path keeps, compiled from the expressions of the stack's own items."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from wbc.controller.core import Core
from wbc.errors import CommandError
from wbc.plan.coordinates import PlanningCoordinates
from wbc.plan.rolling import SAME, RollingBase
from wbc.plan.stand_in import MeasuredApart
from wbc.stack.layout import Block
from wbc.symbolic.entry import CEntry
from wbc.symbolic.kinematics import Kinematics, Pose
from wbc.symbolic.tracer import Carrier, Tracer
from wbc.tasks import FrameVelocityLimit, MovingFrame
from wbc.tasks._linkage_speed import LinkageSpeed
from wbc.tasks.base import Constraint, Task, Values
from wbc.tasks.inputs import as_value
from wbc.validation import Array

#: Constraints that say nothing of configurations: of speeds, or of what measured bodies do, which the scene has
WITHOUT_CONFIGURATION = (MeasuredApart, FrameVelocityLimit, LinkageSpeed, MovingFrame)

#: Configurations besides the neutral one at which rows on velocities are looked at
LOOKS = 4


@dataclass(frozen=True, eq=False)
class PlanningRows:
    """Rows c(x, p) of the coordinates x and the run-time values p: equalities, which come first, and margins.

    Attributes:
        equalities, margins: how many.
        labels: of all rows, "item.row".
        function: (x, p) -> (c, dc/dx).
    """

    equalities: int
    margins: int
    labels: tuple[str, ...]
    function: ca.Function

    @property
    def count(self) -> int:
        """All of them."""
        return self.equalities + self.margins

    @cached_property
    def compiled(self) -> CEntry:
        """The function as C calls it."""
        return CEntry(self.function)

    def off(self, x: Array, p: Array) -> tuple[Array, Array]:
        """(values, by how much each does not hold, or less than 0) [rows]."""
        values = np.asarray(self.function(x, p)[0]).ravel()
        return values, np.concatenate([np.abs(values[: self.equalities]), -values[self.equalities :]])


class RowsBuilder:
    """Rows of a stack for some tasks that are to be kept or met.

    Args:
        kept: names of tasks whose errors stay 0 on the whole path.
    """

    def __init__(self, core: Core, coordinates: PlanningCoordinates, kept: Collection[str]) -> None:
        self._core, self._coordinates, self._kept = core, coordinates, kept
        self._kinematics = Kinematics(core.stack.robot.model)
        self._p = ca.SX.sym("p", core.layout.parameters)
        self._slips: dict[bytes, tuple[list[str], ca.Function]] = {}

    def rows(self, goals: Collection[str] = ()) -> PlanningRows:
        """Those of a path, and of the tasks in ``goals`` besides."""
        tasks = [
            (block, self._expanded(block, block.entry.item.error))
            for block in self._core.layout.blocks.values()
            if isinstance(block.entry.item, Task) and block.entry.name in {*self._kept, *goals}
        ]
        hard = list(self._hard())
        equal = [(block, self._expanded(block, item.residual)) for block, item in hard if block.form == "rows"]
        margins = [(block, self._expanded(block, item.margins)) for block, item in hard if block.form == "margins"]
        return self._joined([*tasks, *equal], margins)

    def _hard(self) -> Iterator[tuple[Block, Constraint]]:
        """Constraints that hold on a whole path."""
        for block in self._core.layout.blocks.values():
            entry, item = block.entry, block.entry.item
            counts = entry.price is None and entry.hard and entry.level == 0 and self._core.handles[entry.name].enabled
            if counts and isinstance(item, Constraint) and not isinstance(item, WITHOUT_CONFIGURATION):
                yield block, item

    def _joined(self, equal: list[tuple[Block, ca.SX]], margins: list[tuple[Block, ca.SX]]) -> PlanningRows:
        x = ca.SX.sym("x", self._coordinates.count)
        q = self._coordinates.expression(x)
        labels, values = list[str](), list[ca.SX]()
        for block, expression in [*equal, *margins]:
            inside = ca.substitute(expression, self._kinematics.q, q)
            rows = [k for k in range(inside.numel()) if not inside[k].is_zero()]
            # What is written in other units counts as much as a radian
            scale = [block.rows[k].scale(1.0) for k in rows]
            values.append(inside[rows] / ca.DM(scale))
            labels += [f"{block.entry.name}.{block.rows[k].label}" for k in rows]
        count = sum(v.numel() for v in values[: len(equal)])
        whole = ca.densify(ca.vertcat(ca.SX(0, 1), *values))
        function = ca.Function("rows", [x, self._p], ca.cse([whole, ca.densify(ca.jacobian(whole, x))]))
        return PlanningRows(count, whole.numel() - count, tuple(labels), function)

    def _traced(self, block: Block) -> tuple[Tracer, Values]:
        def values(block: Block) -> Values:
            return {name: as_value(slot.input, self._p[slot.span]) for name, slot in block.slots.items()}

        carrier = None
        if block.entry.frame:
            pose = values(self._core.layout.blocks[block.entry.frame])["pose"]
            assert isinstance(pose, Pose)
            carrier = Carrier(pose, ca.SX(6, 1))
        return Tracer(self._kinematics, carrier), values(block)

    def _expanded(self, block: Block, expression: Callable[..., ca.SX | None]) -> ca.SX:
        tracer, values = self._traced(block)
        traced = expression(self._core.stack.robot, tracer, values)
        return ca.SX(0, 1) if traced is None else ca.SX(tracer.expanded(ca.SX(traced))[0])

    def rolling(self, switches: bytes) -> RollingBase | None:
        """What hard rows on velocities, which no row on configurations stands for, leave of a base; None: none.

        Args:
            switches: which items are enabled.

        Raises:
            CommandError: other motions than a path can keep to.
        """
        if switches not in self._slips:
            self._slips[switches] = self._slip({block: item for block, item in self._hard() if block.form == "rows"})
        names, rows_of = self._slips[switches]
        if not names:
            return None
        robot, p, text = self._core.stack.robot, self._core.tick.p, ", ".join(names)
        ways = [np.zeros(robot.nv), *np.random.default_rng(0).uniform(-1.0, 1.0, (LOOKS, robot.nv))]
        samples = np.array([np.asarray(rows_of(robot.integrate(robot.neutral, way), p)) for way in ways])
        asked = float(np.abs(samples[:, :, -1]).max())
        if not asked <= SAME:
            raise CommandError(text, asked, "its rows ask for a velocity; plan without it")
        return RollingBase.of_rows(text, robot, samples[:, :, :-1])

    def _slip(self, hard: Mapping[Block, Constraint]) -> tuple[list[str], ca.Function]:
        """Items with rows on velocities alone, and (q, p) -> (A, their sides)."""
        robot, layout = self._core.stack.robot, self._core.layout
        matrices, names = [ca.SX(0, robot.nv + 1)], list[str]()
        for block, item in hard.items():
            error, first = self._expanded(block, item.residual), len(robot.couplings) * (block is layout.mechanism)
            rows = [k for k in range(first, len(block.rows)) if not error.numel() or error[k].is_zero()]
            if not rows:
                continue
            tracer, values = self._traced(block)
            found = item.velocity_rows(robot, tracer, values, ca.SX(self._core.stack.dt))
            assert found is not None
            matrix, *sides = tracer.expanded(found.matrix, found.lower, found.upper)
            if matrix.shape[1] != robot.nv:
                reason = "it rolls in a frame that moves; plan without it"
                raise CommandError(block.entry.name, type(item).__name__, reason)
            names.append(block.entry.name)
            matrices += [ca.horzcat(matrix[rows, :], side[rows]) for side in sides]
        return names, ca.Function("slip", [self._kinematics.q, self._p], [ca.densify(ca.vertcat(*matrices))])
