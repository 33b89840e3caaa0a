"""Baxter carries a box with both hands: the grasp is one task, where the box goes is shared by both hands."""

import numpy as np
import pinocchio as pin

import wbc

robot = wbc.robots.load("baxter", shapes="none")
left, right = robot.frames["left_hand"], robot.frames["right_hand"]
q = robot.neutral.copy()
for side, inward in (("left", -1), ("right", 1)):
    for joint, angle in {"s0": inward * 0.6, "s1": -0.8, "e1": 1.7, "w1": 0.7}.items():
        q[robot.position_index[robot.dofs(f"{side}_{joint}")]] = angle
data = robot.model.createData()
pin.framesForwardKinematics(robot.model, data, q)
hands = [data.oMf[robot.model.getFrameId(name)].copy() for name in (left, right)]
box = pin.SE3(np.eye(3), (hands[0].translation + hands[1].translation) / 2)
robot = robot.with_frame("box_left", left, hands[0].actInv(box)).with_frame("box_right", right, hands[1].actInv(box))

stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.RelativePose("box_left", "box_right", at=(0, 0, 0)), name="grasp", weight=100)
for side in ("left", "right"):
    stack.add(wbc.tasks.EndEffector(f"box_{side}"), name=side)
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-5)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

controller.reset(q)
goal = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3])), box.translation + np.array([0.1, 0.0, 0.15]))
controller["left"].target = controller["right"].target = goal
slipped = 0.0
for _ in range(800):
    step = controller.step(q)
    q = pin.integrate(robot.model, q, step.v * stack.dt)
    slipped = max(slipped, step.residuals["grasp"].norm("m"))
off = max(step.residuals[side].norm("m") for side in ("left", "right"))
print(f"{step.status}: box {1e3 * off:.2f} mm from its goal, hands slipped {1e3 * slipped:.3f} mm on the way")
