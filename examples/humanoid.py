"""TALOS reaches far forward with one hand: feet held, and its centre of mass stays over the soles, 2 cm inside."""

import numpy as np

import wbc

robot = wbc.robots.load("talos", shapes="none")
hand, feet = robot.frames["right_hand"], [robot.frames["left_foot"], robot.frames["right_foot"]]
sole = [(x, y, 0.0) for x in (-0.09, 0.11) for y in (-0.06, 0.06)]
polygon = wbc.tasks.support_polygon(robot, dict.fromkeys(feet, sole), margin=0.02)

stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector(hand, kind="position"), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.Hold(feet[0]), name="left foot")
stack.add(wbc.tasks.Hold(feet[1]), name="right foot")
stack.add(wbc.tasks.JointLimits())
stack.add(polygon, name="polygon")
controller = stack.compile()

q = robot.neutral
target, foot, least = robot.pose(q, hand).translation + [0.4, 0.1, -0.2], robot.pose(q, feet[0]).translation, np.inf
controller["hand"].target = target
for _ in range(1000):
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)
    least = min(least, step.margins["polygon"].min())

error, drift = (np.linalg.norm(robot.pose(q, f).translation - p) for f, p in ((hand, target), (feet[0], foot)))
print(f"{step.status}: hand {1e3 * error:.2f} mm from its target, left foot moved {1e6 * drift:.2f} um")
print(f"centre of mass at least {1e3 * (least + 0.02):.1f} mm inside the edge of the soles")
if error > 0.01 or drift > 1e-4 or least < -1e-3:
    raise SystemExit("the hand did not arrive, a foot moved, or the robot would tip over")
