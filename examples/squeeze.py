"""Two hands squeeze a box and lift it by torques: no harder than friction takes to carry it."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.track import Scene

DT, SECONDS, MASS, FRICTION = 0.01, 2.0, 3.0, 0.6  # s, s, kg, coefficient
LIFT, GRAVITY = 0.12, np.array([0.0, 0.0, -9.81])  # m, m/s^2

# Both arms only, elbows bent
bent = {f"arm_{side}_4_joint": -1.4 for side in ("left", "right")}
lock = ["leg_*", "torso_*", "head_*", "gripper_*"]
robot = wbc.robots.load("talos", base="fixed", lock=lock, neutral=bent, shapes="none")
q = robot.neutral
hands = [robot.pose(q, robot.frames[f"{side}_hand"]).translation for side in ("left", "right")]
middle = pin.SE3(np.eye(3), np.mean(hands, axis=0))
for side, sign in (("left", 1.0), ("right", -1.0)):
    # A palm at the hand, whose z axis is the normal of the box's side
    hand = robot.pose(q, robot.frames[f"{side}_hand"])
    palm = pin.SE3(pin.exp3(np.array([-sign * np.pi / 2, 0.0, 0.0])), hand.translation)
    robot = robot.with_frame(f"{side} palm", robot.frames[f"{side}_hand"], hand.actInv(palm))
width = robot.pose(q, "left palm").translation[1] - robot.pose(q, "right palm").translation[1]

stack = wbc.Stack(robot, dt=DT)
stack.add(wbc.tasks.MovingFrame(middle), name="box")
for side in ("left", "right"):
    palm = wbc.tasks.SurfaceContact(f"{side} palm", half_lengths=(0.04, 0.04), friction=FRICTION)
    stack.add(palm, name=side, relative_to="box")
stack.add(wbc.tasks.WrenchSum(("left", "right")), name="carried")
stack.add(wbc.tasks.Posture(), weight=1e-2).add(wbc.tasks.JointLimits()).add(wbc.tasks.TorqueLimits())
controller = stack.compile(command="torque")


def lift(t: float) -> np.ndarray:
    """Height, speed and acceleration: a way of least jerk."""
    s = min(t / SECONDS, 1.0)
    way = [s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)]
    return LIFT * np.array(way) / [1.0, SECONDS, SECONDS**2]


v, pressed, needed, off, path = np.zeros(robot.nv), [], [], 0.0, []
controller["box"].set(pose=middle)
controller.reset(q)
for k in range(round(SECONDS / DT)):
    height, speed, change = lift(k * DT)
    box = pin.SE3(middle.rotation, middle.translation + [0.0, 0.0, height])
    up = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    controller["box"].set(pose=box, twist=speed * up, acceleration=change * up)
    # What the hands feel of the box: its weight, and what accelerates it
    force = MASS * (GRAVITY - change * up[:3])
    controller["carried"].set(target=np.r_[force, np.zeros(3)], point=box.translation)
    step = controller.step(q, v)
    off = max(off, np.linalg.norm(robot.pose(q, "left palm").translation - box.translation - [0.0, width / 2, 0.0]))
    pressed.append([step.forces[side][2] for side in ("left", "right")])
    needed.append(np.linalg.norm(force) / 2 / (FRICTION / np.sqrt(2)))
    path.append(q)
    q, v = pin.integrate(robot.model, q, 0.5 * (v + step.v) * DT), step.v

print(f"{step.status}: each hand presses with {np.min(pressed):.2f} to {np.max(pressed):.2f} N")
print(f"at most {np.max(np.array(pressed) - np.array(needed)[:, None]):.3f} N more than friction takes")
print(f"hand at most {1e3 * off:.3f} mm off the side of the box")
scene = Scene(robot, hidden=["leg_*"], floor=False)
scene.add_robot(path[-1])
scene.add_robot(path[0], pale=True)
scene.add_shape(wbc.shapes.Box((0.2, width, 0.15)), box, "box of 3 kg", (0.85, 0.6, 0.25))
print(scene.save("runs/squeeze.png", size=(600, 560)))
