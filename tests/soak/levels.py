"""Random strict levels for the items of a random stack."""

from __future__ import annotations

import numpy as np

import wbc
from wbc.tasks import FrameVelocityLimit, Obstacle
from wbc.tasks._direction import Direction

#: Levels of tasks, and the share of margins and speed limits that are minimised at one
DEPTH, SHARE = 3, 0.3


def with_levels(stack: wbc.Stack, rng: np.random.Generator) -> wbc.Stack:
    """The same items; every task at one of some levels, some constraints below the first."""
    out = wbc.Stack(stack.robot, dt=stack.dt, calm=stack.calm)
    scaled = {e.item.of for e in stack.entries if isinstance(e.item, Direction)}
    for entry in stack.entries:
        level, item = 0, entry.item
        if entry.is_task:
            level = int(rng.integers(DEPTH))
        elif isinstance(item, (FrameVelocityLimit, Obstacle)) and rng.random() < SHARE:
            level = int(rng.integers(1, DEPTH))
        if not isinstance(item, Direction):
            out.add(
                item, name=entry.name, level=level, weight=entry.weight, soft=entry.price, scaled=entry.name in scaled
            )
    return out
