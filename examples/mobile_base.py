"""TIAGo Pro on its four mecanum wheels: a hand reaches out of range of the arm, so the wheels roll the base there."""

import numpy as np
import pinocchio as pin

import wbc

wheels = {"front_left": -1, "front_right": 1, "rear_left": 1, "rear_right": -1}
robot = wbc.robots.load("tiago_pro", lock=["gripper_*_joint"], shapes="none")
rolling = [wbc.tasks.Wheel(f"wheel_{place}_joint", 0.0762, side * np.pi / 4) for place, side in wheels.items()]

stack = wbc.Stack(robot, dt=0.01)
stack.add(wbc.tasks.Rolling(rolling), name="wheels")
stack.add(wbc.tasks.EndEffector(robot.frames["right_hand"]), name="hand")
rest = [j for j in robot.joint_names if "wheel" not in j and j != "root_joint"]
stack.add(wbc.tasks.Posture(joints=rest), name="posture", weight=1e-5)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q = robot.neutral
controller.reset(q)
start = controller["hand"].target
controller["hand"].target = pin.SE3(start.rotation, start.translation + np.array([0.3, -1.2, 0.1]))
turned = np.zeros(4)
spin = [robot.dofs(wheel.joint).start for wheel in rolling]
for _ in range(1000):
    step = controller.step(q)
    q = pin.integrate(robot.model, q, step.v * stack.dt)
    turned += step.v[spin] * stack.dt
x, y, yaw = q[0], q[1], np.arctan2(q[3], q[2])
print(f"{step.status}: hand {1e3 * step.residuals['hand'].norm('m'):.2f} mm from its target,")
print(f"base moved {x:+.3f} m and {y:+.3f} m and turned {yaw:+.3f} rad, wheels turned {np.round(turned, 2)} rad")
