"""ANYmal C in MuJoCo, commanded by torque: its weight moves over three feet, and the fourth is lifted."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.shapes import PlacedShape, Sphere
from wbc.simulation import Command, CommandKind, MujocoPlant, mujoco_model
from wbc.track.scene import Scene

DT, SECONDS = 0.002, 6.0
FEET, LIFTED = ("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"), "LF_FOOT"
SHIFTED, UNLOADED, RAISED = 2.0, 2.5, 4.0  # s
RADIUS, HEIGHT = 0.03, 0.15  # of a foot, and of the lifted one, m

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

ball = {foot: [PlacedShape(Sphere(RADIUS), pin.SE3.Identity())] for foot in FEET}
floor = float(np.mean([robot.pose(q, foot).translation[2] for foot in FEET])) - RADIUS
model = mujoco_model(robot, time_step=DT / 2, contacts=ball, ground=floor, friction=0.8, drawn=False)
plant = MujocoPlant(model, robot)


def eased(t: float, begin: float, end: float) -> float:
    """From 0 to 1 between two times, without a jump of the acceleration."""
    s = min(max((t - begin) / (end - begin), 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def simulate(seconds: float) -> dict[str, np.ndarray]:
    """Samples of every tick: errors of foot and balance, slip of the others, force on the lifted foot, torques."""
    controller = stack.compile(command="torque")
    plant.reset(q, 0.0)
    controller.reset(q)
    balance, goal = controller["balance"].target.copy(), controller["foot"].target.copy()
    places = {foot: robot.pose(q, foot).translation for foot in FEET}
    others = [foot for foot in FEET if foot != LIFTED]
    # Over the middle of the three that stay
    over = np.append(np.mean([places[foot][:2] for foot in others], axis=0), balance[2])
    data, out = robot.model.createData(), []
    for k in range(round(seconds / DT)):
        state, t = plant.read(), k * DT
        controller["balance"].target = balance + eased(t, 0.0, SHIFTED) * (over - balance)
        controller["foot"].target = goal + np.array([0.0, 0.0, HEIGHT * eased(t, UNLOADED, RAISED)])
        if t == SHIFTED:
            # Its load goes to the others before it opens
            controller[f"{LIFTED} force"].ramp(1e4, UNLOADED - SHIFTED)
        controller[LIFTED].enabled = t < UNLOADED
        step = controller.step(state.q, state.v)
        plant.apply(Command(CommandKind.TORQUE, step.torque))
        plant.advance(DT)
        pin.framesForwardKinematics(robot.model, data, state.q)
        pin.centerOfMass(robot.model, data, state.q)
        at = {foot: data.oMf[robot.model.getFrameId(foot)].translation for foot in FEET}
        slip = max(float(np.linalg.norm((at[foot] - places[foot])[:2])) for foot in others)
        error = float(np.linalg.norm(at[LIFTED] - controller["foot"].target))
        off = float(np.linalg.norm(data.com[0] - controller["balance"].target))
        share = float(np.max(np.abs(step.torque[6:]) / robot.limits.effort[6:]))
        out.append((t, error, off, slip, at[LIFTED][2] - RADIUS - floor, share, step.status == "solved", state.q))
    names = ("time", "foot", "balance", "slip", "height", "share", "solved", "q")
    return {name: np.array(column) for name, column in zip(names, zip(*out, strict=True), strict=True)}


if __name__ == "__main__":
    run = simulate(SECONDS)
    late = run["time"] > RAISED + 0.5
    print(f"on three feet: the fourth {1e3 * run['height'][late].min():.1f} mm above the floor,", end=" ")
    print(f"{1e3 * run['foot'][late].max():.2f} mm from its target")
    print(
        f"centre of mass {1e3 * run['balance'][late].max():.2f} mm off; the other feet moved {1e3 * run['slip'].max():.2f} mm"
    )
    print(f"largest torque {100 * run['share'].max():.0f} % of its limit; {(~run['solved']).sum()} ticks relaxed")
    scene = Scene(robot)
    scene.add_robot(run["q"][-1])
    print(scene.save("runs/mujoco_quadruped.png", size=(800, 600), azimuth=0.9))
