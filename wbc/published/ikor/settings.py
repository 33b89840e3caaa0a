"""How a trajectory is followed: the published codes of method, and what the published driver lacked."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import mass_matrix, pin
from wbc.published.ikor.machines import ArmMachine
from wbc.resolvers.fsp import Criterion, least_acceleration, least_power, least_torque
from wbc.validation import Array

#: Rows of a task, in their order
AXES = ("x", "y", "z", "yaw", "pitch", "roll")


#: What is least of a step: its norm; the change from the step before; of the robot's masses the kinetic energy, torques
#: and power, with steps of :data:`DT` [s]
CRITERIA = ("norm", "acceleration", "energy", "torque", "power")
#: A step lasts so long where its time matters [s]
DT = 0.1


class Method(enum.IntEnum):
    """The published codes."""

    LIMITS = 0
    PSEUDO_INVERSE = 1
    OBSTACLES = 2
    BOTH = 3
    FSP = 4


@dataclass(frozen=True)
class Switch:
    """From a point on, counted from 1: ``orientation`` on or off, all three angles; ``platform`` in motion or at rest;
    None: as before.

    Raises:
        RangeError: no such point.
    """

    point: int
    orientation: bool | None = None
    platform: bool | None = None

    def __post_init__(self) -> None:
        validation.integer("switch", self.point, 1)

    @classmethod
    def read(cls, text: str) -> Switch:
        """From POINT:what=on|off,what=on|off.

        Raises:
            ShapeError, UnknownNameError: another text. RangeError: no such point.
        """
        point, _, changes = text.partition(":")
        pairs = [change.split("=") for change in changes.split(",")]
        if not point.isdecimal() or not point.isascii() or any(len(pair) != 2 for pair in pairs):
            raise ShapeError("switch", text, "expected POINT:orientation=on|off,platform=on|off")
        one_of = validation.one_of
        states = {one_of("switch", a, ("orientation", "platform")): one_of(a, b, ("on", "off")) for a, b in pairs}
        return cls(int(point), **{name: state == "on" for name, state in states.items()})


@dataclass(frozen=True)
class Settings:
    """How a trajectory is followed.

    Attributes:
        method: a code; obstacles and limits are constraints of FSP and of the stack as it says.
        rows: of :data:`AXES`. euler: all three angles are Euler angles, as published, and not a rotation; one or two
            always are.
        resolver: ``fsp``, ``pseudo_inverse`` or ``stack``: levels of a QP with inequalities.
        generator: ``blocked``, as published, or ``orthogonal``.
        two_step: constraints in a second step, by self-motion, where the first broke them; else in one shot.
        ahead: a constraint acts on the step that would break it, with ``margin``, also for tool and platform; else, as
            published, on the step after.
        margin: kept from spheres [m]. damping: d of J' (J J' + d^2)^-1. step_limit: longest step of a column
            [rad or m]; the whole step is shortened, and the feedback makes up for it.
        loop_back: where a step would be longer than the limit, some steps are taken back and tried again with the
            joint held that moved most.
        feedback: the target less where the tool is; else less where it should have been.
        criterion: of FSP's steps, in place of the least norm by the machine's weights; or one of :data:`CRITERIA`.
        switches: what changes on the way, in the order of their points.
    """

    method: Method = Method.FSP
    rows: tuple[str, ...] = AXES[:3]
    euler: bool = False
    resolver: str = "fsp"
    generator: str = "blocked"
    two_step: bool = False
    ahead: bool = False
    margin: float = 0.0
    damping: float = 0.0
    step_limit: float = math.inf
    loop_back: bool = False
    feedback: bool = True
    criterion: Criterion | str = "norm"
    switches: tuple[Switch, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "method", _method(self.method))
        object.__setattr__(
            self, "rows", tuple(sorted({validation.one_of("rows", r, AXES) for r in self.rows}, key=AXES.index))
        )
        if not self.rows:
            raise RangeError("rows", self.rows, "expected at least one row")
        validation.one_of("resolver", self.resolver, ("fsp", "pseudo_inverse", "stack"))
        validation.one_of("generator", self.generator, ("blocked", "orthogonal"))
        for name in ("margin", "damping"):
            validation.scalar(name, getattr(self, name), low=0.0)
        if isinstance(self.criterion, str):
            validation.one_of("criterion", self.criterion, CRITERIA)
        if self.criterion != "norm" and (self.resolver != "fsp" or self.plain):
            raise RangeError("criterion", self.resolver, "only FSP takes a criterion of its own")
        if not self.step_limit > 0.0:
            raise RangeError("step_limit", self.step_limit, "expected a length above 0")

    @property
    def limits(self) -> bool:
        """Whether joint limits act."""
        return self.method in (Method.LIMITS, Method.BOTH)

    @property
    def plain(self) -> bool:
        """Whether the pseudo-inverse makes the steps."""
        return self.resolver == "pseudo_inverse" or (self.resolver == "fsp" and self.method is Method.PSEUDO_INVERSE)

    @property
    def obstacles(self) -> bool:
        """Whether spheres act."""
        return self.method in (Method.OBSTACLES, Method.BOTH)


def _method(value: Any) -> Method:
    try:
        return Method(value)
    except ValueError:
        raise RangeError(
            "method", value, f"expected a code: {', '.join(f'{m.value} {m.name}' for m in Method)}"
        ) from None


def step_criterion(machine: ArmMachine, name: str, q: Array, last: Array) -> Criterion:
    """What is least of the next step, of :data:`wbc.published.ikor.settings.CRITERIA`; ``last``: the step before [M].

    Raises:
        RangeError: masses that a criterion needs and the machine has not.
    """
    weight = None if (machine.weights == 1.0).all() else machine.weights**2
    if name == "norm":
        return Criterion(weight)
    if name == "acceleration":
        return least_acceleration(last, weight)
    model, data, at = machine.robot.model, machine.robot.model.createData(), machine.of_robot(q)
    inertia = machine.spread.T @ mass_matrix(model, data, at) @ machine.spread
    if np.linalg.eigvalsh(inertia)[0] <= 0.0:
        raise RangeError("criterion", name, f"a joint of {machine.name} moves no mass; take norm or acceleration")
    if name == "energy":
        return Criterion(inertia)
    bias = machine.spread.T @ pin.nonLinearEffects(model, data, at, machine.spread @ last / DT)
    way = least_power(inertia, bias, last / DT, DT)
    if name == "torque":
        way = least_torque(inertia, bias, last / DT, DT, weight)
    # Of rates; a step is DT of them
    assert way.reference is not None
    return Criterion(way.weight, DT * way.reference)
