"""A recorded motion leads an arm by LeRobot's methods; the stack keeps what the motion does not: the joint limits."""

import numpy as np

import wbc
from wbc.formats import RecordedMotion
from wbc.learning import StackRobot, StackTeleoperator

robot = wbc.robots.load("so101")
stack = wbc.Stack(robot, dt=1 / 30).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
t = np.linspace(0.0, 4.0, 121)
motion = RecordedMotion(robot.joint_names, t, robot.neutral + 3.0 * np.sin(t)[:, None], None, {})
time = iter(t)
follower, leader = StackRobot(stack.compile(), "posture"), StackTeleoperator(motion, clock=lambda: next(time))
follower.connect()
leader.connect()
frames = [follower.send_action(leader.get_action()) for _ in t]
print(f"{len(frames)} frames; " + ", ".join(f"{name} to {max(f[name] for f in frames):.2f}" for name in frames[0]))
