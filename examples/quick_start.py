"""A hand that follows a moving target within joint limits: the ten-line stack."""

import numpy as np
import pinocchio as pin

import wbc

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp", gain=10.0), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()
print(controller)

q = robot.neutral
controller.reset(q)
start = controller["hand"].target
speed = np.array([0.0, 0.1, -0.05, 0.0, 0.0, 0.0])  # twist: linear m/s, angular rad/s
controller["hand"].feedforward = speed
for tick in range(400):
    offset = speed[:3] * tick * stack.dt
    controller["hand"].target = pin.SE3(start.rotation, start.translation + offset)
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)

error = step.residuals["hand"].norm("m")
print(f"after {400 * stack.dt:g} s: {step.status}, hand error {1e3 * error:.3f} mm")
