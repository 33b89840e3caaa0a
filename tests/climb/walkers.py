"""The published walker on its cylinder, and with other numbers of arms."""

from __future__ import annotations

import functools

import pinocchio as pin

from wbc.climb import Climber
from wbc.climb.climber import ClimbLimb
from wbc.climb.contacts import GripHand
from wbc.climb.grids import INCH, grid_pose
from wbc.climb.machines import FLIP
from wbc.robots import walker
from wbc.robots.walker_data import spaced_radius
from wbc.robots.walker_masses import with_masses


def over(t: float, a: float, heading: float = 0.0) -> pin.SE3:
    """The body over the published cylinder, 52 in above its holds."""
    return grid_pose(t, a, 152 * INCH, heading)


@functools.cache
def walker_with(arms: int) -> Climber:
    """Two to six, as far from each other as three of them."""
    machine = with_masses(walker(arms, spaced_radius(arms, walker().data.shoulder_radius)))
    hands = [ClimbLimb(arm.hand, GripHand(rolls=True), FLIP, arm.name) for arm in machine.arms]
    return Climber(machine.robot, hands, name=f"walker of {arms}", height=machine.arm_data.body_height)
