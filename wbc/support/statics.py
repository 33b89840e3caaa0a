"""Static equilibrium as linear rows in the wrenches of contacts, from the QP of a tick of torques at rest.

At zero velocity and acceleration the rows of that QP on a floating base, torques and cones are

    h - J'w = 0 (base),    -T <= h - J'w <= T,    F w >= b,    sum of wrenches = target

in the wrenches w alone: with the loads, limits, masks and switches that the controller has at present.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.errors import CommandError, SolverError
from wbc.linear_program import least
from wbc.stack.layout import Slot
from wbc.tasks._contact import ContactWrench, Unactuated
from wbc.tasks.base import Constraint
from wbc.tasks.wrench_sum import WrenchSum
from wbc.tick.buffers import INFINITE
from wbc.tick.native import CompiledTick
from wbc.validation import Array

#: What is lacking counts from this share of a row's size on
COUNTS = 1e-7
#: How much dearer it is to lack a force on the base than one of the contacts and motors
BASE_PRICE = 1e3


@dataclass(frozen=True)
class Lacking:
    """A row that no wrenches of the contacts keep at rest, and by how much [N, N m]."""

    item: str
    row: str
    amount: float
    unit: str

    def __str__(self) -> str:
        return f"{self.item}/{self.row} by {self.amount:.3g} {self.unit}"


@dataclass(frozen=True, eq=False)
class Statics:
    """Rows lower <= A w <= upper of a controller at rest.

    Attributes:
        A: rows x wrench components. lower, upper: [rows]. sizes: what counts as much as 1 rad, row by row.
        base: which rows are those of the floating base. torques: of motors.
        names: item, row and unit of each. scale: the same for the components.
    """

    A: Array
    lower: Array
    upper: Array
    sizes: Array
    base: NDArray[np.bool_]
    torques: NDArray[np.bool_]
    names: tuple[tuple[str, str, str], ...]
    scale: Array


class TorqueRows:
    """General rows of ticks that command torques.

    Attributes:
        place: of rows on forces: of the base, motors and wrenches; ``base``, ``torques``, ``names`` and ``sizes`` of
            these are as in :class:`Statics`. held: of equalities on motions. scale: of all variables of the QP.
    """

    def __init__(self, controller: CompiledStack) -> None:
        core = core_of(controller)
        if core.layout.command != "torque":
            reason = f'this controller commands {core.layout.command}; compile the stack with command="torque"'
            raise CommandError("controller", core.layout.command, reason)
        self.core, self.layout, self.stack = core, core.layout, core.stack
        held: list[int] = []
        place, names, base, torques, sizes = [], [], [], [], []
        self._rates: list[tuple[int, list[Slot]]] = []
        for block in self.layout.of_form("margins", "rows"):
            item = block.entry.item
            assert isinstance(item, Constraint)
            motors = type(item).torque_rows is not Constraint.torque_rows and not isinstance(item, Unactuated)
            if not (motors or isinstance(item, (ContactWrench, WrenchSum, Unactuated))):
                if block.form == "rows" and item.equality:
                    held += range(block.start, block.start + len(block.rows))
                    slots = [block.slots[name] for name in ("rate", "gain") if name in block.slots]
                    self._rates.append((len(block.rows), slots if len(slots) == 2 else []))
                continue
            for k, row in enumerate(block.rows):
                place.append(block.start + k)
                names.append((block.entry.name, row.label, row.unit))
                base.append(isinstance(item, Unactuated))
                torques.append(motors)
                sizes.append(row.scale(self.stack.length))
        self.place, self.held = np.array(place, np.intp), np.array(held, np.intp)
        self.names, self.sizes = tuple(names), np.array(sizes)
        self.base, self.torques = np.array(base, bool), np.array(torques, bool)
        self.scale = self.layout.dof_scales(self.stack)
        self._tick: CompiledTick | None = None

    @property
    def returning(self) -> Array:
        """What a held row off by e asks for at rest is -returning e [1/s^2]; 0 where it says nothing of places."""
        p = self.core.assembly.p
        parts = [
            np.full(n, np.prod([float(p[s.span][0]) for s in slots]) if slots else 0.0) for n, slots in self._rates
        ]
        return np.concatenate([*parts, np.zeros(0)])

    def at(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """A, lower and upper of all general rows of the QP in a state, with the values of inputs as they are at the
        first call.

        Raises:
            SolverError: numbers that are not finite, such as values of inputs that nobody has set.
        """
        core = self.core
        if core.waiting:
            core.take_first(q)
        if self._tick is None:
            self._tick = core.assembly.twin()
            self._tick.state[:] = core.assembly.state
        tick = self._tick
        tick.forget()
        tick.q[:], tick.v_in[:], tick.use_v[0] = q, 0.0, 1.0
        tick.v_in[: len(v)] = v
        tick.check()
        with np.errstate(all="ignore"):
            qp = tick.qp()
        ends = (
            np.where(np.abs(x) >= INFINITE, np.copysign(np.inf, x), x) for x in (qp.lower[qp.n :], qp.upper[qp.n :])
        )
        lower, upper = ends
        if not np.isfinite(qp.A).all() or np.isnan(lower).any() or np.isnan(upper).any():
            raise SolverError("q", q, "the rows of this configuration are not finite")
        return qp.A.copy(), lower, upper


def statics(controller: CompiledStack, q: Any) -> Statics:
    """The rows at a configuration.

    Raises:
        CommandError: the controller does not command torques. ShapeError, NotFiniteError: q.
        SolverError: numbers that are not finite, such as values of inputs that nobody has set.
    """
    rows = TorqueRows(controller)
    robot = rows.stack.robot
    A, lower, upper = rows.at(robot.configuration("q", q), np.zeros(robot.nv))
    at, nv = rows.place, robot.nv
    scale = rows.scale[nv : A.shape[1]]
    return Statics(A[at, nv:], lower[at], upper[at], rows.sizes, rows.base, rows.torques, rows.names, scale)


def lacking(controller: CompiledStack, q: Any) -> tuple[Lacking, ...]:
    """What contacts and motors lack to hold the robot at rest at a configuration, the worst first; empty where they
    can.

        minimise  sum s_i / size_i     over w and s >= 0 with  lower - s <= A w <= upper + s

    so that few rows are named: a foot that cannot bear the load by the newtons that it is short of, a motor by its
    newton metres, and the base where contacts that only push have no wrench against its weight at all.

    Args:
        controller: of a stack that commands torques, with the values of its inputs as they are. q: configuration [nq].

    Raises:
        CommandError, ShapeError, NotFiniteError, SolverError: see :func:`statics`.
    """
    found = statics(controller, q)
    return least_lack(found, q)


def least_lack(found: Statics, q: Any) -> tuple[Lacking, ...]:
    """See :func:`lacking`, of any rows."""
    count, rows = found.A.shape[1], len(found.lower)
    if not rows:
        return ()
    wide = found.A * found.scale / found.sizes[:, None]
    price = np.concatenate([np.zeros(count), np.where(found.base, BASE_PRICE, 1.0)])
    sides, limits = [], []
    for sign, end in ((1.0, found.upper), (-1.0, -found.lower)):
        on = np.isfinite(end)
        sides.append(np.hstack([sign * wide, -np.eye(rows)])[on])
        limits.append((end / found.sizes)[on])
    bounds = [(None, None)] * count + [(0.0, None)] * rows
    answer = least(price, np.vstack(sides), np.concatenate(limits), bounds=bounds)
    short = answer.x[count:]
    order = np.argsort(-short)
    named = ((found.names[k], short[k] * found.sizes[k]) for k in order if short[k] > COUNTS)
    return tuple(Lacking(item, row, float(amount), unit) for (item, row, unit), amount in named)
