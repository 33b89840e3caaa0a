"""Stacks of these tests: every shipped item on four robots, and random states and run-time values for them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from tests.constraints.robots import robot as limited_robot
from tests.evaluation import sample
from tests.tasks.robots import FRAMES, random_configuration
from wbc import tasks
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.native import toolchain
from wbc.robot import Robot
from wbc.shapes import HalfSpace, Sphere

DT = 0.005
NAMES = ("panda", "ur5", "kinova", "talos")

#: Names of the items of :func:`everything` that are tasks
TASKS = ("hand", "hand_in_base", "hand_place", "hand_turn", "elbow", "com", "posture", "damping")


@cache
def robot(name: str) -> Robot:
    """A robot with acceleration limits and a sphere and a capsule on four of its links."""
    return limited_robot(name)


def everything(name: str, calm: bool = True) -> Stack:
    """Every shipped task and constraint at once: for the QP itself, which need not be feasible."""
    bot, f = robot(name), FRAMES[name]
    link = next(iter(bot.shapes))
    stack = Stack(bot, DT, calm=calm)
    stack.add(tasks.EndEffector(f.tip), name="hand")
    stack.add(
        tasks.EndEffector(f.tip, relative_to=f.base, axes="frame", weights=(1, 2, 3, 4, 5, 0)), name="hand_in_base"
    )
    stack.add(tasks.EndEffector(f.tip, kind="position", relative_to=f.base, axes=f.middle), name="hand_place")
    stack.add(tasks.EndEffector(f.tip, kind="orientation", axes=f.base), name="hand_turn", weight=0.3)
    stack.add(tasks.Elbow(f.middle, offset=(0.1, -0.2, 0.05), axes=f.tip), name="elbow")
    stack.add(tasks.CenterOfMass(), name="com")
    stack.add(tasks.Posture(joints=(bot.joint_names[-1], bot.joint_names[0], bot.joint_names[2])), name="posture")
    stack.add(tasks.Damping(weights=range(1, bot.nv + 1)), name="damping", weight=1e-3)
    stack.add(tasks.Hold(f.middle), name="hold")
    stack.add(tasks.Hold(f.tip, kind="orientation"), name="hold_turn")
    stack.add(tasks.FrameVelocityLimit(f.tip, linear=0.5, angular=1.0, axes=f.tip, relative_to=f.base), name="speed")
    stack.add(tasks.Obstacle(Sphere(0.1), margin=0.02), name="ball")
    stack.add(tasks.Obstacle(HalfSpace(), links=link), name="floor")
    stack.add(tasks.JointLimits(margin=1e-3), name="limits")
    stack.add(tasks.Fixed(bot.joint_names[1:3]), name="fixed")
    return stack


def linear(name: str) -> Stack:
    """Everything, in the plain linear model."""
    return everything(name, calm=False)


def arm(name: str = "panda", posture: float = 1e-3, obstacle: bool = True, calm: bool = True) -> Stack:
    """A hand, a posture, joint limits and a ball: the usual stack."""
    stack = Stack(robot(name), DT, calm=calm)
    stack.add(tasks.EndEffector(FRAMES[name].tip), name="hand")
    stack.add(tasks.Posture(), name="posture", weight=posture)
    stack.add(tasks.JointLimits(), name="limits")
    if obstacle:
        stack.add(tasks.Obstacle(Sphere(0.05)), name="ball")
    return stack


def conflicts() -> Stack:
    """A Panda with what can contradict: two holds, a ball, a speed limit, joint limits, a fixed joint."""
    bot, f = robot("panda"), FRAMES["panda"]
    stack = Stack(bot, DT)
    stack.add(tasks.EndEffector(f.tip), name="hand")
    stack.add(tasks.Posture(), name="posture", weight=1e-3)
    stack.add(tasks.JointLimits(), name="limits")
    stack.add(tasks.Hold(f.tip, kind="position"), name="hold")
    stack.add(tasks.Hold(f.middle, kind="position"), name="hold_elbow")
    stack.add(tasks.Obstacle(Sphere(0.05), links=("panda_link5", "panda_link8")), name="ball")
    stack.add(tasks.FrameVelocityLimit(f.tip, linear=0.3), name="speed")
    return stack


def humanoid(calm: bool = True) -> Stack:
    """Talos: feet held, hands and centre of mass commanded, posture, joint limits."""
    bot = robot("talos")
    stack = Stack(bot, DT, calm=calm)
    stack.add(tasks.Hold("left_sole_link"), name="left_foot")
    stack.add(tasks.Hold("right_sole_link"), name="right_foot")
    stack.add(tasks.EndEffector("gripper_left_base_link"), name="left_hand")
    stack.add(tasks.EndEffector("gripper_right_base_link", kind="position"), name="right_hand")
    stack.add(tasks.CenterOfMass(), name="com")
    stack.add(tasks.Posture(), name="posture", weight=1e-3)
    stack.add(tasks.JointLimits(), name="limits")
    return stack


def randomise(controller: Controller, rng: np.random.Generator) -> dict[str, dict[str, Any]]:
    """Write a random value to every input, weight, mask and switch; what was written, by item."""
    written: dict[str, dict[str, Any]] = {}
    for name, block in core_of(controller).layout.blocks.items():
        given = [slot.input for slot in block.slots.values() if not slot.input.sensed]
        values = {declared.name: sample(controller.stack.robot, declared, rng) for declared in given}
        rows = len(block.rows)
        if block.form == "task":
            values |= {"weight": float(10.0 ** rng.uniform(-4, 1)), "mask": rng.uniform(0.0, 2.0, rows)}
        else:
            values["mask"] = (rng.random(rows) < 0.8).astype(float)
        values["enabled"] = bool(rng.random() < 0.85)
        for key, value in values.items():
            setattr(controller[name], key, value)
        written[name] = values
    return written


def near_limits(bot: Robot, rng: np.random.Generator, share: float = 0.4) -> np.ndarray:
    """A random configuration with some joints close to a position limit, on either side of it."""
    q = random_configuration(bot, rng)
    for i, k in enumerate(bot.position_index):
        ends = [e for e in (bot.limits.position_lower[i], bot.limits.position_upper[i]) if np.isfinite(e)]
        if k >= 0 and ends and rng.random() < share:
            q[k] = rng.choice(ends) + rng.normal(0.0, 0.03)
    return q


def inside(bot: Robot, rng: np.random.Generator, share: float = 0.6) -> np.ndarray:
    """A configuration within ``share`` of every joint's range; a base near the origin."""
    q = pin.integrate(bot.model, bot.neutral, 0.2 * rng.uniform(-1.0, 1.0, bot.nv))
    for i, k in enumerate(bot.position_index):
        low, high = bot.limits.position_lower[i], bot.limits.position_upper[i]
        if k >= 0 and np.isfinite(low) and np.isfinite(high):
            q[k] = (low + high) / 2 + share * (high - low) / 2 * rng.uniform(-1.0, 1.0)
    return q


def aim(controller: Controller, rng: np.random.Generator) -> None:
    """Move every target that the first configuration has set; put the ball somewhere, moving."""
    for name, block in core_of(controller).layout.blocks.items():
        item = controller[name]
        slot = block.slots.get("target")
        if slot is None or "foot" in name:
            continue
        if slot.input.kind == "pose":
            turn, place = pin.exp3(rng.normal(0.0, 0.3, 3)) @ item.target.rotation, item.target.translation
            item.target = pin.SE3(turn, place + rng.normal(0.0, 0.1, 3))
        elif slot.input.kind == "vector":
            item.target = item.target + rng.normal(0.0, 0.1, slot.size)
    if "ball" in controller:
        controller["ball"].pose = pin.SE3(np.eye(3), rng.uniform(-0.6, 0.6, 3))
        controller["ball"].velocity = rng.normal(0.0, 0.2, 6)


def quarrel(controller: Controller, rng: np.random.Generator) -> None:
    """Run-time values of :func:`conflicts` that contradict each other in many ways."""
    aim(controller, rng)
    for name in ("hold", "hold_elbow"):
        hold = controller[name]
        off = rng.normal(0.0, 0.02, 3) * (rng.random() < 0.5)
        hold.target = pin.SE3(hold.target.rotation, hold.target.translation + off)
        hold.enabled = bool(rng.random() < 0.6)
    controller["hand"].enabled = bool(rng.random() < 0.8)
    controller["speed"].linear = rng.uniform(0.0, 0.3, 3)


@cache
def _declared(builder: str, *args: Any) -> Stack:
    builders = {"everything": everything, "linear": linear, "arm": arm, "conflicts": conflicts, "humanoid": humanoid}
    return builders[builder](*args)


def controller(builder: str, *args: Any, backend: str = "vm", solver: str = "daqp") -> Controller:
    """A fresh controller of one of the stacks above: the clone of one that nothing is done with."""
    return _compiled(
        (toolchain.ROWS_FLAGS, toolchain.TICK_FLAGS), builder, *args, backend=backend, solver=solver
    ).clone()


@cache
def _compiled(flags: Any, builder: str, *args: Any, backend: str, solver: str) -> Controller:
    return _declared(builder, *args).compile(solver=solver, backend=backend)


__all__ = ["DT", "FRAMES", "NAMES", "controller", "random_configuration", "wbc"]
