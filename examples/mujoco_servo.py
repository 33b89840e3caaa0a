"""A MuJoCo arm on its own position servos at 1 kHz follows a figure of eight: servos lag and sag, the tool does not."""

from pathlib import Path

import mujoco
import numpy as np

import wbc
from wbc.servo import Servo
from wbc.simulation import MujocoPlant

model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("arm.xml")))
robot = wbc.robots.load(model, velocity=3.0, acceleration=30.0)
stack = wbc.Stack(robot, dt=0.001)
stack.add(wbc.tasks.EndEffector("tool", gain=20.0), name="tool")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
stack.add(wbc.tasks.JointLimits())


def eight(t: float) -> np.ndarray:
    """A figure of eight of 0.2 m in 2 s that begins at rest [m]."""
    return min(t, 1.0) * np.array([0.0, 0.1 * np.sin(np.pi * t), 0.1 * np.sin(2 * np.pi * t)])


plant, servo, q = MujocoPlant(model, robot), Servo(stack.compile(), "position"), robot.neutral
plant.reset(q, 0.0)
servo.reset(q)
pose, tool, errors = robot.pose(q, "tool"), servo.controller["tool"], []
for k in range(4000):
    here, there = eight(k * stack.dt), eight((k + 1) * stack.dt)
    tool.target = (pose.translation + here, pose.rotation)
    tool.feedforward = [*(there - here) / stack.dt, 0.0, 0.0, 0.0]
    state = plant.read()
    plant.apply(servo.step(state.q, state.v).command)
    plant.advance(stack.dt)
    errors.append(np.linalg.norm(plant.data.site("tool").xpos - tool.target.translation))

print(f"tool {1e3 * np.median(errors[2000:]):.2f} mm (median), {1e3 * max(errors[2000:]):.2f} mm (worst) off")
if np.median(errors[2000:]) > 0.003:
    raise SystemExit("the tool does not follow")
