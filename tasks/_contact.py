"""What contacts have in common: a frame that does not move, and what its wrench may be."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import algebra
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Input, Row, Rows, SacrificeOrder, Task, Torques, Values
from wbc.tasks.frames import frame_pose
from wbc.tasks.hold import Hold

#: Components of a wrench, of a force its first three
WRENCH_LABELS = ("fx", "fy", "fz", "mx", "my", "mz")
WRENCH_UNITS = ("N", "N", "N", "N m", "N m", "N m")
#: Acceleration by which a robot's mass is a force, whatever gravity it is in [m/s^2]
NOMINAL = 9.81
#: First weight of a force against task rows of weight 1: a robot's own weight costs as much as 0.01 rad/s^2 missed
FORCE_WEIGHT = 1e-4


def force_sizes(robot: Robot) -> NDArray[np.float64]:
    """How many N, 3, and N m, 3, count as much as 1 rad/s^2: the robot's weight on earth, and that by its length."""
    mass = float(algebra(robot.tree).computeTotalMass(robot.tree))
    force = max(mass, 1e-3) * NOMINAL
    sizes: NDArray[np.float64] = np.repeat([force, force * robot.characteristic_length], 3)
    return sizes


@dataclass(frozen=True)
class Cone:
    """What a wrench w may be: lower <= matrix w <= upper, a label and a unit a row."""

    matrix: ca.SX
    lower: ca.SX
    upper: ca.SX


@dataclass(frozen=True)
class Contact(Constraint):
    """A frame that does not move, by a wrench that the surroundings exert on it.

    The motion is that of ``Hold``. A stack that commands torques has the wrench as variables of its QP, in the axes
    of the frame and about its origin, and the items ``"<name> wrench"``, the rows of :meth:`cone`, and
    ``"<name> force"``, a task for the wrench.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame",)

    abstract: ClassVar[bool] = True
    order: ClassVar[SacrificeOrder] = SacrificeOrder.HOLD
    equality: ClassVar[bool] = True
    #: Components of the wrench that the contact can bear, in the axes of its frame: 0, 1, 2 force, 3, 4, 5 moment
    axes: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4, 5)
    #: What counts of the target, as of :class:`wbc.tasks.Input`
    part: ClassVar[Literal["", "position"]] = ""
    #: Class of the rows of :meth:`cone` in the order of sacrifice
    cone_order: ClassVar[SacrificeOrder] = SacrificeOrder.MARGIN

    frame: str

    @property
    def components(self) -> int:
        """How many numbers the wrench has."""
        return len(self.axes)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", "pose", unit="m, rad", part=self.part),
            Input("gain", unit="1/s", default=10.0, low=0.0),
            *self.limits(),
        )

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        return {"target": frame_pose(robot, self.frame, q)}

    @property
    def _hold(self) -> Hold:
        return Hold(self.frame, kind="pose" if self.components == 6 else "position")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self._hold.rows(robot)

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        return self._hold.velocity_rows(robot, kin, inputs, dt)

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        return self._hold.residual(robot, kin, inputs)

    def still(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX | None:
        """What of a twist (linear; angular) in the axes of :meth:`velocity_rows` its rows are, linear in the twist.

        Of J v it is the rows times v, and of (dJ/dt) v their rate where v does not change. None: these are
        differentiated.
        """
        return twist[: self.components]

    def unit_wrenches(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        """components x 6: the wrench in the axes of the frame, about its origin, that each component is the size of."""
        return ca.SX.eye(6)[list(self.axes), :]

    def sizes(self, robot: Robot) -> NDArray[np.float64]:
        """How much of each component counts as much as 1 rad/s^2 ``(components)`` [N; N m]: :func:`force_sizes`."""
        return force_sizes(robot)[list(self.axes)]

    def limits(self) -> tuple[Input, ...]:
        """Run-time inputs of :meth:`cone`."""
        raise TypeError(f"{type(self).__name__} declares no limits")

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        """Labels and units of the rows of :meth:`cone`."""
        raise TypeError(f"{type(self).__name__} declares no cone")

    def cone(self, inputs: Values) -> Cone:
        """What the wrench may be; the units are N and N m."""
        raise TypeError(f"{type(self).__name__} declares no cone")


class Pressing:
    """Ground of contacts that a surface only pushes: the fields ``friction``, ``least`` and ``most`` and their inputs.

    Raises:
        ShapeError, NotFiniteError, RangeError: on construction.
    """

    #: No surface pulls, or gives more friction than it has: the contact moves before that
    cone_order: ClassVar[SacrificeOrder] = SacrificeOrder.POSITION

    friction: float
    least: float
    most: float

    def __post_init__(self) -> None:
        owner = type(self).__name__
        object.__setattr__(self, "friction", validation.scalar(f"{owner}.friction", self.friction, low=0.0))
        object.__setattr__(self, "least", validation.scalar(f"{owner}.least", self.least, low=0.0, unit="N"))
        object.__setattr__(self, "most", checked_positive(f"{owner}.most", self.most, "N", zero=True))

    def limits(self) -> tuple[Input, ...]:
        """``friction``, ``least`` and ``most``."""
        return (
            Input("friction", unit="1", default=self.friction, low=0.0),
            Input("least", unit="N", default=self.least, low=0.0),
            Input("most", unit="N", default=self.most, low=0.0, infinite=math.inf),
        )


@dataclass(frozen=True)
class ContactWrench(Constraint):
    """What the wrench of a contact may be. Made by the stack, under the name ``"<contact> wrench"``."""

    abstract: ClassVar[bool] = True
    order: ClassVar[SacrificeOrder] = SacrificeOrder.MARGIN

    of: str
    contact: Contact
    floating: bool = False

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self.contact.cone_rows(robot)

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        return None


@dataclass(frozen=True)
class ContactForce(Task):
    """The wrench of a contact follows a wrench [N; N m]. Made by the stack, as ``"<contact> force"``.

        w = target + feedback (target - measured)

    What a sensor measures is w + d where the model is off by d; with feedback k the measured wrench misses its target
    by d / (1 + k).

    With the target 0 and a small weight, the first values, loads are shared so that the sum of the weighted squares
    of all wrenches is least.

    Inputs:
        target: in the axes of the frame [N; N m].
        measured: the same, by a sensor.
        feedback: k, >= 0 [1].
    """

    abstract: ClassVar[bool] = True

    of: str
    contact: Contact

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        count, unit = self.contact.components, "N, N m" if max(self.contact.axes) >= 3 else "N"
        return (
            Input("target", unit=unit, size=count, default=np.zeros(count)),
            Input("measured", unit=unit, size=count, default=np.zeros(count)),
            Input("feedback", default=0.0, low=0.0),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        sizes = self.contact.sizes(robot).tolist()
        axes = self.contact.axes
        return tuple(Row(WRENCH_LABELS[k], WRENCH_UNITS[k], size) for k, size in zip(axes, sizes, strict=True))


@dataclass(frozen=True)
class LoopForces(Task):
    """Of the forces in loops that move the robot alike, the least. Made by the stack, under the name ``"loops"``."""

    abstract: ClassVar[bool] = True
    asks: ClassVar[bool] = False

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (Input("gain", unit="1/s", default=0.0, low=0.0),)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(force_row(robot, label, "N" if unit == "m" else "N m") for label, unit in robot.loops.rows)


@dataclass(frozen=True)
class Unactuated(Constraint):
    """What no motor drives, a floating base and passive joints: its rows of  M a + h = J'w + J_l' f  hold whatever
    gives way. Made by the stack.
    """

    abstract: ClassVar[bool] = True
    order: ClassVar[SacrificeOrder] = SacrificeOrder.ACTUATOR
    equality: ClassVar[bool] = True

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(
            force_row(robot, robot.dof_names[k], "N" if robot.dof_units[k] == "m" else "N m") for k in robot.unactuated
        )

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        return None

    def torque_rows(self, robot: Robot, inputs: Values, dt: ca.SX) -> Torques:
        zero = ca.SX.zeros(len(robot.unactuated))
        return Torques(robot.unactuated, zero, zero)


def force_row(robot: Robot, label: str, kind: str = "N") -> Row:
    """A row of a force or a moment with the robot's own size."""
    return Row(label, kind, float(force_sizes(robot)[0 if kind == "N" else 3]))


def checked_positive(field: str, value: Any, unit: str = "", zero: bool = False) -> float:
    """A number > 0, or >= 0; infinite for none.

    Raises:
        ShapeError, NotFiniteError, RangeError: it is not.
    """
    number = float(validation.real_array(field, value, (), finite=False))
    if not (number >= 0.0 if zero else number > 0.0):
        raise RangeError(field, value, f"expected a number {'>= 0' if zero else '> 0'} {unit}".rstrip())
    return number
