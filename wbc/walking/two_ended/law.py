"""A swing of the two-ended arm over time: all joints, and the hand that goes with them."""

from __future__ import annotations

from wbc.validation import Array
from wbc.walking.planner.swings.law import Aim, SwingLaw


class TurnLaw(SwingLaw):
    """A table of joints and of the hand that swings, from the lift to the landing; between rows straight lines.

    Args:
        hands: places of the hand ``[n, 3]`` [m]. joints: of its arm, from the body outwards ``[n, joints]`` [rad].
        spacing: from row to row [s].
    """

    def __init__(self, hands: Array, joints: Array, spacing: float) -> None:
        self.possible, self.duration = True, (len(hands) - 1) * spacing
        self._spacing, self._hands, self._joints = spacing, hands, joints

    @property
    def places(self) -> Array:
        """Of the hand at the rows ``[n, 3]`` [m]."""
        return self._hands

    @property
    def spacing(self) -> float:
        """From row to row [s]."""
        return self._spacing

    def at(self, time: float) -> Aim:
        """The aim at a time since lifting, clipped to the swing."""
        row, part = self._place(time)
        span = self._hands[row + 1] - self._hands[row]
        whole = min(max(time / self.duration, 0.0), 1.0)
        return Aim(self._hands[row] + part * span, span / self._spacing, whole, whole)

    def posture(self, time: float) -> tuple[Array, Array]:
        """Joints [rad] and their rates [rad/s] at a time, clipped to the swing."""
        row, part = self._place(time)
        span = self._joints[row + 1] - self._joints[row]
        return self._joints[row] + part * span, span / self._spacing

    def _place(self, time: float) -> tuple[int, float]:
        place = min(max(time / self._spacing, 0.0), len(self._hands) - 1.0)
        row = min(int(place), len(self._hands) - 2)
        return row, place - row
