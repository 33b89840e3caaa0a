"""TIAGo on its two driven wheels: the hand follows an eight far wider than the arm, so the wheels take it there."""

import numpy as np

import wbc
from wbc.track import Scene

# The table locks the wheels, because the base alone is enough to plan with; here their joints are commanded, too
robot = wbc.robots.load("tiago_no_hand", lock=(), shapes="none")
radius = 0.0985
wheels = [wbc.tasks.Wheel(f"wheel_{side}_joint", radius) for side in ("left", "right")]

stack = wbc.Stack(robot, dt=0.04)
# Without slip: the base goes where its wheels turn, and nowhere sideways
stack.add(wbc.tasks.Rolling(wheels), name="wheels")
stack.add(wbc.tasks.EndEffector(robot.frames["tip"], kind="position", gain=10.0), name="hand")
# The arm's own posture only: one of the base or of the wheels would pull the robot back to where it started
arm = [name for name in robot.joint_names if "wheel" not in name and name != "root_joint"]
stack.add(wbc.tasks.Posture(joints=arm), name="posture", weight=1e-5)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q = robot.neutral
controller.reset(q)
start, ticks = controller["hand"].target, 750


def goal(k: int) -> np.ndarray:
    """An eight 3 m wide and 1.2 m deep that rises and falls by 0.15 m, at rest at both ends."""
    phase = 2 * np.pi * (k / ticks - np.sin(2 * np.pi * k / ticks) / (2 * np.pi))
    return start + np.array([0.6 * np.sin(2 * phase), 1.5 * np.sin(phase), 0.15 * np.sin(3 * phase)])


tip, base = robot.frames["tip"], robot.frames["base"]
turning = [robot.dofs(wheel.joint).start for wheel in wheels]
rolled, late, slip = np.zeros(2), 0.0, 0.0
postures, hand, floor, seen = [], [], [], []
for k in range(ticks):
    postures.append(q)
    hand.append(robot.pose(q, tip).translation)
    floor.append(np.array([*robot.pose(q, base).translation[:2], 0.02]))
    seen.append(robot.pose(q, tip, base).translation)
    late = max(late, float(np.linalg.norm(hand[-1] - goal(k))))
    controller["hand"].target = goal(k)
    controller["hand"].feedforward = (goal(k + 1) - goal(k)) / stack.dt
    step = controller.step(q)
    rolled += radius * np.abs(step.v[turning]) * stack.dt
    # What both wheels roll on average is what the base drives, forwards
    slip = max(slip, abs(float(radius * step.v[turning].mean() - step.v[0])))
    q = robot.integrate(q, step.v, stack.dt)

x, y, z = np.ptp(seen, axis=0)
print(f"{step.status}: hand at most {1e3 * late:.2f} mm off an eight of 3 m by 1.2 m;")
print(f"seen from the base it stayed within {x:.2f} m by {y:.2f} m, and the arm raised it by {z:.2f} m")
print(f"wheels rolled {rolled[0]:.2f} m (left) and {rolled[1]:.2f} m (right), slip at most {1e3 * slip:.4f} mm/s")

scene = Scene(robot, dark=[robot.frames["tip"]], detail=0.005)
scene.add_robot(postures[518])
scene.add_robot(postures[248], pale=True)
scene.add_path(np.array(hand), "path of the hand", radius=0.012)
scene.add_path(np.array(floor), "path of the base", (0.9, 0.5, 0.1), radius=0.012)
print(scene.save("runs/mobile_base.png", size=(800, 540), azimuth=3.3, elevation=0.6))
