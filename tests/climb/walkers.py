"""The published walker with other numbers of arms."""

from __future__ import annotations

import functools

from wbc.climb import Climber
from wbc.climb.climber import ClimbLimb
from wbc.climb.contacts import GripHand
from wbc.climb.machines import FLIP
from wbc.robots import walker
from wbc.robots.walker_data import spaced_radius
from wbc.robots.walker_masses import with_masses


@functools.cache
def walker_with(arms: int) -> Climber:
    """Two to six, as far from each other as three of them."""
    machine = with_masses(walker(arms, spaced_radius(arms, walker().data.shoulder_radius)))
    hands = [ClimbLimb(arm.hand, GripHand(rolls=True), FLIP, arm.name) for arm in machine.arms]
    return Climber(machine.robot, hands, name=f"walker of {arms}", height=machine.arm_data.body_height)
