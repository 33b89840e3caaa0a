"""A URDF of one's own, arm.urdf: limits, shapes and masses are read, and the tool draws a square."""

from pathlib import Path

import wbc

robot = wbc.robots.load(
    Path(__file__).with_name("arm.urdf"), acceleration=20.0, neutral={"shoulder": 0.4, "elbow": 1.2}
)
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("tool", kind="position", gain=10.0), name="tool")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q = robot.neutral
start = robot.pose(q, "tool").translation
for corner in ([0.0, 0.1, 0.0], [0.0, 0.1, -0.2], [0.0, -0.1, -0.2], [0.0, -0.1, 0.0]):
    controller["tool"].target = start + corner
    for _ in range(300):
        step = controller.step(q)
        q = robot.integrate(q, step.v, stack.dt)
    error = step.residuals["tool"].norm("m")
    print(f"{step.status}: {1e3 * error:.3f} mm from {start + corner}")
    if error > 1e-3:
        raise SystemExit(f"the tool did not arrive: {step.explain().reasons}")
