"""Values of handles as users write them, for the checker alone: ``make types`` fails where one that is ignored here is
right, or another one wrong.
"""

from __future__ import annotations

from wbc.api import Controller
from wbc.tasks.end_effector import EndEffector
from wbc.tasks.joint_limits import JointLimits


def use(c: Controller, hand: EndEffector, limits: JointLimits) -> float:
    c["hand"].target = 3
    c["hand"].taget = 3  # type: ignore[attr-defined]  # misspelt
    c[hand].target = 3
    c[hand].feedforward, c[hand].weight, c[hand].mask = 1, 2.0, 0
    c[hand].taget = 3  # type: ignore[attr-defined]  # misspelt
    c[limits].velocity_scale = 0.5
    c[limits].target = 3  # type: ignore[attr-defined]  # of another item
    c[hand].gain = "fast"  # type: ignore[assignment]  # no number
    c["hand"].set(anything=3)
    return c[hand].gian  # type: ignore[attr-defined,no-any-return]  # misspelt
