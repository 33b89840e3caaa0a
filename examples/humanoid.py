"""Talos reaches with its left hand: feet held, centre of mass kept above them, limits respected."""

import pinocchio as pin

import wbc

robot = wbc.robots.load("talos")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("gripper_left_base_link", kind="position"), name="hand", weight=0.5)
stack.add(wbc.tasks.CenterOfMass(), name="com")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
stack.add(wbc.tasks.Hold("left_sole_link"), name="left foot")
stack.add(wbc.tasks.Hold("right_sole_link"), name="right foot")
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q = robot.neutral
controller.reset(q)
controller["com"].mask = [1, 1, 0]  # the height of the centre of mass is free
controller["hand"].target = controller["hand"].target + [0.15, 0.1, 0.2]
for _ in range(1000):
    step = controller.step(q)
    q = pin.integrate(robot.model, q, step.v * stack.dt)
for name, residual in step.residuals.items():
    print(f"{name:8s} {residual}")
print(step.status, "- pushing rows:", len(step.binding))
