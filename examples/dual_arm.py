"""PR2 carries a tray with both hands round a loop: the grasp is one task, the tray's way is shared by both hands."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.track import Scene

# Both arms only: torso and head stay where they are
robot = wbc.robots.load("pr2", base="fixed", lock=["?_gripper_*", "laser_*", "torso_*", "head_*"], shapes="none")
frames = [robot.frames[f"{side}_hand"] for side in ("left", "right")]


def places(q: np.ndarray, *names: str) -> list[pin.SE3]:
    """Poses of frames in the world, by Pinocchio: what the controller says of itself is not asked."""
    return [robot.pose(q, name) for name in names]


# The tray is a frame on *each* hand, so that both arms share its way instead of one leading and one following
q = robot.neutral
hands = places(q, *frames)
tray = pin.SE3(np.eye(3), (hands[0].translation + hands[1].translation) / 2)
robot = robot.with_frame("tray_left", frames[0], hands[0].actInv(tray))
robot = robot.with_frame("tray_right", frames[1], hands[1].actInv(tray))

stack = wbc.Stack(robot, dt=0.02)
# The grasp weighs far more than the way: where limits leave no choice the tray is late, but it is not torn
stack.add(wbc.tasks.RelativePose("tray_left", "tray_right", at=(0, 0, 0), gain=10.0), name="grasp", weight=1e4)
for side in ("left", "right"):
    stack.add(wbc.tasks.EndEffector(f"tray_{side}", gain=10.0), name=side)
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-6)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()
controller.reset(q)

ticks = 400


def goal(k: int) -> pin.SE3:
    """A loop of 0.3 m by 0.24 m, at rest at both ends, on which the tray turns by 0.3 rad to either side."""
    phase = 2 * np.pi * (k / ticks - np.sin(2 * np.pi * k / ticks) / (2 * np.pi))
    move = np.array([0.0, 0.15 * np.sin(phase), 0.12 * (1 - np.cos(phase))])
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3 * np.sin(phase)])), tray.translation + move)


late, slipped, trail, postures = 0.0, 0.0, [], []
for k in range(ticks):
    here, there = goal(k), goal(k + 1)
    turn = pin.log3(there.rotation @ here.rotation.T)
    for side in ("left", "right"):
        controller[side].target = here
        # Without its speed the tray would follow by speed / gain behind
        controller[side].feedforward = np.concatenate([there.translation - here.translation, turn]) / stack.dt
    left, right = places(q, "tray_left", "tray_right")
    late = max(late, float(np.linalg.norm(left.translation - here.translation)))
    slipped = max(slipped, float(np.linalg.norm(left.translation - right.translation)))
    trail.append((left.translation + right.translation) / 2)
    postures.append((q, left))
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)
print(f"{step.status}: tray at most {1e3 * late:.2f} mm off its way;")
print(f"where the two hands have it: at most {1e3 * slipped:.3f} mm apart")

scene = Scene(robot, dark=frames, detail=0.003)
board = wbc.shapes.Box((0.3, float(np.linalg.norm(hands[0].translation - hands[1].translation)) - 0.06, 0.02))
shown, *others = (postures[int(part * ticks)] for part in (0.35, 0.667, 0.0))
scene.add_robot(shown[0])
scene.add_shape(board, shown[1], "tray")
for _, place in others:
    scene.add_shape(board, place, pale=True)
scene.add_path(np.array(trail), "path of its middle")
print(scene.save("runs/dual_arm.png", size=(800, 540), azimuth=0.7))
