"""A ball flies through the arm's place while the hand tries to stay: the arm gives way and comes back."""

import numpy as np
import pinocchio as pin

import wbc

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp", gain=5.0), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits())
stack.add(wbc.tasks.Obstacle(wbc.shapes.Sphere(0.1), margin=0.02), name="ball")
controller = stack.compile()
controller["ball"].rate = 5.0
velocity = np.array([0.0, -0.3, 0.0])
controller["ball"].velocity = [*velocity, 0.0, 0.0, 0.0]

q = robot.neutral
nearest, furthest = np.inf, 0.0
for tick in range(1000):
    place = np.array([0.42, 0.7, 0.45]) + velocity * tick * stack.dt
    controller["ball"].pose = pin.SE3(np.eye(3), place)
    step = controller.step(q)
    nearest = min(nearest, step.margins["ball"].min())
    furthest = max(furthest, step.residuals["hand"].norm("m"))
    q = robot.integrate(q, step.v, stack.dt)

print(f"least distance beyond the margin {1e3 * nearest:.2f} mm, hand pushed {1e3 * furthest:.0f} mm away")
print(f"at the end: {step.status}, hand error {1e3 * step.residuals['hand'].norm('m'):.2f} mm")
