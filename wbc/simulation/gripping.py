"""What plants that take torques, and whose robot can grasp, have alike: commands, grips, and what goes wrong."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, UnknownNameError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.simulation.dynamics import Grip, Slip
from wbc.simulation.momentum import Balance
from wbc.simulation.motors import MotorState, PlantMotors
from wbc.simulation.plant import Command, CommandKind, GripKind, PlantState, numbers_of
from wbc.validation import Array

#: How far from its hold a frame may be when it is grasped [m]
REACH = 0.01
#: How far from its hold's orientation a frame may be when it is grasped [rad]
TURN = 0.1


@dataclass(eq=False, kw_only=True)
class GrippingState:
    """What changes of such a plant beside where its robot is."""

    command: Array
    motors: MotorState
    scale: Array
    random: np.random.Generator
    first: Array = field(default_factory=lambda: np.zeros(6))
    fallen: Array = field(default_factory=lambda: np.zeros(6))
    grips: dict[str, Grip] = field(default_factory=dict)
    slips: dict[str, Slip] = field(default_factory=dict)
    broken: list[str] = field(default_factory=list)


class Gripping(ABC):
    """Base of plants that take torques; they hold frames where :attr:`grips` says, and are told when that changes."""

    commands: Collection[CommandKind] = (CommandKind.TORQUE,)
    robot: Robot
    nv: int
    _state: GrippingState
    _drive: PlantMotors
    _balance: Balance
    _placed: pin.Data

    @property
    @abstractmethod
    def state(self) -> PlantState:
        """The truth."""

    @abstractmethod
    def _changed(self, frame: str) -> None:
        """A grip is new, elsewhere or gone."""

    def apply(self, command: Command) -> None:
        """Take torques ``[nv]``.

        Raises:
            UnknownNameError: another kind of command. ShapeError, NotFiniteError: no command, no numbers.
        """
        self._state.command = numbers_of(command, self.commands, self.nv)

    def _motors_on(self, v: Array) -> Array:
        """What the motors give over the next time step ``[nv]``."""
        state = self._state
        return state.scale * self._drive.torque(state.motors, state.command, v, state.random)

    def _take(self, frame: str, pose: pin.SE3, kind: GripKind) -> pin.SE3:
        """A frame is held from now on; returns where it is."""
        kind = GripKind(validation.one_of("kind", str(kind), [str(k) for k in GripKind]))
        pose = validation.pose("pose", pose)
        if frame in self._state.grips:
            raise RangeError("frame", frame, "it is held already")
        model = self.robot.model
        pin.framesForwardKinematics(model, self._placed, self.state.q)
        at = self._placed.oMf[model.getFrameId(frame)].copy()
        check_reach(frame, at, pose, kind)
        self._state.grips[frame] = Grip(pose, kind)
        self._changed(frame)
        return at

    def release(self, frame: str) -> None:
        """See :class:`wbc.simulation.GrippingPlant`."""
        if frame not in self._state.grips:
            raise UnknownNameError("frame", frame, self._state.grips)
        del self._state.grips[frame]
        self._state.slips.pop(frame, None)
        self._changed(frame)

    def lost(self) -> tuple[str, ...]:
        """See :class:`wbc.simulation.GrippingPlant`."""
        out = tuple(self._state.broken)
        self._state.broken.clear()
        return out

    def lose(self, frame: str) -> None:
        """What holds a frame breaks off.

        Raises:
            UnknownNameError: nothing holds it.
        """
        self.release(frame)
        self._state.broken.append(frame)

    def slip(self, frame: str, velocity: Any, duration: float) -> None:
        """A grip slips: what it holds the frame at moves with a mean velocity in the world [m/s] for some seconds, as
        of :class:`wbc.simulation.dynamics.Slip`.

        Raises:
            UnknownNameError: nothing holds that frame.
        """
        validation.one_of("frame", frame, self._state.grips)
        rate = validation.real_array("velocity", velocity, (3,))
        time = validation.scalar("duration", duration, low=0.0, open_low=True, unit="s")
        self._state.slips[frame] = Slip(rate, time)

    def limp(self, joint: str, scale: float = 0.0) -> None:
        """The motor of a joint gives this part of its torque from now on.

        Raises:
            UnknownNameError: no such joint.
        """
        self._state.scale[self.robot.dofs(joint)] = validation.scalar("scale", scale, low=0.0, high=1.0)

    @property
    def grips(self) -> Mapping[str, Grip]:
        """Frame -> how it is held."""
        return self._state.grips

    @property
    def given(self) -> Array:
        """Momentum that the robot has given to what it holds on to or stands on since the reset: what it has lost, and
        what gravity gave it, (linear; angular about the world's origin) [N s, N m s].
        """
        return self._state.first + self._state.fallen - self.momentum

    @property
    def momentum(self) -> Array:
        """Of the robot, see :class:`Balance` ``[6]``."""
        state = self.state
        return self._balance.momentum(state.q, state.v)

    def _slide(self, h: float) -> None:
        """Grips that slip, a step on."""
        state = self._state
        for name, slip in list(state.slips.items()):
            grip, (moved, left) = state.grips[name], slip.on(h)
            state.grips[name] = Grip(pin.SE3(grip.pose.rotation, grip.pose.translation + moved), grip.kind)
            if left is None:
                del state.slips[name]
            else:
                state.slips[name] = left
            self._changed(name)


def check_reach(frame: str, at: pin.SE3, pose: pin.SE3, kind: GripKind) -> None:
    """A frame is grasped where it is, as far as the kind holds it.

    Raises:
        RangeError: it is too far away.
    """
    off = float(np.linalg.norm(at.translation - pose.translation))
    turn = float(np.linalg.norm(pin.log3(at.rotation.T @ pose.rotation)))
    if kind is GripKind.AXIS:
        turn = float(np.arccos(np.clip(at.rotation[:, 2] @ pose.rotation[:, 2], -1.0, 1.0)))
    if off > REACH or (turn > TURN and kind is not GripKind.POSITION):
        most = f"{REACH:g} and {TURN:g} are possible"
        reason = f"an impossible contact: {frame} is {off:.3g} m and {turn:.3g} rad off, {most}"
        raise RangeError("pose", pose.translation.tolist(), reason)
