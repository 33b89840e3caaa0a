"""ANYmal C in MuJoCo, commanded by torque: its weight moves over three feet, and the fourth is lifted."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.shapes import PlacedShape, Sphere
from wbc.simulation import Command, CommandKind, MujocoPlant, mujoco_model
from wbc.track import Scene

DT, FEET, LIFTED = 0.002, ("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"), "LF_FOOT"
SHIFTED, UNLOADED, RAISED, SECONDS = 1.5, 2.0, 3.0, 4.0
RADIUS, HEIGHT = 0.03, np.array([0.0, 0.0, 0.15])  # of a foot, and of the lifted one, m

robot = wbc.robots.load("anymal_c")
q = robot.neutral
# The axes of a contact are those of its frame, z upwards, and these feet stand askew
for foot in FEET:
    robot = robot.with_frame(f"{foot} contact", foot, pin.SE3(robot.pose(q, foot).rotation.T, np.zeros(3)))
stack = wbc.Stack(robot, dt=DT)
stack.add(wbc.tasks.CenterOfMass(gain=4.0), name="balance", weight=10.0)
stack.add(wbc.tasks.EndEffector("base", kind="orientation", gain=5.0), name="trunk")
stack.add(wbc.tasks.EndEffector(LIFTED, kind="position", gain=10.0), name="foot")
stack.add(wbc.tasks.Posture(gain=5.0), name="posture", weight=1e-3)
stack.add(wbc.tasks.JointLimits()).add(wbc.tasks.TorqueLimits())
for foot in FEET:
    stack.add(wbc.tasks.PointContact(f"{foot} contact", friction=0.5), name=foot)

places = np.array([robot.pose(q, foot).translation for foot in FEET])
floor = float(places[:, 2].mean()) - RADIUS
ball = {foot: [PlacedShape(Sphere(RADIUS), pin.SE3.Identity())] for foot in FEET}
model = mujoco_model(robot, time_step=DT / 2, contacts=ball, ground=floor, friction=0.8, drawn=False)


def eased(t: float, begin: float, end: float) -> float:
    """From 0 to 1 between two times, without a jump of the acceleration."""
    s = min(max((t - begin) / (end - begin), 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


controller, plant = stack.compile(command="torque"), MujocoPlant(model, robot)
plant.reset(q, 0.0)
controller.reset(q)
balance, goal, others = controller["balance"].target.copy(), controller["foot"].target.copy(), slice(1, 4)
over = np.append(places[others, :2].mean(axis=0), balance[2])  # the middle of the three that stay
rows, relaxed = [], 0
for k in range(round(SECONDS / DT)):
    t, state = k * DT, plant.read()
    controller["balance"].target = balance + eased(t, 0.0, SHIFTED) * (over - balance)
    controller["foot"].target = goal + HEIGHT * eased(t, UNLOADED, RAISED)
    if t == SHIFTED:
        controller[f"{LIFTED} force"].ramp(1e4, UNLOADED - SHIFTED)  # the others take its load
    controller[LIFTED].enabled = t < UNLOADED
    step = controller.step(state.q, state.v)
    relaxed += step.status != "solved"
    plant.apply(Command(CommandKind.TORQUE, step.torque))
    plant.advance(DT)
    if t > RAISED + 0.3:
        now = np.array([robot.pose(state.q, foot).translation for foot in FEET])
        center = pin.centerOfMass(robot.model, robot.model.createData(), state.q)
        rolled = np.linalg.norm((now - places)[others, :2], axis=1).max()
        share = np.max(np.abs(step.torque[6:]) / robot.limits.effort[6:])
        rows.append((now[0, 2] - RADIUS - floor, np.linalg.norm(now[0] - goal - HEIGHT), np.linalg.norm(center - over),
                     rolled, share))  # fmt: skip
lowest, (_, foot_off, center_off, rolled, share) = np.min(rows, axis=0)[0], np.max(rows, axis=0)
print(f"on three feet: the fourth {1e3 * lowest:.1f} mm above the floor, {1e3 * foot_off:.2f} mm from its target;")
print(f"centre of mass {1e3 * center_off:.2f} mm off, the other feet rolled by {1e3 * rolled:.2f} mm;")
print(f"largest torque then {100 * share:.0f} % of its limit; {relaxed} ticks relaxed")
scene = Scene(robot)
scene.add_robot(state.q)
print(scene.save("runs/mujoco_quadruped.png", size=(800, 600), azimuth=0.9))
