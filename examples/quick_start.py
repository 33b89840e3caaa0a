"""A Panda moves its hand by 10 cm while its elbow plane stays where it is."""

import numpy as np
import pinocchio as pin

import wbc

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
stack.add(wbc.tasks.PitchPlane("panda_link2", "panda_link3", "panda_link6"), name="plane", weight=0.1)
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q = np.array([0.0, -0.5, 0.3, -2.0, 0.1, 1.6, 0.7])
controller.reset(q)
target = controller["hand"].target
target.translation += np.array([0.1, 0.05, -0.05])
controller["hand"].target = target

for _ in range(800):
    step = controller.step(q)
    q = pin.integrate(robot.model, q, step.v * stack.dt)

print(controller)
print(step)
