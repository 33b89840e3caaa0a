"""A Panda moves twice: through waypoints in the least time, and with its hand along a line with rounded corners."""

import pathlib

import numpy as np
import pinocchio as pin

import wbc
from wbc.trajectory import follow, jerk_limited_along, plot, pose_polyline, time_optimal

robot = wbc.robots.load("panda")
names = [name.removeprefix("panda_") for name in robot.dof_names]
pathlib.Path("runs").mkdir(exist_ok=True)


def hand(q: np.ndarray) -> pin.SE3:
    """Pose of the hand, by Pinocchio."""
    return robot.pose(q, "panda_hand_tcp")


# 1. Five waypoints in the least time, within velocities, accelerations and torques of the arm
rng = np.random.default_rng(2)
waypoints = robot.neutral + np.concatenate([np.zeros((1, 7)), rng.uniform(-0.7, 0.7, (4, 7))])
fast = time_optimal(waypoints, robot.limits.velocity, 10.0, torque=0.3 * robot.limits.effort, robot=robot)
print(f"least time {fast.duration:.3f} s: {fast.certificate}")
plot(fast, "runs/time_laws_fast.png", names, "Five waypoints")

# 2. A rectangle for the hand, corners rounded by at most 1 cm; the stack decides what the pose leaves open
home = hand(robot.neutral)
corners = [(0.0, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.2, 0.2), (0.0, -0.2, 0.2), (0.0, -0.2, 0.0), (0.0, 0.0, 0.0)]
line = pose_polyline([pin.SE3(home.rotation, home.translation + np.array(move)) for move in corners], 0.01)
stack = wbc.Stack(robot, dt=0.01)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
stack.add(wbc.tasks.JointLimits())
followed = follow(stack, line, robot.neutral, "hand", tolerance=1e-6)
print(f"{followed.samples} configurations, the hand at most {1e6 * followed.error[0]:.2f} um off its line")

# Jerk-limited along it: neither acceleration nor torque jumps, and the certificate is exact
bounds = {"lower": robot.limits.position_lower, "upper": robot.limits.position_upper}
smooth = jerk_limited_along(followed.path, velocity=robot.limits.velocity, acceleration=10.0, jerk=200.0, **bounds)
print(f"jerk-limited {smooth.duration:.3f} s: {smooth.certificate}")

# Checked from outside: the hand stays on the line at every time
times = np.linspace(0.0, smooth.duration, 500)
off = []
for t, q in zip(times, smooth.at(times).position, strict=True):
    s = smooth.timing.evaluate(np.array([t]))
    off.append(np.linalg.norm(hand(q).translation - line.evaluate(s)[0, :3, 3]))
print(f"along the law: at most {1e6 * max(off):.2f} um off the line")
plot(smooth, "runs/time_laws.png", names, "Rectangle of the hand")
print("runs/time_laws.png")
