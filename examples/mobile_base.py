"""TIAGo on its two driven wheels: the hand follows an eight far wider than the arm, so the wheels take it there."""

import numpy as np

import wbc

# The table locks the wheels, because the base alone is enough to plan with; here their joints are commanded, too
robot = wbc.robots.load("tiago_no_hand", lock=(), shapes="none")
radius, tip, ticks = 0.0985, robot.frames["tip"], 750
wheels = [wbc.tasks.Wheel(f"wheel_{side}_joint", radius) for side in ("left", "right")]

stack = wbc.Stack(robot, dt=0.04)
# Without slip: the base goes where its wheels turn, and nowhere sideways
stack.add(wbc.tasks.Rolling(wheels), name="wheels")
stack.add(wbc.tasks.EndEffector(tip, kind="position", gain=10.0), name="hand")
# The arm's own posture only: one of the base or of the wheels would pull the robot back to where it started
arm = [name for name in robot.joint_names if "wheel" not in name and name != "root_joint"]
stack.add(wbc.tasks.Posture(joints=arm), name="posture", weight=1e-5)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()


def goal(k: int) -> np.ndarray:
    """An eight 3 m wide and 1.2 m deep that rises and falls by 0.15 m, at rest at both ends."""
    phase = 2 * np.pi * (k / ticks - np.sin(2 * np.pi * k / ticks) / (2 * np.pi))
    return start + np.array([0.6 * np.sin(2 * phase), 1.5 * np.sin(phase), 0.15 * np.sin(3 * phase)])


q, start = robot.neutral, robot.pose(robot.neutral, tip).translation
turning, rolled, late, slip, path = [robot.dofs(wheel.joint).start for wheel in wheels], np.zeros(2), 0.0, 0.0, []
for k in range(ticks):
    path.append((q, robot.pose(q, tip).translation, robot.pose(q, robot.frames["base"]).translation))
    late = max(late, np.linalg.norm(path[-1][1] - goal(k)))
    controller["hand"].set(target=goal(k), feedforward=(goal(k + 1) - goal(k)) / stack.dt)
    step = controller.step(q)
    rolled += radius * np.abs(step.v[turning]) * stack.dt
    # What both wheels roll on average is what the base drives, forwards
    slip = max(slip, abs(radius * step.v[turning].mean() - step.v[0]))
    q = robot.integrate(q, step.v, stack.dt)

print(f"{step.status}: hand at most {1e3 * late:.2f} mm off an eight of 3 m by 1.2 m;")
print(f"wheels rolled {rolled[0]:.2f} m (left) and {rolled[1]:.2f} m (right), slip at most {1e3 * slip:.4f} mm/s")
if late > 5e-3 or slip > 1e-6:
    raise SystemExit("the hand left its path, or a wheel slipped")
