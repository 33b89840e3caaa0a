"""The two contracts: what a task and a constraint declare, and what is derived from it.

A :class:`Task` states an error e(q, inputs) and is served by the rows

    (de/dq) v + de/dt = -gain e                                     [unit of e per second]

in the least-squares sense. A :class:`Constraint` states margins h(q, inputs) >= 0, rows
lower <= A v <= upper, or simple bounds on v. A margin becomes

    (dh/dq) v + dh/dt >= -rate h,      rate dt in (0, 1].

A stack that commands accelerations or torques (docs/torque.md) has the second derivatives of the same
expressions in its rows.

Items are frozen declarations. Run-time values (targets, gains, masks) are :class:`Input`
declarations; their values live in the controller. Jacobians, time derivatives, C code, tests and
tables are derived from the expressions.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping
from enum import IntEnum
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import pickling
from wbc.errors import RangeError
from wbc.quick_dataclasses import dataclass
from wbc.symbolic.kinematics import WORLD, Kinematics, joint_of
from wbc.symbolic.tracer import Tracer
from wbc.tasks._plain import plain
from wbc.tasks.units import UNITS, checked_unit

if TYPE_CHECKING:
    from wbc.robot import Robot
    from wbc.tasks._ball import BallRow

Kind = Literal["vector", "pose", "rotation", "configuration", "tangent"]

#: What a stack commands: the velocity of the joints, their acceleration, or the torque of the motors.
Command = Literal["velocity", "acceleration", "torque"]

#: What an item contributes: task rows, margin rows, plain rows on v, or simple bounds on v.
Form = Literal["task", "margins", "rows", "bounds"]


@dataclass(frozen=True, eq=False)
class Input:
    """A run-time value of an item.

    Attributes:
        name: how the user spells it, ``controller["hand"].target``.
        kind: ``vector`` of ``size`` numbers; ``pose`` (12 numbers in the buffer: rotation by columns,
            then position; ``pin.SE3`` at the user's border); ``rotation`` (9 numbers by columns; a 3x3 matrix or a
            quaternion x, y, z, w at the border); ``configuration`` (nq numbers on the manifold); ``tangent``
            (nv numbers).
        unit: SI unit, for tables and error messages.
        size: numbers of a ``vector``; 0 means one scalar.
        default: initial value as the user would write it. None: the value *at the configuration of the
            first step* (:meth:`Item.initial`), so that a fresh controller stays where it is.
        rate: name of the input that holds this one's time derivative: same size for a vector, a twist
            (linear; angular, 6, in the axes the pose is given in) for a pose, an angular velocity (3) for a
            rotation, nv numbers for a configuration.
        low, high: valid range of each number.
        infinite: the infinity that is a valid number, too: no limit there.
        each: of a vector, one number is a value, too, and counts for all of its numbers.
        below: name of an input of the same size, with a default like this one, whose numbers this one's never exceed.
        direction: a vector that is kept at unit length; its rate is the derivative of the unit vector.
        sensed: a :class:`Sensor` writes it before every tick; users only read it.
        joints: of a configuration or a velocity, the joints of which it is read: their numbers alone are a value, too.
        part: of a pose, what is read of it: a ``position`` (3 numbers) or an ``orientation`` (a 3x3 matrix or a
            quaternion x, y, z, w) alone is a value, too; "" for all of it.
    """

    name: str
    kind: Kind = "vector"
    unit: str = ""
    size: int = 0
    default: Any = None
    rate: str | None = None
    low: float = -np.inf
    high: float = np.inf
    infinite: float | None = None
    each: bool = False
    below: str | None = None
    direction: bool = False
    sensed: bool = False
    joints: tuple[str, ...] | None = None
    part: Literal["", "position", "orientation"] = ""


@dataclass(frozen=True)
class Row:
    """One row of an item: ``label`` within the item ("x", "panda_joint4") and the unit of its error or margin.

    Attributes:
        unit: one of :data:`wbc.tasks.units.UNITS`, or a rate of it: ``"m/s"``.
        size: how many of the unit count as much as a radian, for units that no length says it of: forces; else 0.

    Raises:
        UnknownNameError: another unit.
    """

    label: str
    unit: str
    size: float = 0.0

    def __post_init__(self) -> None:
        checked_unit(f"row {self.label!r}.unit", self.unit)

    def scale(self, length: float) -> float:
        """What counts as much as a radian, in the row's own unit, where ``length`` [m] is the characteristic length:
        the length for rows in metres, 1000 times it for millimetres, 180 / pi for degrees, 1 for radians.
        """
        if self.size > 0.0:
            return self.size
        many, power = UNITS[self.unit.removesuffix("/s")]
        return many * length**power


class SacrificeOrder(IntEnum):
    """Order of sacrifice when rows cannot all hold: a higher number gives way first."""

    ACTUATOR = 0
    POSITION = 1
    HOLD = 2
    MARGIN = 3
    SOFT = 4


#: What an item's expressions receive: an SX scalar or vector, a 3x3 SX for a rotation, a
#: :class:`wbc.symbolic.kinematics.Pose` for a pose.
Values = Mapping[str, Any]

#: The present numbers of an item's inputs: views of the controller's buffer, by input name.
Numbers = Mapping[str, NDArray[np.float64]]

_registry: dict[str, type[Item]] = {}


class Sensor(Protocol):
    """Measures, at a configuration, what expressions cannot state (distances of meshes). One a controller.

    It writes the sensed inputs of its item, see :meth:`Constraint.sensed_rows`, in place.
    """

    def sense(self, q: NDArray[np.float64]) -> None:
        """Write the sensed inputs for a finite configuration; called before every tick of an enabled item."""

    def reset(self) -> None:
        """Forget what was sensed before."""

    @property
    def addresses(self) -> tuple[int, ...]:
        """What a tick asks in C, see :meth:`wbc.proximity.PairSensor.addresses`."""

    def pairs(self) -> tuple[tuple[str, str, float], ...]:
        """What the sensed rows were about in the last call: names of both bodies and their distance [m]."""


@dataclass(frozen=True)
class Item:
    """Common ground of tasks and constraints."""

    #: Abstract classes stay out of the registry
    abstract: ClassVar[bool] = True

    #: Fields that name frames: the frame that it is about, and the one that it is seen from, if any
    frame_fields: ClassVar[tuple[str, ...]] = ()

    #: Fields that only give an input its first value. Expressions must not read them (the input holds the present
    #: value); in return the compiled code is the same for all of their values.
    initial_only: ClassVar[tuple[str, ...]] = ()

    #: Something of it is given in the world: a target, an obstacle, a plane. It may then be given in a
    #: :class:`wbc.tasks.MovingFrame` instead.
    stands_in_world: ClassVar[bool] = True

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "abstract" not in cls.__dict__:
            cls.abstract = False
        if not cls.abstract:
            _registry[cls.__name__] = cls

    def __getstate__(self) -> dict[str, Any]:
        return pickling.declared(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        pickling.restore(self, state, {f.name for f in dataclasses.fields(self)})

    def __deepcopy__(self, memo: dict[int, Any]) -> Item:
        return pickling.deep_copy(self, memo)

    def validate(self, robot: Robot) -> None:
        """Check the declaration against a robot; called by ``stack.add``. Here: :attr:`frame_fields`, whose first
        one moves against the second one, or against the world where there is no other.

        Raises:
            UnknownNameError: an unknown frame or joint. RangeError: frames that no joint moves against each other.
            WbcError: a wrong shape, a value out of range.
        """
        owner, names = type(self).__name__, [getattr(self, field) for field in self.frame_fields]
        for field, name in zip(self.frame_fields, names, strict=True):
            robot.check_frame(f"{owner}.{field}", name)
        if names:
            require_motion(robot, f"{owner}.{self.frame_fields[0]}", *names[:2])

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        """Run-time inputs, besides those that every item has (see :class:`Task`, :class:`Constraint`)."""
        return ()

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """Labels and units of the rows, in the order of the expression."""
        raise TypeError(f"{type(self).__name__} declares no rows")

    def row_weights(self, robot: Robot) -> NDArray[np.float64]:
        """Weight of each row, multiplied with the item's weight and the run-time mask: the field ``weights`` of a task
        that has one, else 1.
        """
        declared = getattr(self, "weights", None)
        return np.ones(len(self.rows(robot))) if declared is None else np.array(declared, dtype=np.float64)

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        """Values at configuration ``q`` of the inputs whose default is None."""
        return {}

    def refusal(self, robot: Robot, command: Command) -> str:
        """Why the item has no meaning for what a stack commands; empty where it has one."""
        return ""

    def declaration(self, robot: Robot) -> dict[str, Any]:
        """Everything that decides the compiled code besides the robot, as plain data; part of the cache key."""
        return {"class": f"{type(self).__module__}.{type(self).__qualname__}"} | {
            f.name: plain(getattr(self, f.name), robot)
            for f in dataclasses.fields(self)
            if f.name not in self.initial_only
        }


@dataclass(frozen=True)
class Task(Item):
    """What is desired: e(q, inputs) -> 0, weighted against the other tasks of its level.

    Every task has the run-time inputs ``gain`` [1/s], ``weight``, ``enabled`` and ``mask`` (one number
    >= 0 a row, multiplies the row's weight).
    """

    abstract: ClassVar[bool] = True

    initial_only: ClassVar[tuple[str, ...]] = ("gain",)

    #: Default gain [1/s]: e decays like exp(-gain t) where nothing hinders it
    default_gain: ClassVar[float] = 2.0

    #: Its rows may ask for a rate other than 0
    asks: ClassVar[bool] = True

    #: First value of the input ``gain`` [1/s] where the class's default is not wanted
    gain: float | None = dataclasses.field(default=None, kw_only=True)

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        """e(q, inputs), one entry a row, in the rows' units."""
        raise TypeError(f"{type(self).__name__} declares no error")

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """None: the Jacobian is derived from :meth:`error`. A task on the velocity itself (damping)
        returns the matrix of its rows here, with one column more where :meth:`Tracer.point_jacobian` has it.
        """
        return None

    def acceleration(self, inputs: Values, error: ca.SX, rate: ca.SX) -> ca.SX | None:
        """None, or the second derivative of e that the rows ask for of a stack of accelerations, in place of
        -stiffness e - damping de/dt; then ``gain`` is an input of its own.
        """
        return None

    def row_factor(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """None, or one smooth factor in [0, 1] a row by which the row's weight is multiplied: a task that
        fades where its error is singular.
        """
        return None


@dataclass(frozen=True)
class Rows:
    """Constraint rows lower <= A v <= upper; equal bounds make an equality.

    ``A`` is rows x nv. A column more, see :meth:`Tracer.point_jacobian`, is a velocity that both sides are less by.
    """

    matrix: ca.SX
    lower: ca.SX
    upper: ca.SX


@dataclass(frozen=True)
class Bounds:
    """Simple bounds lower <= v <= upper, nv entries each; +-inf where there is none."""

    lower: ca.SX
    upper: ca.SX


@dataclass(frozen=True)
class Torques:
    """Limits lower <= tau <= upper of the generalised forces of some degrees of freedom [N m, N].

    Attributes:
        drives: None, or the square matrix B of drives that move these joints together: then lower <= B tau <= upper.
    """

    dofs: tuple[int, ...]
    lower: ca.SX
    upper: ca.SX
    drives: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Constraint(Item):
    """What must hold. A subclass implements exactly one of :meth:`margins`, :meth:`velocity_rows`, :meth:`bounds`.

    Every constraint has the run-time inputs ``enabled`` and ``mask`` (0 or 1 a row); one with margins
    also ``rate`` [1/s].
    """

    abstract: ClassVar[bool] = True
    order: ClassVar[SacrificeOrder] = SacrificeOrder.MARGIN

    #: Rows are equalities (lower == upper)
    equality: ClassVar[bool] = False

    #: What the rows keep at 0, :meth:`residual`, is 0 at q (+) v dt to rounding, whatever that costs
    exact: ClassVar[bool] = False

    #: Default rate [1/s] of margins: h decays no faster than exp(-rate t)
    default_rate: ClassVar[float] = 20.0

    def refusal(self, robot: Robot, command: Command) -> str:
        if command != "velocity" and self.sensed_rows(robot):
            return "measures distances of meshes, of which only the first derivative is known; give shapes of its own"
        return ""

    @property
    def form(self) -> Form:
        """Which of the three a subclass implements."""
        mine = [
            name
            for name in ("margins", "velocity_rows", "bounds")
            if getattr(type(self), name) is not getattr(Constraint, name)
        ]
        if len(mine) != 1:
            raise TypeError(f"{type(self).__name__} must implement exactly one of margins, velocity_rows, bounds")
        forms: dict[str, Form] = {"margins": "margins", "velocity_rows": "rows", "bounds": "bounds"}
        return forms[mine[0]]

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """h(q, inputs) >= 0, one entry a row, or None."""
        return None

    def sensed_rows(self, robot: Robot) -> int:
        """How many of the last margin rows are about pairs of bodies that a :class:`Sensor` chooses in every tick.

        For k such rows the item has, besides its own, the sensed inputs

            distance  k       signed distance of the two bodies of each row [m]
            drift     k       its rate by what moves without the robot [m/s]
            line      6 k     row by row, (n, p x n): unit normal from body A to body B and its moment about the
                              origin of the world for a point p of the line through both witness points [1, m]
            side      nv k    row by row, a number a degree of freedom: 1 if it moves B only, -1 if A only, else 0

        and the row's derivative along v is ``side * (line @ screws)``: two bodies approach along their common normal.
        The last k entries of :meth:`margins` are to be ``inputs["distance"]``, less what the item keeps clear.
        """
        return 0

    def sensor(self, robot: Robot, numbers: Numbers) -> Sensor:
        """The sensor of one controller; reads and writes the item's inputs in ``numbers``."""
        raise TypeError(f"{type(self).__name__} has no sensed rows")

    def ball_rows(self, robot: Robot) -> tuple[BallRow, ...]:
        """What every row of :meth:`margins` is, where all are distances between one ball and links, less what is kept
        clear; else nothing.

        The ball's centre is the position of the input ``pose``, its velocity that of ``velocity``, and ``margin`` is
        kept clear. A compiled tick computes such rows in a loop, and leaves out those that are too far to matter.
        """
        return ()

    def row_factor(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """None, or one factor in [0, 1] a margin row, 1 where the margin has its plain meaning: a limit that fades
        where its quantity is singular. :meth:`margins` contains the factor already; it is for reports only.
        """
        return None

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        """lower <= A v <= upper, or None."""
        return None

    def later_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        """lower <= A (v + a dt) <= upper where accelerations are commanded, or None: what :meth:`velocity_rows` are off
        by decays.
        """
        return None

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """e(q, inputs) of equality rows that keep it at 0 by de/dt = -gain e, one entry a row, 0 in rows that keep
        nothing: how far e bends within a tick is made up for, see docs/reach.md. None: rows count as they are at q.
        """
        return None

    def curved(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """:meth:`residual`, or what has its second derivatives along motions that keep it at 0."""
        return self.residual(robot, kin, inputs)

    def bounds(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Bounds | None:
        """Simple bounds on v, or None; ``kin.v`` is the velocity that accelerations are counted from."""
        return None

    def acceleration_bounds(
        self,
        robot: Robot,
        kin: Tracer,
        inputs: Values,
        dt: ca.SX,
        longest: float,
        motors: Mapping[int, ca.SX] | None = None,
    ) -> Bounds | None:
        """The same as bounds on the acceleration a that is held for dt from the velocity ``kin.v`` on, or None:
        by default :meth:`bounds` hold for the velocity at the end of it, v + a dt.

        Args:
            longest: no tick is longer [s].
            motors: degree of freedom -> deceleration that its motor has; None: not known.
        """
        own = self.bounds(robot, kin, inputs, dt)
        return None if own is None else Bounds((own.lower - kin.v) / dt, (own.upper - kin.v) / dt)

    def torque_rows(self, robot: Robot, inputs: Values, dt: ca.SX) -> Torques | None:
        """Rows on generalised forces of a stack that commands torques, or None."""
        return None

    def load(self, robot: Robot, kin: Kinematics, inputs: Values) -> ca.SX | None:
        """Generalised forces on the robot, nv [N m; N], that are neither motors nor gravity nor contacts, or None."""
        return None

    @property
    def is_load(self) -> bool:
        """Whether it gives a :meth:`load`."""
        return type(self).load is not Constraint.load

    def acceleration_limits(self, robot: Robot) -> NDArray[np.float64]:
        """Largest change of each velocity per second that :meth:`bounds` leave, nv numbers; inf where there is none."""
        return np.full(robot.nv, np.inf)

    def velocity_limits(self, robot: Robot) -> NDArray[np.float64]:
        """Largest velocities that :meth:`bounds` leave, nv numbers; inf where there is none."""
        return np.full(robot.nv, np.inf)

    def position_limits(self, robot: Robot) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(lower, upper) of the coordinates that :meth:`bounds` keep within limits, nv numbers each; else +-inf."""
        return np.full(robot.nv, -np.inf), np.full(robot.nv, np.inf)


def registry() -> dict[str, type[Item]]:
    """Every concrete task and constraint class by name, the user's own included."""
    import pkgutil

    package = importlib.import_module(__package__)
    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"{__package__}.{module.name}")
    return dict(_registry)


def require_motion(robot: Robot, field: str, frame: str, reference: str = WORLD) -> None:
    """Refuse a frame that no joint moves against the reference.

    Raises:
        RangeError: both are fixed to the same body.
    """
    if joint_of(robot.tree, frame) == joint_of(robot.tree, reference):
        raise RangeError(field, frame, f"no joint moves this frame against {reference!r}")
