"""From declared items to one CasADi function: task rows, constraint rows and bounds at (q, v, inputs, dt).

Outputs of ``rows(q, v, p, dt)`` (MT task rows, MC general rows, NB bound blocks, MH margins):

    error   MT       e of every task row
    desired    MT       -gain e - de/dt, the rate that the row asks for
    factor  MT       fading factor in [0, 1]
    jt      nv x MT  sparse, de/dq transposed: the columns are the rows of J
    at      nv x MC  sparse, general constraint rows transposed
    low     MC       lower side of general rows
    high    MC       upper side
    margin  MH       h of every margin row
    margin_factor  MH  factor in [0, 1] by which a margin row is faded
    bound_low, bound_high   nv x NB

nv counts the variables of the QP here, which may be more than the velocities, see :mod:`wbc.stack.shares`.
The tick forms H = sum w (factor J)'J + damping and g from these, so that the compiled expression stays
small and levels have their rows. ``ahead(q, v, p, dt)`` is h(q (+) v dt) with moving
inputs advanced by their rates. ``curvature(q, v, p, dt, force)`` is the upper triangle of sum_k pull_k d2(e_k)/dq2, the
curvature of the errors of the first level's tasks, then of those that equality rows keep, for a weight ``force`` on
each row, as far as it comes from the robot's links; see :mod:`wbc.symbolic.curvature`. ``lost(q, v, p, dt)`` is by how
much the errors that equality rows A v = b keep change until q (+) v dt, e(q (+) v dt) - e, one entry a general row:
without (A v) dt it is how far they bend. Rates of what moves beside are taken from it. ``arrival(q, v, p, dt)``, of
accelerations with loops, is q (+) v dt with the residuals and rows of the mechanism there.

Of a stack that commands accelerations or torques the variables are a, and the wrenches of contacts, in place of v: see
:mod:`wbc.stack.second`. Then ``torque(q, v, p, dt, x, enabled)`` are the torques of the joints, and ``ahead`` takes the
mean velocity until the next tick.

Of velocities the rows of :meth:`Constraint.ball_rows` are left to the loop in ``native/balls.h``: here they have no
entries, and ``low`` and ``margin`` are 0. Sensed rows have no entries either (``native/sensed.h``). Both need:

    segment  segments x 6   (middle; axis) of every link core, of ``rows`` and of ``ahead``
    screw    6 x nv         (linear at the origin of the world; angular) of every degree of freedom, of ``rows``
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np

from wbc.errors import ShapeError
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.stack.declaration import Declaration, bends
from wbc.stack.distances import Balls, Sensed
from wbc.stack.layout import Block, Layout, Slot
from wbc.stack.shares import kept_direction, speeds, unlimited, widened
from wbc.symbolic import rotations as rot
from wbc.symbolic.curvature import AppliedForce, curvature
from wbc.symbolic.kinematics import Kinematics, Pose
from wbc.symbolic.operators import quick_operators
from wbc.symbolic.tracer import Carrier, Tracer
from wbc.tasks._direction import Direction
from wbc.tasks.base import Bounds, Constraint, Rows, Task
from wbc.tasks.inputs import as_value
from wbc.tasks.mechanism import Mechanism

if TYPE_CHECKING:
    from wbc.stack.second import SecondOrder

ROWS_OUTPUTS = (
    "error",
    "desired",
    "factor",
    "jt",
    "at",
    "low",
    "high",
    "margin",
    "bound_low",
    "bound_high",
    "margin_factor",
)


@dataclass(frozen=True, eq=False)
class TickProgram:
    """The compiled-to-be functions of a stack; ``ahead`` is None where there are no margins, ``curvature`` where no
    task has any or the stack does not want it; ``torque`` where none is commanded; ``lost`` where no equality row
    bends, ``arrival`` where a tick closes no loops; ``balls`` and ``sensed`` are rows that are left to loops.
    """

    rows: ca.Function
    ahead: ca.Function | None
    curvature: ca.Function | None
    torque: ca.Function | None = None
    balls: Balls = field(default_factory=Balls)
    sensed: Sensed = field(default_factory=Sensed)
    lost: ca.Function | None = None
    arrival: ca.Function | None = None

    @property
    def functions(self) -> dict[str, ca.Function]:
        """Those that exist, by name."""
        every = {"rows": self.rows, "ahead": self.ahead, "curvature": self.curvature, "torque": self.torque}
        every |= {"lost": self.lost, "arrival": self.arrival}
        return {name: function for name, function in every.items() if function is not None}


def loops(stack: Declaration) -> bool:
    """Whether the C of its tick has loops for distances: they know first derivatives."""
    return stack.command == "velocity"


def left_to_loops(stack: Declaration, layout: Layout) -> tuple[Balls, Sensed]:
    """Rows of a stack that its functions leave to loops."""
    return (Balls.of(stack, layout), Sensed.of(stack, layout)) if loops(stack) else (Balls(), Sensed())


def loaded(stack: Declaration, layout: Layout, functions: Mapping[str, ca.Function]) -> TickProgram:
    """The program of a stack whose functions were built before."""
    balls, sensed = left_to_loops(stack, layout)
    others = {name: functions.get(name) for name in ("ahead", "curvature", "torque", "lost", "arrival")}
    return TickProgram(functions["rows"], **others, balls=balls, sensed=sensed)


#: Expressions of robots whose stacks were built, for as long as the robots live
_KNOWN: WeakKeyDictionary[Robot, Kinematics] = WeakKeyDictionary()


def _kinematics_of(robot: Robot) -> Kinematics:
    """The same for all stacks of a robot, as they ask for the same frames."""
    known = _KNOWN.get(robot)
    if known is None:
        known = _KNOWN[robot] = Kinematics(robot.tree)
    return known


class _ProgramBuilder:
    def __init__(self, stack: Declaration, layout: Layout) -> None:
        self.stack, self.layout, self.loops = stack, layout, loops(stack)
        self.balls, self.sensed = left_to_loops(stack, layout)
        self.kinematics = _kinematics_of(stack.robot)
        self.p = ca.SX.sym("p", layout.parameters)
        self.dt = ca.SX.sym("dt")
        self.force = ca.SX.sym("force", layout.task_rows + layout.general_rows)
        self.forces: list[AppliedForce] = []
        self.tasks: dict[str, tuple[ca.SX, ca.SX, ca.SX, ca.SX]] = {}
        self.second = self._second_order() if stack.command != "velocity" else None

    def _second_order(self) -> SecondOrder:
        """It comes with the dynamics, which most stacks do without."""
        from wbc.stack.second import SecondOrder

        return SecondOrder(self)

    @cached_property
    def later(self) -> ca.SX:
        """q (+) v dt."""
        return self.kinematics.integrate(self.kinematics.q, self.kinematics.v * self.dt)

    def values(self, block: Block) -> dict[str, ca.SX | Pose]:
        """What the item's expressions receive for its inputs."""
        return {name: as_value(slot.input, self.p[slot.span]) for name, slot in block.slots.items()}

    def carrier(self, block: Block) -> Carrier | None:
        """The moving frame that the item is stated in."""
        if not block.entry.frame:
            return None
        frame = self.layout.blocks[block.entry.frame]
        pose = as_value(frame.slots["pose"].input, self.p[frame.slots["pose"].span])
        assert isinstance(pose, Pose)
        return Carrier(pose, self.speed(frame, frame.slots["pose"], mean=self.second is None))

    def tracer(self, block: Block) -> Tracer:
        """What the item sees of the robot."""
        return Tracer(self.kinematics, self.carrier(block))

    def moving(self, block: Block) -> list[tuple[Block, Slot]]:
        """Inputs that have a rate, with their blocks: the item's, and those of the frame that it is stated in."""
        blocks = [block, *([self.layout.blocks[block.entry.frame]] if block.entry.frame else [])]
        return [(b, slot) for b in blocks for slot in b.slots.values() if slot.input.rate is not None]

    def speed(self, block: Block, slot: Slot, mean: bool) -> ca.SX:
        """Rate of an input, as the user gives it, now or its mean over the tick, where it has a rate of its own."""
        rate = block.slots[slot.input.rate or ""]
        own = self.p[rate.span]
        if rate.input.rate is None or not mean:
            return own
        return own + 0.5 * self.dt * self.p[block.slots[rate.input.rate].span]

    def rate(self, block: Block, slot: Slot) -> ca.SX:
        """Time derivative of the numbers of an input that has a rate."""
        speed = self.speed(block, slot, mean=self.second is None)
        part = self.p[slot.span]
        if slot.input.kind == "pose":
            return ca.vertcat(rot.rotation_rate(ca.reshape(part[:9], 3, 3)) @ speed[3:], speed[:3])
        if slot.input.kind == "rotation":
            return rot.rotation_rate(ca.reshape(part, 3, 3)) @ speed
        if slot.input.kind == "configuration":
            return self.kinematics.tangent_map_at(part) @ speed
        return speed

    def drift(self, block: Block, expression: ca.SX) -> ca.SX:
        """Partial time derivative of an item's expression through its moving inputs."""
        total = ca.SX(expression.numel(), 1)
        for owner, slot in self.moving(block):
            total = total + ca.jacobian(expression, self.p[slot.span]) @ self.rate(owner, slot)
        return ca.sparsify(total)

    def midway(self, block: Block, matrix: ca.SX, rest: ca.SX) -> tuple[ca.SX, ca.SX]:
        """(A, c) of the mean of a rate A(q) v + c(q) over the tick, of an item in a moving frame; else as they are:

            (2 A_m - A) v + c_m - (A_m - A) v_last

        A_m, c_m are those of half a tick later, at the last velocity and mean rates of what moves; the other terms are
        what v has changed since. What is left is of second order in dt.
        """
        if not block.entry.frame or self.second is not None:
            return matrix, rest
        q, v = self.kinematics.q, self.kinematics.v
        half = self.kinematics.integrate(q, 0.5 * self.dt * v), self.advanced(block, 0.5 * self.dt)
        rates = ca.Function("rates", [q, v, self.p, self.dt], [matrix, rest])
        later, rest = rates(half[0], v, half[1], self.dt)
        turned = later - matrix
        return later + turned, rest - turned @ v

    def advanced(self, block: Block, dt: ca.SX) -> ca.SX:
        """The parameter vector with this block's moving inputs ``dt`` later; their rates keep the mean of the tick."""
        out = ca.SX(self.p)
        for owner, slot in self.moving(block):
            if any(other.input.rate == slot.input.name for other in owner.slots.values()):
                continue
            speed = self.speed(owner, slot, mean=True)
            part = self.p[slot.span]
            if slot.input.kind in ("pose", "rotation"):
                angular = speed[3:] if slot.input.kind == "pose" else speed
                turn = rot.from_quaternion(rot.exp3(angular * dt)) @ ca.reshape(part[:9], 3, 3)
                moved = ca.vec(turn)
                if slot.input.kind == "pose":
                    moved = ca.vertcat(moved, part[9:] + speed[:3] * dt)
            elif slot.input.kind == "configuration":
                moved = self.kinematics.integrate(part, speed * dt)
            else:
                moved = part + speed * dt
            out[slot.span] = moved
        return out

    def columns(self, transposed: ca.SX) -> ca.SX:
        """Rows of a task over all variables, as columns."""
        return transposed if self.second is not None else widened(self.layout, transposed)

    def column(self, block: Block, what: str, expression: ca.SX) -> ca.SX:
        """The expression as a dense column of the declared number of rows."""
        expression = ca.SX(expression)
        if expression.shape[1] != 1 or expression.shape[0] != len(block.rows):
            where = f"{block.entry.name}.{what}"
            raise ShapeError(
                where, expression.shape, f"expected a column of {len(block.rows)} rows, as rows() declares"
            )
        return ca.densify(expression)

    def task(self, block: Block) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """error, desired, factor, J of a task."""
        item = block.entry.item
        assert isinstance(item, Task)
        if self.second is not None:
            return self.second.task(block)
        robot, tracer, inputs = self.stack.robot, self.tracer(block), self.values(block)
        error = self.column(block, "error", item.error(robot, tracer, inputs))
        own = item.jacobian(robot, tracer, inputs)
        jacobian = tracer.slope(error) if own is None else ca.SX(own)
        if self.stack.calm and block.span.stop <= self.layout.leading:
            self.forces += tracer.forces(ca.dot(self.force[block.span], error))
        gain = self.p[block.slots["gain"].span]
        fade = item.row_factor(robot, tracer, inputs)
        factor = ca.SX.ones(len(block.rows)) if fade is None else self.column(block, "row_factor", fade)
        error, drift, factor, jacobian = tracer.expanded(error, self.drift(block, error), factor, jacobian)
        jacobian, drift = self.midway(block, jacobian[:, : robot.nv], drift + ca.sum2(jacobian[:, robot.nv :]))
        out = self.tasks[block.entry.name] = error, -gain * error - drift, factor, jacobian
        return out

    def general(self, block: Block) -> tuple[Rows, ca.SX | None, ca.SX | None]:
        """Rows of a constraint over all variables, its margins and their factors."""
        item = block.entry.item
        if isinstance(item, Direction):
            rows, margin, factor = kept_direction(self.stack, self.layout, block, *self.tasks[item.of][1:]), None, None
        elif self.second is not None:
            rows, margin, factor = self.second.constraint(block)
        else:
            rows, margin, factor = self.constraint(block)
            rows = Rows(widened(self.layout, rows.matrix.T).T, rows.lower, rows.upper)
        return rows, margin, factor

    def constraint(self, block: Block) -> tuple[Rows, ca.SX | None, ca.SX | None]:
        """Rows on v of a constraint, its margins and their factors."""
        item = block.entry.item
        assert isinstance(item, Constraint)
        robot, tracer, inputs = self.stack.robot, self.tracer(block), self.values(block)
        count = len(block.rows)
        if block.form == "rows":
            if self.layout.leading and (kept := self.residual(block, tracer, curved=True)) is not None:
                start = self.layout.task_rows + block.start
                self.forces += tracer.forces(ca.dot(self.force[start : start + count], kept))
            rows = item.velocity_rows(robot, tracer, inputs, self.dt)
            assert rows is not None
            low, high = self.column(block, "lower", rows.lower), self.column(block, "upper", rows.upper)
            matrix, low, high = tracer.expanded(ca.SX(rows.matrix), low, high)
            matrix, rest = self.midway(block, matrix[:, : robot.nv], ca.sum2(matrix[:, robot.nv :]))
            return Rows(matrix, low - rest, high - rest), None, None
        if block.entry.name in self.balls:
            return (
                Rows(ca.SX(count, self.layout.nv), ca.SX(count, 1), ca.SX.inf(count)),
                ca.SX(count, 1),
                ca.SX.ones(count),
            )
        margins = item.margins(robot, tracer, inputs)
        assert margins is not None
        margin = self.column(block, "margins", margins)
        rate = self.p[block.slots["rate"].span]
        fade = item.row_factor(robot, tracer, inputs)
        factor = ca.SX.ones(count) if fade is None else self.column(block, "row_factor", fade)
        sensed = item.sensed_rows(robot)
        if self.stack.calm and self.stack.command == "velocity" and self.layout.leading and block.entry.price is None:
            start = self.layout.task_rows + block.start
            self.forces += tracer.forces(
                ca.dot(self.force[start : start + count - sensed], margin[: count - sensed, :])
            )
        matrix = tracer.slope(margin[: count - sensed, :])
        margin, drift, factor, matrix = tracer.expanded(margin, self.drift(block, margin), factor, matrix)
        own = slice(count - sensed), slice(None)  # of one row alone, drift[:0] would lie down
        matrix, drift[own] = self.midway(block, matrix, drift[own])
        if sensed:
            empty = ca.SX(sensed, self.layout.nv)
            matrix = ca.vertcat(matrix, empty if self.loops else self.sensed_matrix(block, sensed))
        rows = Rows(matrix, -rate * margin - drift, ca.SX.inf(count))
        return rows, margin, factor

    def residual(self, block: Block, tracer: Tracer, curved: bool = False) -> ca.SX | None:
        """What equality rows keep at 0; None for others and for those that may give way at a price. ``curved``: for its
        second derivatives.
        """
        item = block.entry.item
        assert isinstance(item, Constraint)
        if self.stack.command != "velocity" or not bends(block.entry):
            return None
        find = item.curved if curved else item.residual
        kept = find(self.stack.robot, tracer, self.values(block))
        return None if kept is None else self.column(block, "residual", kept)

    def lost(self, block: Block) -> ca.SX:
        """How far e of equality rows is from e(q) at q (+) v dt, less what moves beside within dt; see the module."""
        tracer, item = self.tracer(block), block.entry.item
        kept = self.residual(block, tracer)
        if kept is None or not isinstance(item, Constraint):
            return ca.SX(len(block.rows), 1)
        rows = item.velocity_rows(self.stack.robot, tracer, self.values(block), self.dt)
        assert rows is not None
        own = ca.SX(kept.numel(), 1)
        for owner, slot in self.moving(block):
            if owner is block:
                own += ca.jacobian(kept, self.p[slot.span]) @ self.rate(owner, slot)
        keeps = ca.DM([float(not kept[k].is_zero()) for k in range(kept.numel())])
        kept, own, matrix = tracer.expanded(kept, own, ca.SX(rows.matrix))
        nv = self.stack.robot.nv
        _, rest = self.midway(block, matrix[:, :nv], ca.sum2(matrix[:, nv:]) + own)
        later = ca.Function("kept", [self.kinematics.q, self.p], [kept])(self.later, self.advanced(block, self.dt))
        return ca.sparsify(keeps * (later - kept - rest * self.dt))

    def arrival(self) -> list[ca.SX]:
        """q (+) v dt, there the residuals of the mechanism's rows, and their columns in groups of four."""
        block = self.layout.mechanism
        assert block is not None
        assert isinstance(block.entry.item, Mechanism)
        tracer, inputs = self.tracer(block), self.values(block)
        kept = block.entry.item.residual(self.stack.robot, tracer, inputs)
        rows = block.entry.item.velocity_rows(self.stack.robot, tracer, inputs, self.dt)
        assert kept is not None
        columns = ca.vertcat(rows.matrix, ca.SX(-len(block.rows) % 4, self.stack.robot.nv))
        outputs = [ca.densify(part) for part in tracer.expanded(kept, columns)]
        return [self.later, *ca.Function("kept", [self.kinematics.q, self.p], outputs)(self.later, self.p)]

    def sensed_matrix(self, block: Block, count: int) -> ca.SX:
        """Rows of sensed pairs, see :meth:`Constraint.sensed_rows`."""
        line = ca.reshape(self.p[block.slots["line"].span], 6, count).T
        side = ca.reshape(self.p[block.slots["side"].span], self.layout.nv, count).T
        return side * ca.densify(line @ self.kinematics.screws)

    def ahead(self, block: Block) -> ca.SX:
        """h(q (+) v dt) of a margin block; of sensed rows h + (dh/dt) dt, what loops add left out."""
        item = block.entry.item
        assert isinstance(item, Constraint)
        if block.entry.name in self.balls:
            return ca.SX(len(block.rows), 1)
        tracer = self.tracer(block)
        margins = item.margins(self.stack.robot, tracer, self.values(block))
        assert margins is not None
        here = ca.Function("h", [self.kinematics.q, self.p], [ca.densify(tracer.expand(margins))])
        margin = here(self.later, self.advanced(block, self.dt))
        sensed = item.sensed_rows(self.stack.robot)
        if sensed and not self.loops:
            closing = self.sensed_matrix(block, sensed) @ self.kinematics.v * self.dt
            margin = margin + ca.vertcat(ca.SX(len(block.rows) - sensed, 1), closing)
        return margin


@quick_operators()
def build(stack: Declaration, layout: Layout) -> TickProgram:
    """Build the functions of a stack.

    Raises:
        ShapeError: an item's expression has another number of rows than it declares, or free symbols.
    """
    b = _ProgramBuilder(stack, layout)
    balls, sensed = b.balls, b.sensed
    nv = layout.variables
    tasks = [(block.start, *b.task(block)) for block in layout.of_form("task")]
    tasks = [(start, e, w, f, b.columns(shared_pattern(J.T))) for start, e, w, f, J in tasks]
    tasks = sorted([*tasks, *speeds(stack, layout, b.tasks)], key=lambda part: part[0])
    general = [b.general(block) for block in layout.of_form("margins", "rows")]
    bounds = []
    for block in layout.of_form("bounds"):
        item = block.entry.item
        assert isinstance(item, Constraint)
        tracer = Tracer(b.kinematics)
        if b.second is None:
            got = item.bounds(stack.robot, tracer, b.values(block), b.dt)
        else:
            got = item.acceleration_bounds(stack.robot, tracer, b.values(block), b.dt, stack.dt_range[1])
        assert got is not None
        wide = unlimited(layout, Bounds(b.column(block, "lower", got.lower), b.column(block, "upper", got.upper)))
        bounds.append((wide.lower, wide.upper))
    empty = ca.SX(0, 1)
    outputs = [
        *[ca.vertcat(empty, *[t[k] for t in tasks]) for k in (1, 2, 3)],
        ca.horzcat(ca.SX(nv, 0), *[t[4] for t in tasks]),
        ca.horzcat(ca.SX(nv, 0), *[r.matrix.T for r, _, _ in general]),
        ca.vertcat(empty, *[ca.densify(r.lower) for r, _, _ in general]),
        ca.vertcat(empty, *[ca.densify(r.upper) for r, _, _ in general]),
        ca.vertcat(empty, *[h for _, h, _ in general if h is not None]),
        ca.horzcat(ca.SX(nv, 0), *[low for low, _ in bounds]),
        ca.horzcat(ca.SX(nv, 0), *[high for _, high in bounds]),
        ca.vertcat(empty, *[f for _, _, f in general if f is not None]),
    ]
    outputs = [o if k in (3, 4) else ca.densify(o) for k, o in enumerate(outputs)]
    inputs = [b.kinematics.q, b.kinematics.v, b.p, b.dt]
    segments = balls.segments(b.kinematics)
    more = [segments, ca.densify(b.kinematics.screws)] if balls or sensed else []
    rows = checked_function("rows", inputs, outputs + more, [*ROWS_OUTPUTS, "segment", "screw"][: len(outputs + more)])
    ahead = None
    if layout.margin_rows:
        later = ca.vertcat(*[b.ahead(block) for block in layout.of_form("margins")])
        more = [ca.Function("segments", [b.kinematics.q], [segments])(b.later)] if balls else []
        ahead = checked_function("ahead", inputs, [ca.densify(later), *more], ["ahead", "segment"][: 1 + len(more)])
    second = None
    upper = ca.SX(nv, nv)
    if b.forces:
        upper = widened(layout, widened(layout, ca.triu(curvature(b.kinematics, b.forces))).T).T
    if upper.nnz():
        second = checked_function("curvature", [*inputs, b.force], [upper], ["curvature"])
    torque = None
    if b.second is not None and stack.command == "torque":
        enabled = ca.SX.sym("enabled", layout.general_rows)
        found = [ca.densify(b.second.torque(enabled))]
        torque = checked_function("torque", [*inputs, b.second.x, enabled], found, ["torque"])
    bent = ca.vertcat(ca.SX(0, 1), *[b.lost(block) for block in layout.of_form("margins", "rows")])
    lost = checked_function("lost", inputs, [ca.densify(bent)], ["lost"]) if bent.nnz() else None
    arrival = None
    if b.second is not None and stack.robot.loops:
        arrival = checked_function("arrival", inputs, b.arrival(), ["next_q", "opened", "closing_columns"])
    return TickProgram(rows, ahead, second, torque, balls, sensed, lost, arrival)


def shared_pattern(transposed: ca.SX) -> ca.SX:
    """Give all rows of a task the same columns, if that at most doubles the entries: they are then one dense block."""
    rows = transposed.shape[1]
    columns = sorted(set(transposed.sparsity().row()))
    if rows < 2 or len(columns) * rows > 2 * transposed.nnz():
        return transposed
    return ca.project(transposed, ca.Sparsity.rowcol(columns, list(range(rows)), transposed.shape[0], rows))


def sparsity_rows(transposed: ca.Sparsity) -> tuple[np.ndarray, np.ndarray]:
    """(starts, columns) of the rows of J from the sparsity of its transpose (compressed columns)."""
    return np.array(transposed.colind(), dtype=np.int64), np.array(transposed.row(), dtype=np.int64)


def checked_function(name: str, inputs: list[ca.SX], outputs: list[ca.SX], labels: list[str]) -> ca.Function:
    """A function of (q, v, p, dt, more, enabled), as many of them as there are inputs.

    Raises:
        ShapeError: symbols that are no inputs.
    """
    given = ["q", "v", "p", "dt", "more", "enabled"][: len(inputs)]
    function = ca.Function(name, inputs, outputs, given, labels, {"allow_free": True})
    if stray := function.get_free():
        raise ShapeError(f"stack.{name}", stray, "an item's expression contains symbols that are not its inputs")
    return function
