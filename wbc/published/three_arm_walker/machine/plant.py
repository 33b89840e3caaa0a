"""What moves: the body and the three arms, as the gait sees them. Units: inch, radian, second.

``IdealPlant`` is ideal tracking: the body follows its command, hands that hold stay where they are, a hand in the air
is on its motion wherever its wrist reaches. ``LiteralPlant`` (its own file) integrates joint rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wbc.multibody import pin
from wbc.published.three_arm_walker.machine.arm import START, forward, joint_beyond_reach
from wbc.published.three_arm_walker.machine.grid import PITCH, RADIUS, STEP, coordinates, cross, euler_angles, inverse
from wbc.published.three_arm_walker.machine.motion import CYCLE
from wbc.published.three_arm_walker.machine.reach import ARMS, Shoulders
from wbc.validation import Array


def body_twist(body: Array, rates: Array, height: float) -> Array:
    """Linear velocity of the body's origin and angular velocity, fixed axes [in/s, rad/s]: three components from the
    operator, three that keep its height and lay it flat, errors being taken back within one cycle. With r and th the
    radius and angle of the origin, and t, a, n the unit vectors round, along and off the cylinder,

        v = rate_T 5deg r t + 9.25 rate_A a + (100 + H - r) / dt n
        w = spin z + (z x -n) / dt - rate_T 5deg e_z

    Source: M. R. Patterson's thesis, 5.2; RVEL is not listed, this is a reconstruction.

    Args:
        body: 4 x 4. rates: of T and A [grid units/s], spin about the body's z axis [rad/s]. height: to be kept [in].
    """
    x, y, _ = body[:3, 3]
    radius = float(np.hypot(x, y))
    normal = np.array([x / radius, y / radius, 0.0])
    round_it = np.array([normal[1], -normal[0], 0.0])
    turn = float(rates[0]) * STEP
    linear = turn * radius * round_it + (RADIUS + height - radius) / CYCLE * normal
    linear[2] -= PITCH * rates[1]
    z = body[:3, 2]
    angular = rates[2] * z - cross(z, normal) / CYCLE
    angular[2] -= turn
    return np.concatenate([linear, angular])


def moved(pose: Array, twist: Array) -> Array:
    """A pose after one cycle of a twist in fixed axes."""
    out = pose.copy()
    out[:3, 3] += twist[:3] * CYCLE
    out[:3, :3] = np.asarray(pin.exp3(twist[3:] * CYCLE)) @ pose[:3, :3]
    return out


def body_place(body: Array) -> tuple[float, float, float]:
    """(T, A, heading [rad]) of the body."""
    column, row = coordinates(body[:3, 3])
    return float(column), float(row), euler_angles(body[:3, :3])[2]


@dataclass(frozen=True)
class CycleCommand:
    """What the arms do in a cycle: those that support hold on, one in the air may get a command.

    Attributes:
        supporting: 3. arm: in the air, 0 to 2; None without a command, when it goes on as before.
        twist: of its hand, fixed axes [in/s, rad/s].
    """

    supporting: tuple[bool, ...]
    arm: int | None = None
    twist: Array | None = None


@dataclass(frozen=True)
class Fault:
    """A joint (1 to 6) of an arm (1 to 3) that would leave its limits."""

    joint: int
    arm: int

    def __str__(self) -> str:
        return f"JOINT {self.joint} OF ARM {self.arm} IS OUT OF LIMITS."


class WalkerPose(Protocol):
    """The body (4 x 4) and the hands (3 x 4 x 4), fixed frame [in]."""

    @property
    def body(self) -> Array: ...

    @property
    def hands(self) -> Array: ...

    def place(self, arm: int, pose: Array) -> int | None:
        """Put a hand in the air where tracking is ideal; the joint that keeps it from there, if one does."""

    def move(self, twist: Array, order: CycleCommand) -> Fault | None:
        """One cycle: the body's twist, the order to the arms. With a fault nothing has moved."""


class IdealPlant:
    """Ideal tracking; of the arms only the reach of the wrists is looked at.

    Args:
        shoulders: of the body. body: where it starts, the arms in their starting posture.
    """

    def __init__(self, shoulders: Shoulders, body: Array) -> None:
        self.shoulders, self.body = shoulders, body
        self.hands = body @ shoulders.frames @ forward(START)

    def place(self, arm: int, pose: Array) -> int | None:
        joint = self._beyond(self.body, arm, pose)
        if joint is None:
            self.hands[arm] = pose
        return joint

    def move(self, twist: Array, order: CycleCommand) -> Fault | None:
        body = moved(self.body, twist)
        for arm in range(ARMS):
            joint = self._beyond(body, arm, self.hands[arm]) if order.supporting[arm] else None
            if joint is not None:
                return Fault(joint, arm + 1)
        self.body = body
        return None

    def _beyond(self, body: Array, arm: int, hand: Array) -> int | None:
        return joint_beyond_reach(inverse(body @ self.shoulders.frames[arm]) @ hand)
