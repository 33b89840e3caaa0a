"""What ``wbc view play`` opens: robots with a stack each, and where they begin."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wbc import robots, tasks, validation
from wbc.api import Stack
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.shapes import Box, Capsule, Cylinder, Sphere
from wbc.validation import Array

#: Gain of what is dragged [1/s]; with the accelerations below it comes to rest without overshoot
GAIN = 4.0


class Playground(NamedTuple):
    """A stack, the configuration that it begins at, and what there is to try."""

    stack: Stack
    start: Array
    about: str


def panda() -> Playground:
    """A Panda among obstacles, its elbow plane on a dial."""
    robot = robots.load("panda").with_limits(acceleration=8.0)
    stack = Stack(robot, dt=0.005)
    stack.add(tasks.EndEffector(robot.frames["tip"], gain=GAIN), name="hand")
    shoulder, elbow, wrist = (robot.frames[part] for part in ("shoulder", "elbow", "wrist"))
    reference = tasks.PlaneReference(pole=(1.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))
    stack.add(tasks.PitchPlane(shoulder, elbow, wrist, reference=reference), name="plane", weight=1e-4)
    stack.add(tasks.Posture(), name="posture", weight=1e-6)
    stack.add(tasks.JointLimits(), name="limits")
    for name, shape, place in (
        ("ball", Sphere(0.09), (0.42, 0.38, 0.45)),
        ("box", Box((0.25, 0.3, 0.3)), (0.55, -0.42, 0.15)),
        ("post", Cylinder(0.04, 0.6), (0.05, 0.5, 0.3)),
        ("bar", Capsule(0.03, 0.5), (0.62, 0.0, 0.85)),
    ):
        turn = pin.utils.rotate("x", np.pi / 2) if name == "bar" else np.eye(3)
        stack.add(tasks.Obstacle(shape, margin=0.015, pose=pin.SE3(turn, np.array(place))), name=name)
    return Playground(stack, robot.neutral, "Drag the hand, then an obstacle in its way.")


def dual_arm() -> Playground:
    """PR2 carries a tray with both hands."""
    robot = robots.load("pr2", base="fixed", lock=["?_gripper_*", "laser_*", "torso_*", "head_*"], shapes="none")
    hands = [robot.frames[f"{side}_hand"] for side in ("left", "right")]
    poses = [robot.pose(robot.neutral, hand) for hand in hands]
    tray = pin.SE3(np.eye(3), (poses[0].translation + poses[1].translation) / 2)
    for side, hand, pose in zip(("left", "right"), hands, poses, strict=True):
        robot = robot.with_frame(f"tray_{side}", hand, pose.actInv(tray))
    robot = robot.with_limits(acceleration=10.0)
    stack = Stack(robot, dt=0.01)
    stack.add(tasks.RelativePose("tray_left", "tray_right", at=(0, 0, 0), gain=10.0), name="grasp", weight=1e4)
    stack.add(tasks.EndEffector("tray_left", gain=GAIN), name="tray")
    stack.add(tasks.Posture(), name="posture", weight=1e-6)
    stack.add(tasks.JointLimits(), name="limits")
    return Playground(stack, robot.neutral, "Drag the tray: both hands keep it.")


def talos() -> Playground:
    """TALOS reaches with either hand, feet held, its centre of mass above them."""
    return _humanoid(robots.load("talos", shapes="none"))


def g1() -> Playground:
    """Unitree G1 reaches with either hand."""
    return _humanoid(robots.load("g1", shapes="none"))


def mobile() -> Playground:
    """TIAGo on its two driven wheels."""
    robot = robots.load("tiago_no_hand", lock=(), shapes="none")
    stack = Stack(robot, dt=0.02)
    stack.add(
        tasks.Rolling(tuple(tasks.Wheel(f"wheel_{side}_joint", 0.0985) for side in ("left", "right"))), name="wheels"
    )
    stack.add(tasks.EndEffector(robot.frames["tip"], kind="position", gain=GAIN), name="hand")
    arm = [name for name in robot.joint_names if "wheel" not in name and name != "root_joint"]
    stack.add(tasks.Posture(joints=tuple(arm)), name="posture", weight=1e-5)
    stack.add(tasks.JointLimits(), name="limits")
    return Playground(stack, robot.neutral, "Drag the hand out of reach: the wheels take it there.")


def walker() -> Playground:
    """The three-armed walker: two hands hold, the third and the body are dragged."""
    walker_robot = robots.walker()
    robot, arms = walker_robot.robot, walker_robot.arms
    stack = Stack(robot, dt=0.01)
    stack.add(tasks.EndEffector("body", gain=GAIN), name="body", weight=1e-2)
    stack.add(tasks.EndEffector(arms[2].hand, gain=GAIN), name=arms[2].name)
    for arm in arms[:2]:
        stack.add(tasks.Hold(arm.hand), name=f"{arm.name} holds")
    stack.add(tasks.Posture(), name="posture", weight=1e-6)
    stack.add(tasks.JointLimits(), name="limits")
    return Playground(stack, robot.neutral, "Drag the body or the free hand; two hands hold.")


def ssrms() -> Playground:
    """The Space Station's arm, its pitch plane on a dial."""
    robot = robots.load("ssrms").with_limits(acceleration=0.1)
    stack = Stack(robot, dt=0.02)
    stack.add(tasks.EndEffector("tip", gain=1.0), name="tip")
    shoulder, elbow, wrist = (robot.frames[part] for part in ("shoulder", "elbow", "wrist"))
    stack.add(tasks.PitchPlane(shoulder, elbow, wrist, reference=tasks.PlaneReference()), name="plane", weight=1e-4)
    stack.add(tasks.Posture(), name="posture", weight=1e-6)
    stack.add(tasks.JointLimits(), name="limits")
    return Playground(stack, np.array([0.3, 1.0, -0.5, 1.2, 0.7, -0.6, 0.9]), "Drag the tip; turn the pitch plane.")


def of_robot(robot: Robot) -> Playground:
    """Any robot: every joint that a motor drives on a slider, and its tip, or hands, to be dragged where it has any."""
    stack = Stack(robot, dt=0.02)
    for name, frame in robot.frames.items():
        if name == "tip" or name.endswith("_hand"):
            stack.add(tasks.EndEffector(frame, gain=GAIN), name=name)
    driven = [name for name in robot.joint_names if robot.dofs(name).start not in robot.passive]
    stack.add(tasks.Posture(joints=tuple(driven) if robot.passive else None), name="posture", weight=1e-4)
    if robot.base_nv:
        stack.add(tasks.Hold(robot.frames.get("base", robot.frame_names[1])), name="base")
    stack.add(tasks.JointLimits(), name="limits")
    return Playground(stack, robot.neutral, "Sliders move the joints.")


def _humanoid(robot: Robot) -> Playground:
    robot = robot.with_limits(acceleration={name: 15.0 for name in robot.joint_names if name != robot.joint_names[0]})
    stack = Stack(robot, dt=0.01)
    for side in ("right", "left"):
        stack.add(tasks.EndEffector(robot.frames[f"{side}_hand"], kind="position", gain=GAIN), name=f"{side} hand")
    stack.add(tasks.CenterOfMass(weights=(1, 1, 0)), name="balance")
    stack.add(tasks.Posture(), name="posture", weight=1e-4)
    for side in ("left", "right"):
        stack.add(tasks.Hold(robot.frames[f"{side}_foot"]), name=f"{side} foot")
    stack.add(tasks.JointLimits(), name="limits")
    return Playground(stack, robot.neutral, "Drag a hand: the whole body reaches, the feet stay.")


PRESETS: dict[str, Callable[[], Playground]] = {
    "panda": panda,
    "dual-arm": dual_arm,
    "talos": talos,
    "g1": g1,
    "mobile": mobile,
    "walker": walker,
    "ssrms": ssrms,
}


def playground(name: str) -> Playground:
    """A preset by its name.

    Raises:
        UnknownNameError: there is none of that name.
    """
    return PRESETS[validation.one_of("preset", name, PRESETS)]()
