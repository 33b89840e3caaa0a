"""A hand follows a target on a circle while a ball flies through its path: the arm gives way and catches up."""

import numpy as np

import wbc

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp", gain=10.0), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits())
stack.add(wbc.tasks.Obstacle(wbc.shapes.Sphere(0.1), margin=0.02), name="ball")
controller = stack.compile()

q, nearest, errors, velocity = robot.neutral, np.inf, [], np.array([0.0, -0.3, 0.0])
start = robot.pose(q, "panda_hand_tcp")
for tick in range(1600):
    t = tick * stack.dt
    circle = 0.08 * np.array([0.0, np.sin(t), 1.0 - np.cos(t)])
    controller["hand"].target = (start.translation + circle, start.rotation)
    controller["hand"].feedforward = [0.0, 0.08 * np.cos(t), 0.08 * np.sin(t), 0.0, 0.0, 0.0]
    controller["ball"].pose = ([0.38, 0.7, 0.58] + velocity * t, np.eye(3))
    controller["ball"].velocity = [*velocity, 0.0, 0.0, 0.0]
    step = controller.step(q)
    nearest, errors = min(nearest, step.margins["ball"].min()), [*errors, step.residuals["hand"].norm("m")]
    q = robot.integrate(q, step.v, stack.dt)

print(f"least distance beyond the margin {1e3 * nearest:.2f} mm, hand pushed {1e3 * max(errors):.0f} mm away")
print(f"at the end: {step.status}, hand error {1e3 * errors[-1]:.2f} mm")
if nearest < -1e-3 or errors[-1] > 1e-3:
    raise SystemExit("the arm touched the ball's margin, or did not come back to its target")
