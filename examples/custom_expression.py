"""A task of one's own in three lines: the hand keeps a height and stays as far from the elbow as a target says."""

import casadi as ca
import pinocchio as pin

import wbc
from wbc.tasks import Expression, Input

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)

height = Expression(
    lambda kin, p: kin.position("panda_hand_tcp")[2] - p["height"],
    inputs=(Input("height", unit="m", default=0.5),),
    units=("m",),
)
stretch = Expression(
    lambda kin, p: ca.norm_2(kin.position("panda_hand_tcp") - kin.position("panda_link4")) - p["distance"],
    inputs=(Input("distance", unit="m", default=0.45),),
    units=("m",),
)
stack.add(height, name="height").add(stretch, name="stretch").add(wbc.tasks.Posture(), weight=1e-4)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q = robot.neutral
controller["height"].height = 0.35
for _ in range(1000):
    step = controller.step(q)
    q = pin.integrate(robot.model, q, step.v * stack.dt)
print("height error", step.residuals["height"], "| distance error", step.residuals["stretch"])
