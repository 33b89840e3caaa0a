"""Stacks that command torques: a fixed arm, a humanoid with a hand at a wall, the walker without gravity."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin

import wbc.robots
from wbc.api import Controller, Stack
from wbc.robot import Robot
from wbc.tasks import (
    CenterOfMass,
    EndEffector,
    JointLimits,
    PointContact,
    Posture,
    RigidGrasp,
    SurfaceContact,
    TorqueLimits,
)

DT = 0.002
NAMES = ("panda", "talos", "walker")


@cache
def robot(name: str) -> Robot:
    """With limits of acceleration and, where the description has none, of torque."""
    bot = wbc.robots.load(name)
    if name == "walker":
        bot = replace(bot, model=with_masses(bot))
    base = 6 if bot.base == "floating" else 0
    accelerations = np.full(bot.nv, 30.0)
    accelerations[:base] = np.inf
    effort = np.where(np.isfinite(bot.limits.effort), bot.limits.effort, 400.0)
    effort[:base] = np.inf
    return replace(bot, limits=bot.limits.override(acceleration=accelerations, effort=effort))


def with_masses(bot: Robot) -> pin.Model:
    """The walker's links as bodies of some kilograms, in zero gravity; its description has none."""
    model, rng = bot.model.copy(), np.random.default_rng(1)
    for j in range(1, model.njoints):
        mass = 60.0 if j == 1 else rng.uniform(1.0, 4.0)
        box = pin.Inertia.FromBox(mass, *rng.uniform(0.1, 0.4, 3))
        model.inertias[j] = pin.SE3(np.eye(3), rng.uniform(-0.05, 0.05, 3)).act(box)
    model.gravity.linear = np.zeros(3)
    return model


def stack(name: str) -> Stack:
    """The declaration; positions, so that a referee can follow."""
    bot = robot(name)
    out = Stack(bot, dt=DT)
    if name == "panda":
        out.add(EndEffector("panda_hand_tcp", kind="position"), name="hand")
    elif name == "talos":
        out.add(CenterOfMass(), name="com")
        out.add(EndEffector("gripper_left_base_link", kind="position"), name="hand", weight=0.5)
        for side in ("left", "right"):
            foot = SurfaceContact(f"{side}_sole_link", half_lengths=(0.1, 0.06), friction=0.7)
            out.add(foot, name=f"{side} foot")
        out.add(PointContact("gripper_right_base_link", friction=0.8, edges=6), name="palm")
    else:
        out.add(EndEffector("arm3_hand", kind="position"), name="hand")
        for arm in (1, 2):
            out.add(RigidGrasp(f"arm{arm}_hand", force=300.0, torque=(80.0, 90.0, 100.0)), name=f"grip {arm}")
    out.add(Posture(), name="posture", weight=1e-2)
    out.add(JointLimits())
    out.add(TorqueLimits())
    return out


@cache
def controller(name: str, backend: str = "vm", solver: str = "daqp") -> Controller:
    """Compiled; tests share it."""
    return stack(name).compile(command="torque", backend=backend, solver=solver)
