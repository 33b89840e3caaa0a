"""PR2 carries a box with both hands round a loop: the grasp is one task, the box's path is shared by both hands."""

import numpy as np
import pinocchio as pin

import wbc

# Both arms only: torso and head stay where they are
robot = wbc.robots.load("pr2", base="fixed", lock=["?_gripper_*", "laser_*", "torso_*", "head_*"], shapes="none")
hands = [robot.frames["left_hand"], robot.frames["right_hand"]]
q, ticks, late, slipped, path = robot.neutral, 400, 0.0, 0.0, []
box = pin.SE3(np.eye(3), np.mean([robot.pose(q, hand).translation for hand in hands], axis=0))
# The box is a frame on *each* hand, so that both arms share its path instead of one leading and one following
for side, hand in zip(("left", "right"), hands, strict=True):
    robot = robot.with_frame(f"box_{side}", hand, robot.pose(q, hand).actInv(box))

stack = wbc.Stack(robot, dt=0.02)
# The grasp weighs far more than the path: where limits leave no choice the box is late, but it is not torn
stack.add(wbc.tasks.RelativePose("box_left", "box_right", at=(0, 0, 0), gain=10.0), name="grasp", weight=1e4)
stack.add(wbc.tasks.EndEffector("box_left", gain=10.0), name="left")
stack.add(wbc.tasks.EndEffector("box_right", gain=10.0), name="right")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-6)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()


def goal(k: int) -> pin.SE3:
    """A loop of 0.3 m by 0.24 m, at rest at both ends, on which the box turns by 0.3 rad to either side."""
    phase = 2 * np.pi * (k / ticks - np.sin(2 * np.pi * k / ticks) / (2 * np.pi))
    move = np.array([0.0, 0.15 * np.sin(phase), 0.12 * (1 - np.cos(phase))])
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3 * np.sin(phase)])), box.translation + move)


for k in range(ticks):
    here, there = goal(k), goal(k + 1)
    turn = pin.log3(there.rotation @ here.rotation.T)
    for side in ("left", "right"):
        # Without its speed the box would follow by speed / gain behind
        twist = np.concatenate([there.translation - here.translation, turn]) / stack.dt
        controller[side].set(target=here, feedforward=twist)
    left, right = robot.pose(q, "box_left").translation, robot.pose(q, "box_right").translation
    late, slipped = max(late, np.linalg.norm(left - here.translation)), max(slipped, np.linalg.norm(left - right))
    path.append((q, left))
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)

print(f"{step.status}: box at most {1e3 * late:.2f} mm off its path;")
print(f"where the two hands have it: at most {1e3 * slipped:.3f} mm apart")
if late > 1e-3 or slipped > 5e-4:
    raise SystemExit("the box left its path, or the hands moved against each other")
