"""What moves: the body and the three arms, as the gait sees them. Units: inch, radian, second.

``IdealPlant`` is ideal tracking: the body follows its command, hands that hold stay where they are, a hand in the air
is on its motion wherever its wrist reaches. ``LiteralPlant`` (its own file) integrates joint rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from wbc.published.three_arm_walker.machine.arm import START, forward, joint_beyond_reach
from wbc.published.three_arm_walker.machine.body import moved
from wbc.published.three_arm_walker.machine.reach import ARMS, Shoulders
from wbc.published.three_arm_walker.machine.rigid import inverse
from wbc.validation import Array


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
