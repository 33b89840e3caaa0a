"""TALOS in MuJoCo, commanded by torque: it stands, reaches with a hand, and is pushed (`pip install wbc[mujoco]`)."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.shapes import Box, PlacedShape
from wbc.simulation import Command, CommandKind, MujocoPlant, mujoco_model
from wbc.track.scene import Scene

DT, SECONDS, REACHED, PUSHED = 0.002, 5.0, 2.0, 3.0
HALF = (0.1, 0.06)  # of a sole, m
HAND, CHEST, SOLES = "gripper_right_fingertip_1_link", "torso_2_link", ("left_sole_link", "right_sole_link")
REACH = np.array([0.3, 0.05, 0.25])  # m
PUSH, LASTS = np.array([0.0, 120.0, 0.0]), 0.15  # N, s

robot = wbc.robots.load("talos")
stack = wbc.Stack(robot, dt=DT)
stack.add(wbc.tasks.CenterOfMass(gain=4.0), name="balance", weight=10.0)
stack.add(wbc.tasks.EndEffector(CHEST, kind="orientation", gain=5.0), name="chest")
stack.add(wbc.tasks.EndEffector(HAND, kind="position", gain=5.0), name="hand")
stack.add(wbc.tasks.Posture(gain=5.0), name="posture", weight=1e-3)
stack.add(wbc.tasks.JointLimits()).add(wbc.tasks.TorqueLimits())
for sole in SOLES:
    stack.add(wbc.tasks.SurfaceContact(sole, half_lengths=HALF, friction=0.6), name=sole)

# The same robot in MuJoCo, with boxes under its feet on a floor
q = robot.neutral
sole = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.01]))
feet = {name: [PlacedShape(Box((2 * HALF[0], 2 * HALF[1], 0.02)), sole)] for name in SOLES}
floor = float(robot.pose(q, SOLES[0]).translation[2])
model = mujoco_model(robot, time_step=DT / 2, contacts=feet, ground=floor, friction=0.8, drawn=False)
plant = MujocoPlant(model, robot)


def simulate(seconds: float) -> dict[str, np.ndarray]:
    """Samples of every tick: time, error of the hand, centre of mass off its place, slip of a foot, torques."""
    controller = stack.compile(command="torque")
    plant.reset(q, 0.0)
    controller.reset(q)
    balance, goal = controller["balance"].target.copy(), controller["hand"].target.copy()
    feet = [robot.pose(q, sole).translation for sole in SOLES]
    data, chest, out = robot.model.createData(), plant.data.body(CHEST).id, []
    for k in range(round(seconds / DT)):
        state, t = plant.read(), k * DT
        # A way of least jerk, with its velocity and acceleration
        s = np.clip(t / REACHED, 0.0, 1.0)
        way = np.array([s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)])
        place, rate, change = REACH * (way / [1.0, REACHED, REACHED**2])[:, None]
        controller["hand"].set(target=goal + place, feedforward=rate, acceleration=change)
        step = controller.step(state.q, state.v)
        plant.data.xfrc_applied[chest, :3] = PUSH if PUSHED <= t < PUSHED + LASTS else 0.0
        plant.apply(Command(CommandKind.TORQUE, step.torque))
        plant.advance(DT)
        pin.framesForwardKinematics(robot.model, data, state.q)
        pin.centerOfMass(robot.model, data, state.q)
        places = [data.oMf[robot.model.getFrameId(name)].translation for name in (HAND, *SOLES)]
        slip = max(float(np.linalg.norm(now - then)) for now, then in zip(places[1:], feet, strict=True))
        share = np.max(np.abs(step.torque[6:]) / robot.limits.effort[6:])
        hand = float(np.linalg.norm(places[0] - controller["hand"].target))
        off = float(np.linalg.norm(data.com[0] - balance))
        out.append((t, hand, off, slip, share, step.status == "solved", state.q))
    names = ("time", "hand", "balance", "slip", "share", "solved", "q")
    return {name: np.array(column) for name, column in zip(names, zip(*out, strict=True), strict=True)}


if __name__ == "__main__":
    run = simulate(SECONDS)
    t, steady = run["time"], (run["time"] > REACHED + 0.5) & (run["time"] < PUSHED)
    print(f"hand {1e3 * run['hand'][steady].max():.2f} mm from its target when it has reached")
    late = t >= PUSHED
    print(f"a push of {np.linalg.norm(PUSH):g} N for {LASTS:g} s moves the centre of mass by", end=" ")
    print(f"{1e3 * run['balance'][late].max():.1f} mm, and it is {1e3 * run['balance'][-1]:.2f} mm off at the end")
    print(f"feet moved {1e3 * run['slip'].max():.2f} mm; largest torque {100 * run['share'].max():.0f} % of its limit")
    scene = Scene(robot)
    scene.add_robot(run["q"][-1])
    scene.add_robot(run["q"][0], pale=True)
    print(scene.save("runs/mujoco_humanoid.png", size=(600, 700), azimuth=0.9))
