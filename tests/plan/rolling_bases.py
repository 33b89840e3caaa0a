"""Random bases on wheels with arms, and scenes about a way that one of them can go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import wbc
from tests.loops.mechanisms import numbers
from tests.plan.scenes import CoalJudge
from wbc.robot import Robot
from wbc.shapes import Box, Cylinder

RADIUS = 0.1
JOINTS = 3
INERTIA = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'


@dataclass(frozen=True)
class RollingProblem:
    """From where to where, among what."""

    stack: wbc.Stack
    start: np.ndarray
    goal: np.ndarray


def urdf(seed: int, turns: tuple[float, ...] = (0.0, np.pi), steered: bool = False) -> str:
    """A round base whose axle is anywhere under it, pointing anywhere, with an arm; ``turns``: where its wheels are."""
    rng = np.random.default_rng(seed)
    axle, yaw, arms = rng.uniform(-0.2, 0.2, 2), rng.uniform(-np.pi, np.pi), ""
    for k, turn in enumerate(turns):
        x, y = axle + 0.2 * np.array([np.sin(yaw + turn), -np.cos(yaw + turn)])
        facing = yaw + turn * (len(turns) > 2)
        arms += _joint(f"wheel{k}", "base", "continuous", (x, y, RADIUS), (-np.pi / 2.0, 0.0, facing))
        arms += _link(f"wheel{k}", (0.0, 0.0, 0.0), f'<cylinder radius="{RADIUS}" length="0.04"/>')
    if steered:
        arms += _joint("steer", "base", "revolute", (0.3, 0.0, RADIUS), (0.0, 0.0, 0.0)) + _link("steer")
        arms += _joint("front", "steer", "continuous", (0.0, 0.0, 0.0), (-np.pi / 2.0, 0.0, 0.0)) + _link("front")
    parent, place = "base", (0.0, 0.0, 0.5)
    for k in range(JOINTS):
        arms += _joint(f"arm{k}", parent, "revolute", place, tuple(rng.uniform(-1.0, 1.0, 3)))
        arms += _link(f"arm{k}", (0.0, 0.0, 0.15), '<cylinder radius="0.04" length="0.3"/>')
        parent, place = f"arm{k}", (0.0, 0.0, 0.3)
    body = _link("base", (0.0, 0.0, 0.3), '<cylinder radius="0.3" length="0.3"/>')
    return f'<robot name="rolling{seed}">{body}{arms}</robot>'


def _joint(name: str, parent: str, kind: str, place: tuple[float, ...], turn: tuple[float, ...]) -> str:
    at_place = f'<origin xyz="{numbers(np.array(place))}" rpy="{numbers(np.array(turn))}"/>'
    ends_of = 'lower="-2.5" upper="2.5" ' if kind == "revolute" else ""
    limit = f'<limit {ends_of}velocity="2" effort="10"/>'
    ends = f'<parent link="{parent}"/><child link="{name}"/><axis xyz="0 0 1"/>'
    return f'<joint name="{name}_joint" type="{kind}">{at_place}{ends}{limit}</joint>'


def _link(name: str, place: tuple[float, ...] = (0.0, 0.0, 0.0), shape: str = "") -> str:
    body = (
        f'<collision><origin xyz="{numbers(np.array(place))}"/><geometry>{shape}</geometry></collision>'
        if shape
        else ""
    )
    return f'<link name="{name}">{INERTIA}{body}</link>'


def rolling_stack(robot: Robot, *wheels: str, roller: float | None = None) -> wbc.Stack:
    """A stack that lets no wheel slip."""
    stack = wbc.Stack(robot, dt=0.01)
    rolling = [wbc.tasks.Wheel(f"{wheel}_joint", RADIUS, roller) for wheel in wheels]
    stack.add(wbc.tasks.Rolling(rolling), name="wheels")
    stack.add(wbc.tasks.Posture(), name="posture")
    stack.add(wbc.tasks.JointLimits())
    return stack


def rolling_problem(seed: int, file: str) -> RollingProblem:
    """Things stand close to the way of three drives, but not in it."""
    rng, robot = np.random.default_rng(seed), wbc.robots.load(file, base="planar")
    dofs = [robot.dofs(f"wheel{k}_joint").start for k in range(2)]
    arms = [robot.dofs(f"arm{k}_joint").start for k in range(JOINTS)]
    places, data, q = robot.position_index[arms], robot.model.createData(), robot.neutral.copy()
    q[places] = rng.uniform(-1.0, 1.0, JOINTS)
    way = [q]
    for leg in range(7):
        wheel = (
            rng.uniform(1.0, 2.5)
            * rng.choice([-1.0, 1.0])
            * np.array([1.0, 1.0 if leg % 2 else -1.0])
            * (8.0 if leg % 2 else 2.0)
        )
        arm = rng.uniform(-0.6, 0.6, JOINTS)
        for _ in range(40):
            v = np.zeros(robot.nv)
            v[dofs], v[arms] = wheel / 40.0, arm / 40.0
            # What the wheels do decides what the base does
            rows = np.vstack([slip_rows(robot, data, way[-1], dof) for dof in dofs])
            v[:3] = -np.linalg.lstsq(rows[:, :3], rows[:, dofs] @ v[dofs], rcond=None)[0]
            q = robot.integrate(way[-1], v)
            q[places] = np.clip(q[places], robot.limits.position_lower[arms], robot.limits.position_upper[arms])
            way.append(q)
    stack, ends = rolling_stack(robot, "wheel0", "wheel1"), (way[0], way[-1])
    count, path = 0, np.array(way)
    for _ in range(120):
        middle = np.array([*(path[rng.integers(len(path)), :2] + rng.uniform(-1.0, 1.0, 2)), rng.uniform(0.2, 0.9)])
        shape = (Cylinder(rng.uniform(0.05, 0.3), 1.5), Box(tuple(rng.uniform(0.1, 0.8, 3))))[rng.integers(2)]
        pose = pin.SE3(pin.exp3(np.array([0.0, 0.0, rng.uniform(-3.0, 3.0)])), middle)
        only = wbc.Stack(robot, dt=0.01).add(wbc.tasks.Obstacle(shape, pose=pose, margin=0.01), name="thing")
        judge = CoalJudge(only)
        if min(judge.margin(x) for x in path[::2]) > 0.01:
            stack.add(wbc.tasks.Obstacle(shape, pose=pose, margin=0.01), name=f"thing{count}")
            count += 1
    return RollingProblem(stack, *ends)


def slip_rows(robot: Robot, data: pin.Data, q: np.ndarray, dof: int) -> np.ndarray:
    """Velocity of the point of a wheel that touches the level ground, by v [2, nv], by Pinocchio."""
    pin.computeJointJacobians(robot.model, data, q)
    joint = next(j for j in range(1, robot.model.njoints) if robot.model.idx_vs[j] == dof)
    jacobian = pin.getJointJacobian(robot.model, data, joint, pin.LOCAL_WORLD_ALIGNED)
    return (jacobian[:3] + pin.skew(np.array([0.0, 0.0, RADIUS])) @ jacobian[3:])[:2]
