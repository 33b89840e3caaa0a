"""A ball flies at a Panda's forearm; the hand stays where it is as long as it can, the arm gives way."""

import numpy as np
import pinocchio as pin

import wbc

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
stack.add(wbc.tasks.Posture(), weight=1e-3)
stack.add(wbc.tasks.JointLimits())
links = ("panda_link4", "panda_link5", "panda_link6")
stack.add(wbc.tasks.Obstacle(wbc.shapes.Sphere(0.08), links=links), name="ball")
controller = stack.compile()

q, center, velocity = robot.neutral, np.array([0.2, 0.6, 0.65]), np.array([0.02, -0.15, 0.0])
controller["ball"].velocity = np.r_[velocity, np.zeros(3)]
controller["ball"].margin = 0.02
least, farthest = np.inf, 0.0
for _ in range(600):
    controller["ball"].pose = pin.SE3(np.eye(3), center)
    step = controller.step(q)
    least = min(least, step.margins_ahead["ball"].min())
    farthest = max(farthest, step.residuals["hand"].norm("m"))
    q = pin.integrate(robot.model, q, step.v * stack.dt)
    center = center + velocity * stack.dt
print(f"least clearance {20 + 1000 * least:.2f} mm, 20 asked for; hand off by {1000 * farthest:.2f} mm at most")
