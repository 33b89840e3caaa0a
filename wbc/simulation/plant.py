"""The seam to a robot: what a simulator or a driver is to a control loop."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

from wbc import validation
from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.validation import Array


class CommandKind(StrEnum):
    """What the numbers of a command are, one for each velocity coordinate unless said otherwise.

    ``VELOCITY``: desired velocity ``[nv]`` [m/s, rad/s]. ``POSITION``: desired configuration ``[nq]``. ``TORQUE``:
    generalised force ``[nv]`` [N, N m].
    """

    VELOCITY = "velocity"
    POSITION = "position"
    TORQUE = "torque"


class GripKind(StrEnum):
    """What of a frame a grip holds, as of ``wbc.tasks.Hold``: ``POSE`` all of it, ``AXIS`` its origin and its z axis,
    about which it may roll, ``POSITION`` its origin.
    """

    POSE = "pose"
    AXIS = "axis"
    POSITION = "position"


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """A command, which holds until the next one."""

    kind: CommandKind
    values: Array


def numbers_of(command: Command, kinds: Iterable[CommandKind], size: int) -> Array:
    """A copy of a command's numbers.

    Raises:
        UnknownNameError: of none of these kinds. ShapeError, NotFiniteError: no command, or no ``size`` numbers.
    """
    validation.instance("command", command, Command, "a wbc.simulation.Command of kind and values")
    validation.one_of("command.kind", str(command.kind), [str(kind) for kind in kinds])
    return validation.real_array("command.values", command.values, (size,))


@dataclass(slots=True, eq=False)
class PlantState:
    """What is known of a robot at one time.

    Attributes:
        q: configuration ``[nq]`` as of ``pin.Model``. v: velocity ``[nv]`` [m/s, rad/s].
        time: of the reading, on the plant's clock [s]. valid: False where there is no reading that can be trusted; the
            loop then commands rest and ends.
    """

    q: Array
    v: Array
    time: float
    valid: bool = True


class Plant(Protocol):
    """A robot as a control loop sees it: a simulator, or a driver of a real one.

    A loop calls :meth:`reset` once and then, tick by tick, :meth:`apply`, :meth:`advance` and :meth:`read`, from one
    thread. A plant knows its robot and nothing of tasks, plans or holds. Arrays that it is given, those of commands
    too, it copies if it keeps them; arrays that it returns it may go on using.
    """

    @property
    def nq(self) -> int:
        """Numbers of a configuration."""

    @property
    def nv(self) -> int:
        """Numbers of a velocity."""

    @property
    def time_step(self) -> float:
        """The least time that it advances by [s]: a loop's period must be a whole multiple; 0: any time."""

    @property
    def commands(self) -> Collection[CommandKind]:
        """Kinds of commands that it takes."""

    def reset(self, q: Array, time: float) -> None:
        """Be at rest at a configuration, without a command; a driver waits until the robot is there.

        Args:
            q: ``[nq]``. time: that its clock shows then [s].

        Raises:
            PlantError: the robot cannot be there.
        """

    def read(self) -> PlantState:
        """The latest reading. Reading twice changes nothing."""

    def apply(self, command: Command) -> None:
        """Take a command, of one of :attr:`commands`; it takes hold with the next :meth:`advance`."""

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] go by under the last command. A driver waits until they have."""


@runtime_checkable
class GrippingPlant(Protocol):
    """What a plant has besides where its robot can grasp things that do not move."""

    def grasp(self, frame: str, pose: pin.SE3, kind: GripKind) -> None:
        """A frame is held at a pose of the world from now on.

        Raises:
            RangeError: it is not there. UnknownNameError: no such frame.
        """

    def release(self, frame: str) -> None:
        """It is free again.

        Raises:
            UnknownNameError: it was not held.
        """

    def lost(self) -> tuple[str, ...]:
        """Frames that what held them has let go of, since this was last asked."""


class PlantError(WbcError):
    """A plant that has no valid reading, or cannot do what it is to do; it was commanded to rest."""
