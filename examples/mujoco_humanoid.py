"""TALOS in MuJoCo, commanded by torque: it stands, reaches with a hand, and is pushed (`pip install wbc[mujoco]`)."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.shapes import Box, PlacedShape
from wbc.simulation import Command, CommandKind, MujocoPlant, mujoco_model
from wbc.track import Scene

DT, REACHED, PUSHED, LASTS, SECONDS = 0.002, 1.5, 2.0, 0.15, 3.5  # s
HALF, REACH, PUSH = (0.1, 0.06), np.array([0.3, 0.05, 0.25]), np.array([0.0, 120.0, 0.0])  # of a sole, m; m; N
HAND, CHEST, SOLES = "gripper_right_fingertip_1_link", "torso_2_link", ("left_sole_link", "right_sole_link")

# Without limits of acceleration, JointLimits lets an arm run at its stop until it would have to brake within one tick.
# 40 rad/s^2 is tried out: what wbc.support.braking finds for all joints at once is less, and balances no push
robot = wbc.robots.load("talos").with_limits(acceleration=40.0)
stack = wbc.Stack(robot, dt=DT)
stack.add(wbc.tasks.CenterOfMass(gain=4.0), name="balance", weight=10.0)
stack.add(wbc.tasks.EndEffector(CHEST, kind="orientation", gain=5.0), name="chest")
stack.add(wbc.tasks.EndEffector(HAND, kind="position", gain=5.0), name="hand")
stack.add(wbc.tasks.Posture(gain=5.0), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits()).add(wbc.tasks.TorqueLimits())
for sole in SOLES:
    stack.add(wbc.tasks.SurfaceContact(sole, half_lengths=HALF, friction=0.6), name=sole)

# The same robot in MuJoCo, with boxes under its feet on a floor
q = robot.neutral
under = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.01]))
boxes = {name: [PlacedShape(Box((2 * HALF[0], 2 * HALF[1], 0.02)), under)] for name in SOLES}
floor = float(robot.pose(q, SOLES[0]).translation[2])
model = mujoco_model(robot, time_step=DT / 2, contacts=boxes, ground=floor, friction=0.8, drawn=False)
plant, controller = MujocoPlant(model, robot), stack.compile(command="torque")

plant.reset(q, 0.0)
controller.reset(q)
balance, goal = controller["balance"].target.copy(), controller["hand"].target.copy()
feet = np.array([robot.pose(q, sole).translation for sole in SOLES])
data, chest, rows = robot.model.createData(), plant.data.body(CHEST).id, []
for t in DT * np.arange(round(SECONDS / DT)):
    # A way of least jerk, with its velocity and acceleration
    state, s = plant.read(), min(t / REACHED, 1.0)
    way = np.array([s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)])
    place, rate, change = REACH * (way / [1.0, REACHED, REACHED**2])[:, None]
    controller["hand"].set(target=goal + place, feedforward=rate, acceleration=change)
    step = controller.step(state.q, state.v)
    plant.data.xfrc_applied[chest, :3] = PUSH if PUSHED <= t < PUSHED + LASTS else 0.0
    plant.apply(Command(CommandKind.TORQUE, step.torque))
    plant.advance(DT)
    pin.framesForwardKinematics(robot.model, data, state.q)
    center = pin.centerOfMass(robot.model, data, state.q)
    hand, *soles = (data.oMf[robot.model.getFrameId(name)].translation for name in (HAND, *SOLES))
    far = np.linalg.norm(hand - goal - place), np.linalg.norm(center - balance)
    slip = np.linalg.norm(np.array(soles) - feet, axis=1).max()
    rows.append((t, *far, slip, np.max(np.abs(step.torque[6:]) / robot.limits.effort[6:]), step.status != "solved"))

t, hand, center, slip, share, relaxed = np.array(rows).T
print(f"hand {1e3 * hand[(t > PUSHED - 0.1) & (t < PUSHED)].max():.2f} mm from its target when it has reached;")
print(f"{PUSH[1]:g} N for {LASTS:g} s move the centre of mass by {1e3 * center[t >= PUSHED].max():.1f} mm;")
print(f"{1e3 * center[-1]:.2f} mm are left at the end, feet moved {1e3 * slip.max():.2f} mm;")
print(f"largest torque {100 * share.max():.0f} % of its limit; {relaxed.sum():.0f} ticks relaxed")
scene = Scene(robot)
scene.add_robot(plant.read().q)
scene.add_robot(q, pale=True)
print(scene.save("runs/mujoco_humanoid.png", size=(600, 700), azimuth=0.9))
