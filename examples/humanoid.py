"""TALOS reaches forward with one hand: feet held, centre of mass above them, the rest stays near its posture."""

import numpy as np

import wbc

robot = wbc.robots.load("talos")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector(robot.frames["right_hand"], kind="position"), name="hand")
stack.add(wbc.tasks.CenterOfMass(weights=(1, 1, 0)), name="balance")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.Hold(robot.frames["left_foot"]), name="left foot")
stack.add(wbc.tasks.Hold(robot.frames["right_foot"]), name="right foot")
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q = robot.neutral
controller.reset(q)
foot = controller["left foot"].target.translation
controller["hand"].target = controller["hand"].target + np.array([0.25, 0.1, 0.15])
for _ in range(800):
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)

drift = np.linalg.norm(robot.pose(q, robot.frames["left_foot"]).translation - foot)
print(f"{step.status}: hand {1e3 * step.residuals['hand'].norm('m'):.2f} mm from its target,")
print(f"centre of mass {1e3 * step.residuals['balance'].norm('m'):.2f} mm off, left foot moved {1e6 * drift:.2f} um")
