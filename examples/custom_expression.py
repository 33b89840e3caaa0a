"""A task and a constraint of one's own: CasADi expressions of the robot's kinematics; their Jacobians are derived."""

import wbc
from wbc.tasks import Expression, Input

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
# The flange looks at a point, so two components of its direction in the flange's frame vanish
point = Input("point", size=3, unit="m", default=[0.6, 0.3, 0.2])
look = Expression(lambda kin, p: kin.pose("panda_link8").inverse_point(p["point"])[:2], units="m", inputs=[point])
stack.add(look, name="look")
# The elbow stays at least so high
height = Expression(lambda kin, p: kin.position("panda_link4")[2], units="m")
stack.add(wbc.tasks.Limit(height, lower=0.55), name="height")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q, lowest = robot.neutral, 1.0
for place in ([0.6, 0.3, 0.2], [0.3, -0.5, 0.4]):
    controller["look"].point = place
    for _ in range(600):
        step = controller.step(q)
        q = robot.integrate(q, step.v, stack.dt)
        lowest = min(lowest, robot.pose(q, "panda_link4").translation[2])
    error = step.residuals["look"].norm("m")
    print(f"{step.status}: look {1e3 * error:.2f} mm past the point, elbow at least {lowest:.4f} m high")
    if error > 0.01 or lowest < 0.549:
        raise SystemExit("the flange looks elsewhere, or the elbow sank")
