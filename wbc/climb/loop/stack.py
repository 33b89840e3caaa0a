"""The stack of a climber, declared once for velocities and for torques."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Literal

import casadi as ca
import numpy as np

from wbc import tasks
from wbc.api import Stack
from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import ContactKind
from wbc.robot import Robot
from wbc.simulation import CommandKind
from wbc.symbolic.tracer import Tracer
from wbc.tasks._contact import Cone, Contact, force_row
from wbc.tasks.base import Input, Row, Rows, SacrificeOrder, Values
from wbc.validation import Array

#: Weight of the body's pose, beside 1 of every joint
BODY = 100.0
#: Weight of the contact frame of a limb in the air
SWING = 10.0
#: Components of the wrench of a contact that fixes so much
COMPONENTS = {"position": (0, 1, 2), "axis": (0, 1, 2, 3, 4), "pose": (0, 1, 2, 3, 4, 5)}


@dataclass(frozen=True)
class FootholdContact(Contact):
    """A contact frame does not move, as of ``Hold`` with the kind of :attr:`ContactKind.fixed`, and its wrench w keeps

        J v = -gain e + t,      A w <= b        of the contact's kind, in the axes of the foothold

    so that friction counts from the surface's normal however a foot turns on it. Compiled for velocities it is the hold
    alone.

    Attributes:
        frame: the contact frame.
        kind: how it holds.

    Inputs:
        target: pose of the contact frame at the foothold in the world [m, rad].
        gain: how fast drift decays [1/s].
        feedforward: t, J v of a motion that keeps the frame where it is over a whole tick, world axes [m/s; rad/s].
        slopes: entries of A that are not zero in :meth:`ContactKind.cone`, by rows.
        bounds: b [N; N m].
    """

    #: Made here, so it is not in the table of items
    abstract: ClassVar[bool] = True

    kind: ContactKind

    @property
    def axes(self) -> tuple[int, ...]:  # type: ignore[override]  # of the kind, not of the class
        """Components of the wrench, by what is fixed."""
        return COMPONENTS[self.kind.fixed]

    @property
    def cone_order(self) -> SacrificeOrder:  # type: ignore[override]  # of the kind, not of the class
        """No surface pulls: the contact moves before that; a grip's rating gives way first."""
        return SacrificeOrder.MARGIN if self.kind.pulls else SacrificeOrder.POSITION

    @property
    def _hold(self) -> tasks.Hold:
        return tasks.Hold(self.frame, kind=self.kind.fixed)

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        """Those of the hold, with the feed-forward."""
        held = self._hold.velocity_rows(robot, kin, inputs, dt)
        side = held.lower + self.still(inputs, kin.pose(self.frame).rotation, inputs["feedforward"])
        return Rows(held.matrix, side, side)

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> None:
        """None: how the frame's way bends within a tick is known before it, and in the feed-forward."""

    def still(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        """The twist in the axes of the rows; the rate of R'w is R' dw/dt."""
        if self.kind.fixed == "axis":
            return ca.SX(ca.vertcat(twist[:3], (rotation.T @ twist[3:])[:2]))
        return ca.SX(twist[: self.components])

    def unit_wrenches(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        """Along the axes of the foothold."""
        turn = (rotation.T @ inputs["target"].rotation).T
        return ca.SX(ca.sparsify(ca.SX(self.borne)) @ ca.diagcat(turn, turn))

    @cached_property
    def borne(self) -> Array:
        """Wrenches in the axes of the foothold that each component is the size of ``(components, 6)``: forces are those
        where the contact touches, below its frame's origin.
        """
        wrenches = np.eye(6)
        wrenches[0, 4], wrenches[1, 3] = -self.kind.height, self.kind.height
        return wrenches[list(self.axes)]

    def sizes(self, robot: Robot) -> Array:
        """What the contact bears of each component where it is pressed by the robot's weight, or pulls by nothing, at
        most that weight: loads are shared in proportion to what contacts bear, and soles are pressed in their middle.
        """
        (a, b), most = self.kind.cone(), super().sizes(robot)
        pressed = 0.0 if self.kind.pulls else most[2]
        slopes = a @ self.borne.T
        rooms = np.full(slopes.shape, np.inf)
        np.divide((b - pressed * a[:, 2])[:, None], slopes, out=rooms, where=slopes > 0.0)
        return np.asarray(np.minimum(most, rooms.min(axis=0)))

    def limits(self) -> tuple[Input, ...]:
        """``feedforward``, and ``slopes`` and ``bounds`` of the kind."""
        slopes, bounds = self.numbers(np.inf)
        return (
            Input("feedforward", unit="m/s, rad/s", size=6, default=np.zeros(6)),
            Input("slopes", size=len(slopes), default=slopes),
            Input("bounds", unit="N, N m", size=len(bounds), default=bounds),
        )

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        """Numbered; a row with a force is one of forces."""
        return tuple(
            force_row(robot, f"cone {k}", "N" if row[:3].any() else "N m")
            for k, row in enumerate(self._pattern, start=1)
        )

    def cone(self, inputs: Values) -> Cone:
        """A w <= b."""
        places = np.argwhere(self._pattern)
        matrix = ca.SX(*self._pattern.shape)
        for k, (row, column) in enumerate(places.tolist()):
            matrix[row, column] = inputs["slopes"][k]
        return Cone(matrix, -ca.SX.inf(len(self._pattern)), inputs["bounds"])

    def numbers(self, friction: float, share: float = 1.0) -> tuple[Array, Array]:
        """``slopes`` and ``bounds`` on a surface of a friction, and with a share as of ``ContactKind.lower``."""
        a, b = self.kind.lower(friction, share).cone()
        return (a @ self.borne.T)[self._rows][self._pattern], b[self._rows]

    @cached_property
    def _rows(self) -> Array:
        """Rows of A that are not about components which the motion leaves free."""
        return np.asarray((self.kind.cone()[0] @ self.borne.T).any(axis=1))

    @cached_property
    def _pattern(self) -> Array:
        """Where A is not zero."""
        return np.asarray((self.kind.cone()[0] @ self.borne.T)[self._rows] != 0.0)


def contact_frame(limb: ClimbLimb) -> str:
    """Name of a limb's contact frame in :func:`contact_robot`."""
    return f"{limb.name} contact frame"


def contact_robot(climber: Climber, gravity: Array) -> Robot:
    """The robot with the contact frames of its limbs, in a gravity ``(3)`` [m/s^2]."""
    model = climber.robot.model.copy()
    model.gravity.linear = np.array(gravity, dtype=float)
    robot = replace(climber.robot, model=model)
    for limb in climber.limbs:
        robot = robot.with_frame(contact_frame(limb), limb.frame, limb.placement)
    return robot


def climb_stack(climber: Climber, gravity: Array, dt: float, command: CommandKind = CommandKind.VELOCITY) -> Stack:
    """What a climber does in each tick. Items:

        "reference"      Posture of all coordinates, the body before the joints
        "LIMB contact"   FootholdContact, hard, while the limb is closed
        "LIMB swing"     EndEffector of the contact frame, while it is in the air
        "limits"         JointLimits;  "motors": TorqueLimits, of torques alone

    Args:
        climber: robot and limbs. gravity: [m/s^2]. dt: period [s]. command: what the stack is compiled for.
    """
    robot = contact_robot(climber, gravity)
    stack = Stack(robot, dt=dt, calm=False)
    weights = np.where(np.arange(robot.nv) < robot.base_nv, BODY, 1.0)
    stack.add(tasks.Posture(joints=robot.joint_names, weights=tuple(weights.tolist())), name="reference")
    stack.add(tasks.JointLimits(), name="limits")
    for limb in climber.limbs:
        name, frame = limb.name, contact_frame(limb)
        stack.add(FootholdContact(frame, limb.contact), name=f"{name} contact")
        followed: Literal["position", "pose"] = "position" if limb.contact.fixed == "position" else "pose"
        # A hand that may roll has a roll of its own in the air
        counted = (1.0, 1.0, 1.0, 1.0, 1.0, 0.0) if limb.contact.fixed == "axis" else None
        swing = tasks.EndEffector(frame, kind=followed, axes="frame" if counted else "reference", weights=counted)
        stack.add(swing, name=f"{name} swing", weight=SWING)
    if command is CommandKind.TORQUE:
        stack.add(tasks.TorqueLimits(), name="motors")
    return stack
