"""The stack as declared: a robot, a time step, and named items with levels and weights."""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Iterator
from typing import Any, Self

import numpy as np

from wbc import pickling, validation
from wbc.errors import (
    CommandError,
    DuplicateNameError,
    LevelError,
    PicklingError,
    RangeError,
    ShapeError,
    UnknownNameError,
)
from wbc.multibody import algebra
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.sealed import Sealed
from wbc.stack.commands import COMMANDS
from wbc.symbolic.kinematics import WORLD
from wbc.tasks import inputs
from wbc.tasks._contact import FORCE_WEIGHT, Contact, ContactForce, ContactWrench, LoopForces, Unactuated
from wbc.tasks._direction import DIRECTION_PRICE, Direction
from wbc.tasks._linkage_speed import LinkageSpeed
from wbc.tasks.base import Command, Constraint, Form, Item, SacrificeOrder, Task
from wbc.tasks.damping import Damping
from wbc.tasks.joint_limits import JointLimits
from wbc.tasks.mechanism import Mechanism
from wbc.tasks.moving_frame import MovingFrame
from wbc.tasks.wrench_sum import WrenchSum

#: Weight of forces in loops against task rows of weight 1, in the sizes of forces: tasks decide what they can
LOOP_WEIGHT = 1e-8

#: Default cost of velocity against a task row of weight 1, per (rad/s)^2: keeps the optimum unique.
#: It biases a posture task of weight w by the fraction damping / w.
DAMPING = 1e-8

#: Least of it
LEAST_DAMPING = 1e-12

#: Highest price of a soft constraint; beyond it a row is as good as hard
HIGHEST_PRICE = 1e9

#: Part of its weight that a planar base may bear in its plane, as rounding
PLUMB = 1e-6

#: Negative part of the mass matrix's largest eigenvalue that is rounding
SEMIDEFINITE = 1e-9

#: The time step may vary from tick to tick within these factors of the declared one.
DT_FACTORS = (0.25, 2.0)


@dataclass(frozen=True, eq=False)
class Entry:
    """One item of a stack, with the name, level and weight it was added with; ``price``: of a soft constraint.

    ``frame``: name of the moving frame that it is stated in, whose world that is; "" for the world. ``added``: the item
    as the user has it, where ``item`` is another. ``yielding``: simple bounds that stand as rows, so that they may give
    way.
    """

    item: Item
    name: str
    level: int
    weight: float
    hard: bool = True
    price: float | None = None
    frame: str = ""
    added: Item | None = None
    yielding: bool = False

    @property
    def order(self) -> SacrificeOrder:
        """Class of a constraint in the order of sacrifice; that of a soft one is the last."""
        assert isinstance(self.item, Constraint)
        if not self.hard or self.price is not None:
            return SacrificeOrder.SOFT
        if isinstance(self.item, ContactWrench) and self.item.floating:
            # Nothing but its contacts holds a floating base
            return self.item.contact.cone_order
        planned = self.yielding and self.item.order == SacrificeOrder.ACTUATOR
        return SacrificeOrder.MARGIN if planned else self.item.order

    @property
    def form(self) -> Form:
        """How a constraint stands in the QP."""
        assert isinstance(self.item, Constraint)
        return "rows" if self.yielding else self.item.form

    @property
    def is_task(self) -> bool:
        """Task (True) or constraint (False)."""
        return isinstance(self.item, Task)


#: Of a stack of accelerations: joints that no task moves come to rest like exp(-4 REST t) [1/s]
REST = 5.0


class Declaration(Sealed):
    """Items on a robot. See :class:`wbc.Stack`, which adds ``compile``."""

    #: What it is compiled to command, see :meth:`commanding`
    _command: Command = "velocity"

    def __init__(
        self,
        robot: Robot,
        dt: float,
        *,
        damping: float = DAMPING,
        length: float | None = None,
        calm: bool = True,
    ) -> None:
        self._robot = checked_robot(robot)
        if not robot.nv:
            raise RangeError("robot", robot.name, "nothing of it moves: it has no degree of freedom")
        self._dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
        self._damping = validation.scalar("damping", damping, low=LEAST_DAMPING, high=1.0)
        chosen = robot.characteristic_length if length is None else length
        self._length = validation.scalar("length", chosen, low=0.0, open_low=True, unit="m")
        self._calm = validation.flag("calm", calm)
        self._entries: dict[str, Entry] = {}
        if robot.couplings or robot.locked_dofs or robot.loops:
            self.add(Mechanism())

    def __repr__(self) -> str:
        items = ", ".join(f"{name} ({type(entry.item).__name__})" for name, entry in self._entries.items())
        return f"<Stack of {self._robot.name!r}, dt {self._dt:g} s: {items or 'empty'}>"

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def dt(self) -> float:
        """Declared time step [s]."""
        return self._dt

    @property
    def dt_range(self) -> tuple[float, float]:
        """Shortest and longest time step that ``step`` accepts [s]."""
        return (DT_FACTORS[0] * self._dt, DT_FACTORS[1] * self._dt)

    @property
    def damping(self) -> float:
        """Cost of velocity that keeps the optimum unique, see :data:`DAMPING`."""
        return self._damping

    @property
    def length(self) -> float:
        """Characteristic length [m]: a row in metres is divided by it."""
        return self._length

    @property
    def calm(self) -> bool:
        """Targets out of reach make no chatter, see docs/reach.md; False: the plain linear model."""
        return self._calm and self._command == "velocity"

    @property
    def command(self) -> Command:
        """What the stack commands: ``"velocity"``, ``"acceleration"`` or ``"torque"``."""
        return self._command

    def commanding(self, command: str) -> Self:
        """This stack with what it needs to command accelerations or torques; itself where it commands that already.

            rest                a task at the least weight that brings joints to rest that no other task moves
            base                no motor drives a floating base, nor passive joints (torques)
            loops               forces in loops that nothing else says are the least (torques)
            "<contact> wrench"  what the wrench of a contact may be (torques)
            "<contact> force"   what it should be (torques)

        Simple bounds of a robot whose base floats, or that has passive joints, stand as rows of a stack of torques:
        what motors, loops and contacts can do decides its motion, and limits of motion that contradict it give way.

        Raises:
            UnknownNameError: another command.
            CommandError: an item has no meaning for it, and why; the stack commands something else already; the robot
                has no mass, an inertia that no body has, or a joint that nothing drives.
        """
        validation.one_of("command", command, COMMANDS)
        if command == self._command and command != "velocity":
            return self
        if self._command != "velocity":
            reason = f"this stack is compiled for {self._command}; compile the one that it was made from"
            raise CommandError("command", command, reason)
        if command == "torque" and (reason := _no_torques(self._robot)):
            raise CommandError("command", command, reason)
        out = self if command == "velocity" else copy.copy(self)
        out._command = next(known for known in COMMANDS if known == command)
        for entry in self.entries:
            if reason := entry.item.refusal(self._robot, out._command):
                raise CommandError(f"{entry.name}", command, reason)
        if command != "velocity":
            out._command_entries()
        return out

    def _command_entries(self) -> None:
        """Add what the command needs."""
        last = max(self.levels)
        rest = self._free_name("rest")
        # After strict levels it is one of its own: it must not disturb them
        cascade = len(self.levels) > 1 or any(e.level > 0 for e in self.entries)
        weight = 1.0 if cascade else self._damping
        if not cascade:
            # The rest task keeps the optimum unique: what else does would slow it down
            self._damping = max(LEAST_DAMPING, self._damping * 1e-3)
        added = [Entry(Damping(gain=REST), rest, last + 1 if cascade else last, weight)]
        if self._command == "torque":
            contacts = [entry.name for entry in self.entries if isinstance(entry.item, Contact)]
            floating = self._robot.base == "floating"
            if self._robot.loops:
                added.append(Entry(LoopForces(), self._free_name("loops"), last, LOOP_WEIGHT))
            if self._robot.unactuated:
                added.append(Entry(Unactuated(), self._free_name("base"), 0, 1.0))
                bounds = [e for e in self.constraints if e.form == "bounds"]
                self._entries |= {e.name: dataclasses.replace(e, yielding=True) for e in bounds}
            for entry in self.entries:
                if isinstance(entry.item, WrenchSum):
                    for name in entry.item.contacts:
                        validation.one_of(f"{entry.name}.contacts", name, contacts)
                if isinstance(entry.item, Contact):
                    name = entry.name
                    added.append(
                        Entry(ContactWrench(name, entry.item, floating), self._free_name(f"{name} wrench"), 0, 1.0)
                    )
                    force = ContactForce(name, entry.item)
                    added.append(Entry(force, self._free_name(f"{name} force"), last, FORCE_WEIGHT))
        self._entries |= {entry.name: entry for entry in added}

    @property
    def entries(self) -> tuple[Entry, ...]:
        """Items in the order they were added."""
        return tuple(self._entries.values())

    @property
    def tasks(self) -> tuple[Entry, ...]:
        """Tasks in order."""
        return tuple(e for e in self._entries.values() if e.is_task)

    @property
    def constraints(self) -> tuple[Entry, ...]:
        """Constraints in order."""
        return tuple(e for e in self._entries.values() if not e.is_task)

    @property
    def levels(self) -> tuple[int, ...]:
        """Levels at which something is minimised, in order: those of tasks, of soft constraints, and of all
        constraints at a level > 0.
        """
        counts = {e.level for e in self.entries if e.is_task or e.level > 0 or e.price is not None}
        return tuple(sorted(counts)) or (0,)

    def add(
        self,
        item: Item,
        name: str | None = None,
        level: int = 0,
        weight: float = 1.0,
        *,
        hard: bool = True,
        soft: float | None = None,
        scaled: bool = False,
        relative_to: str | None = None,
    ) -> Self:
        """Add an item; returns the stack, so that calls chain.

        Args:
            item: a task or constraint.
            name: how rows, errors and ``controller[name]`` call it; default: the class name in snake case.
            level: of a task, an integer >= 0: lower numbers first, and later levels never disturb earlier ones,
                see docs/levels.md. A constraint is hard at level 0; at a level k > 0 its violation is minimised there.
            weight: of a task against the others of its level, >= 0; the cost of a row is
                weight * (rate error / scale)^2 with scale = characteristic length for rows in metres, else 1, see
                :data:`wbc.tasks.units.UNITS` for other units.
            hard: of a constraint; False: its rows give way before those of any hard one, see the order of sacrifice.
            soft: of a constraint, its price >= 0: a row that is violated by x costs price * (x / scale)^2, as much as a
                task row of that weight that misses its rate by x. The first value of the input ``price``.
            scaled: of a task; it is slowed down and never turned aside: J v = lambda w with one lambda in [0, 1] for
                the rates w that it asks for. Adds the item ``"<name> direction"``. docs/soft.md.
            relative_to: name of a :class:`wbc.tasks.MovingFrame` of the stack that takes the place of the world for
                this item; a field ``relative_to`` of the item says the same. docs/moving_frames.md.

        Raises:
            DuplicateNameError, LevelError, RangeError, ShapeError, UnknownNameError: bad input; the stack is unchanged.
        """
        if not isinstance(item, (Task, Constraint)):
            raise ShapeError("item", item, "expected a task or a constraint instance")
        chosen = self._free_name(_snake(type(item).__name__) if name is None else name)
        if isinstance(level, bool) or not isinstance(level, int):
            raise ShapeError("level", level, "expected an integer")
        if level < 0:
            raise LevelError("level", level, "expected an integer of 0 or more", ("0", "1", "2"))
        if level > 0 and isinstance(item, Constraint):
            _check_softened(level, item)
        given, (item, frame) = item, self._framed(item, chosen, relative_to)
        number = validation.scalar("weight", weight, low=0.0)
        if isinstance(item, Constraint) and number != 1.0:
            raise RangeError("weight", weight, "a constraint is hard, soft at a price, or minimised at its level")
        if not validation.flag("hard", hard):
            _require_soft(item, "hard", hard)
            if level > 0:
                raise RangeError("hard", hard, "a constraint at a level is minimised there, neither hard nor soft")
        price = None
        if soft is not None:
            price = validation.scalar("soft", soft, low=0.0, high=HIGHEST_PRICE)
            _require_soft(item, "soft", soft)
            if not hard:
                raise RangeError("soft", soft, "hard=False is soft without a price; leave one of them out")
        added = [Entry(item, chosen, level, number, bool(hard), price, frame, None if item is given else given)]
        if validation.flag("scaled", scaled):
            if not isinstance(item, Task) or not item.asks:
                raise RangeError("scaled", scaled, f"{type(item).__name__} asks for no velocity with a direction")
            kept = self._free_name(f"{chosen} direction")
            added.append(Entry(Direction(chosen, item), kept, level, 1.0, True, number * DIRECTION_PRICE))
        item.validate(self._robot)
        _check_values(item, self._robot)
        if isinstance(item, JointLimits) and (speed := LinkageSpeed(item)).rows(self._robot):
            added.append(Entry(speed, self._free_name(f"{chosen} linkages"), level, number))
        self._entries |= {entry.name: entry for entry in added}
        self._was_added(chosen)
        return self

    def _was_added(self, name: str) -> None:
        """An item is in the stack."""

    def _framed(self, item: Item, name: str, frame: str | None) -> tuple[Item, str]:
        """The item as it is in its own world, and the name of the moving frame that is this world."""
        if isinstance(item, MovingFrame) and name in self._robot.frame_names:
            raise DuplicateNameError("name", name, f"a frame of {self._robot.name!r} has this name")
        known = [entry.name for entry in self.entries if isinstance(entry.item, MovingFrame)]
        field = getattr(item, "relative_to", WORLD)
        if isinstance(field, str) and field in known:
            if frame not in (None, field):
                raise RangeError("relative_to", frame, f"the item itself is stated relative to {field!r}")
            own: dict[str, Any] = {"relative_to": WORLD}
            item, frame = dataclasses.replace(item, **own), field
        if frame is None:
            return item, ""
        validation.one_of("relative_to", frame, known)
        if not item.stands_in_world:
            raise RangeError("relative_to", frame, f"{type(item).__name__} depends on no frame outside the robot")
        return item, frame

    def _free_name(self, name: object) -> str:
        if not isinstance(name, str) or not name:
            raise ShapeError("name", name, "expected a non-empty string")
        if name in self._entries:
            raise DuplicateNameError("name", name, "an item of this name is in the stack; give another with name=")
        return name

    def __getitem__(self, name: str) -> Entry:
        try:
            return self._entries[name]
        except (KeyError, TypeError):
            raise UnknownNameError("item", name, self._entries) from None

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._entries

    def __len__(self) -> int:
        return len(self._entries)

    def __getstate__(self) -> dict[str, Any]:
        for entry in self.entries:
            for item in inner_items(entry.item):
                try:
                    item.__getstate__()
                except PicklingError as error:
                    raise error.within(entry.name) from error
        return pickling.declared(self)

    def __copy__(self) -> Self:
        out = object.__new__(type(self))
        out.__dict__ |= vars(self) | {"_entries": dict(self._entries)}
        return out

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return pickling.deep_copy(self, memo)

    def key_data(self) -> dict[str, Any]:
        """Plain data that the compiled code is a function of. Weights are run-time values and not in it."""
        return {
            "robot": self._robot.fingerprint,
            "length": self._length.hex(),
            "damping": self._damping.hex(),
            "calm": self.calm,
            "command": self._command,
            "items": [
                [e.name, e.level, e.item.declaration(self._robot), *_softness(e), *_frame(e)] for e in self.entries
            ],
        }


def _no_torques(robot: Robot) -> str:
    """Why motors cannot move a robot as a stack asks, "" where they can."""
    model, data, library = robot.tree, robot.tree.createData(), algebra(robot.tree)
    weight = library.computeTotalMass(model) * float(np.linalg.norm(model.gravity.linear))
    if library.computeTotalMass(model) <= 0.0:
        return f"the moving links of {robot.name!r} have no mass"
    # A floating or planar joint has several degrees of freedom; others that are locked have motors to hold them
    names = [robot.dof_names[k] for k in robot.locked_dofs if k >= robot.base_nv]
    if undriven := [name for name in names if name not in robot.joint_names]:
        return f"nothing drives {', '.join(undriven)} of {robot.name!r}: lock the joint"
    borne = np.abs(library.computeGeneralizedGravity(model, data, robot.neutral)[: robot.base_nv])
    if robot.base == "planar" and borne.max() > PLUMB * weight:
        return f"nothing holds the planar base of {robot.name!r} against {borne.max():.6g} N of its weight"
    moments = np.linalg.eigvalsh(library.crba(model, data, robot.neutral))
    if moments[0] < -SEMIDEFINITE * moments[-1]:
        bodies = [np.linalg.eigvalsh(body.inertia)[0] for body in model.inertias]
        worst = 1 + int(np.argmin(bodies[1:]))
        reason = f"the body on joint {str(model.names[worst])!r} has a moment of {bodies[worst]:.6g} kg m^2"
        return f"the mass matrix of {robot.name!r} has a negative eigenvalue, {moments[0]:.6g}: {reason}"
    return ""


def _check_values(item: Item, robot: Robot) -> None:
    """Rows can be made, which checks their units, and first values of inputs are values of theirs."""
    item.rows(robot)
    kind = type(item).__name__
    if isinstance(item, Task) and item.gain is not None:
        validation.scalar(f"{kind}.gain", item.gain, low=0.0, unit="1/s")
    for declared in item.inputs(robot):
        if declared.default is not None:
            inputs.flat(robot, f"{kind}.{declared.name}", declared, declared.default)


def soft_rows(entry: Entry, robot: Robot) -> int:
    """Rows of a constraint that have a slack at a price: the first ones."""
    if entry.price is None:
        return 0
    count = len(entry.item.rows(robot))
    return count - 1 if isinstance(entry.item, Direction) else count


def bends(entry: Entry) -> bool:
    """Whether equality rows of an item hold exactly and may bend within a tick, see :meth:`Constraint.residual`."""
    item = entry.item
    if not isinstance(item, Constraint) or type(item).residual is Constraint.residual:
        return False
    return item.equality and entry.price is None and entry.level == 0


def _softness(entry: Entry) -> list[str]:
    """What the compiled code knows of how soft an item is."""
    return ["priced"] if entry.price is not None else [] if entry.hard else ["soft"]


def _frame(entry: Entry) -> list[dict[str, str]]:
    """What the compiled code knows of the frame that an item is stated in."""
    return [{"in": entry.frame}] if entry.frame else []


def _require_soft(item: Item, field: str, value: object) -> None:
    """Refuse what cannot be soft."""
    if not isinstance(item, Constraint):
        raise RangeError(field, value, "a task is never hard: it has a weight")
    if item.form == "bounds":
        raise RangeError(field, value, f"{type(item).__name__} bounds joints, and bounds never give way")
    if item.order <= SacrificeOrder.POSITION:
        raise RangeError(field, value, f"{type(item).__name__} is what the robot can do, which never gives way")


def _check_softened(level: int, item: Constraint) -> None:
    """Only rows that may give way can be minimised at a level."""
    if item.form == "bounds":
        reason = f"{type(item).__name__} bounds velocities and is always hard; a level is for margins and rows"
    elif item.order <= SacrificeOrder.POSITION:
        reason = f"{type(item).__name__} is what the robot can do, which never gives way"
    else:
        return
    raise LevelError("level", level, reason, ("0",))


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def inner_items(item: Item) -> Iterator[Item]:
    """An item and the items that it is made from."""
    yield item
    for field in dataclasses.fields(item):
        value = getattr(item, field.name)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Item):
                yield from inner_items(part)
