"""Robots with masses for plants: the walker, and an arm of two joints."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin

import wbc.robots
from wbc.robot import Robot
from wbc.robots import Walker
from wbc.simulation import GripKind, PinocchioPlant

HANDS = ("arm1_hand", "arm2_hand", "arm3_hand")


@cache
def heavy() -> Walker:
    """The walker with masses, in zero gravity."""
    return wbc.robots.with_masses(wbc.robots.walker())


def held(plant: PinocchioPlant, count: int, kind: GripKind = GripKind.POSE) -> None:
    """Close hands where they are."""
    for hand in HANDS[:count]:
        plant.grasp(hand, plant.robot.pose(plant.state.q, hand), kind)


def off(plant: PinocchioPlant) -> float:
    """Farthest that a closed hand is from its hold [m]."""
    robot, q = plant.robot, plant.state.q
    gaps = (robot.pose(q, name).translation - grip.pose.translation for name, grip in plant.grips.items())
    return max(float(np.linalg.norm(gap)) for gap in gaps)


def velocity(robot: Robot, size: float, seed: int = 0) -> np.ndarray:
    """Of every coordinate [m/s, rad/s]."""
    return size * np.random.default_rng(seed).normal(size=robot.nv)


def random_torque(robot: Robot, size: float, seed: int = 0) -> np.ndarray:
    """Of every motor [N m]; none of the base."""
    out = size * np.random.default_rng(seed).normal(size=robot.nv)
    out[: robot.base_nv] = 0.0
    return out


def residual(plant: PinocchioPlant, tau: np.ndarray) -> float:
    """By which M a + h = tau + J'w is missed [N m], all by other functions of Pinocchio than the plant's."""
    model, state = plant.model, plant.state
    data, a = model.createData(), plant.acceleration(tau)
    left = pin.rnea(model, data, state.q, state.v, a) - tau
    for name, wrench in plant.wrenches.items():
        left -= pin.computeFrameJacobian(model, data, state.q, model.getFrameId(name), pin.LOCAL).T @ wrench
    return float(np.abs(left).max())
