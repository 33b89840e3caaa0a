"""An MJCF file of one's own, arm.xml: sites are frames, and qpos goes in and out by the names of joints."""

from pathlib import Path

import mujoco
import numpy as np

import wbc

model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("arm.xml")))
data = mujoco.MjData(model)
robot = wbc.robots.load(model, velocity=2.0, acceleration=20.0)
joints = wbc.robots.MujocoJoints(model, robot)
stack = wbc.Stack(robot, dt=0.002)
stack.add(wbc.tasks.EndEffector("tool", gain=10.0), name="tool")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4).add(wbc.tasks.JointLimits())
controller = stack.compile()

q, pose = robot.neutral, robot.pose(robot.neutral, "tool")
controller["tool"].target = (pose.translation + [0.1, 0.2, -0.1], pose.rotation)
for _ in range(1000):
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)
joints.put_q(data.qpos, q)
mujoco.mj_kinematics(model, data)

error = np.linalg.norm(data.site("tool").xpos - controller["tool"].target.translation)
print(f"{step.status}: MuJoCo has the tool {1e3 * error:.3f} mm from its target")
if error > 1e-3:
    raise SystemExit("the tool did not arrive")
