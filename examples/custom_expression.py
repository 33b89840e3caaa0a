"""A task of one's own: any CasADi expression of the robot's kinematics; its Jacobian is derived."""

import wbc
from wbc.tasks import Expression, Input

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)

# The three lines: the flange looks at a point, so two components of its direction in the flange's frame vanish
point = Input("point", size=3, unit="m", default=[0.6, 0.3, 0.2])
look = Expression(lambda kin, p: kin.pose("panda_link8").inverse_point(p["point"])[:2], units="m", inputs=[point])
stack.add(look, name="look")

stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q = robot.neutral
for _ in range(600):
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)
print(step)

controller["look"].point = [0.3, -0.5, 0.4]
for _ in range(600):
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)
print(step)
