"""An ankle that two motors move by rods, as humanoids have: the foot is commanded, and the motors follow."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.track import Scene

DT, SECONDS = 0.002, 4.0  # s


def rod(side: float, name: str) -> str:
    """A crank on the shank, and the rod that hangs from its end by a ball joint."""
    return f"""<body name="{name}_crank" pos="0 {side} -0.05"><joint name="{name}_motor" axis="0 1 0" range="-1.2 1.2"/>
        <geom type="capsule" fromto="0 0 0 -0.05 0 0" size="0.008" mass="0.1"/>
        <body name="{name}_rod" pos="-0.05 0 0"><joint name="{name}_ball" type="ball"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.006" mass="0.1"/></body></body>"""


MODEL = f"""<mujoco model="ankle"><compiler angle="radian"/><worldbody><body name="shank">
    <geom type="capsule" fromto="0 0 0 0 0 -0.27" size="0.02" mass="2"/>
    <body name="cross" pos="0 0 -0.3"><joint name="pitch" axis="0 1 0" range="-0.8 0.8"/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
      <body name="foot"><joint name="roll" axis="1 0 0" range="-0.4 0.4"/>
        <geom type="box" pos="0.04 0 -0.04" size="0.1 0.045 0.01" mass="0.8"/></body></body>
    {rod(0.04, "left")}{rod(-0.04, "right")}</body></worldbody>
    <equality><connect name="left" body1="left_rod" body2="foot" anchor="0 0 -0.25"/>
    <connect name="right" body1="right_rod" body2="foot" anchor="0 0 -0.25"/></equality></mujoco>"""

robot = wbc.robots.load(MODEL, shapes="exact", actuated=("left_motor", "right_motor")).with_limits(
    velocity={"left_motor": 2.0, "right_motor": 2.0}
)
stack = wbc.Stack(robot, dt=DT)
stack.add(wbc.tasks.EndEffector("foot", kind="orientation", gain=50.0), name="foot")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4).add(wbc.tasks.JointLimits())
controller, q, rows = stack.compile(), robot.neutral, []
motors = robot.position_index[list(robot.motors)]
for t in DT * np.arange(round(SECONDS / DT)):
    controller["foot"].target = pin.rpy.rpyToMatrix(0.25 * np.sin(3.0 * t), 0.4 * np.sin(2.0 * t), 0.0)
    step = controller.step(q)
    q = pin.integrate(robot.model, q, step.v * DT)
    ends = [[robot.pose(q, f"{name}:{end}").translation for end in "ab"] for name in ("left", "right")]
    rows.append((*q[motors], np.linalg.norm(step.residuals["foot"].values), np.abs(np.diff(ends, axis=1)).max()))
rows = np.array(rows)
moved, off = np.degrees(np.ptp(rows[:, :2], axis=0)), np.degrees(rows[500:, 2].max())
print(f"{step.status}: motors moved over {moved[0]:.0f} and {moved[1]:.0f} degrees, foot at most {off:.1f} degrees off")
print(f"loops open by at most {rows[:, 3].max():.0e} m")

# What the motors give to hold it there against 50 N down, 0.1 m ahead of the ankle, and what the rods bear
loaded = wbc.Stack(robot, dt=DT).add(wbc.tasks.Posture()).add(wbc.tasks.ExternalWrench("foot"), name="load")
holding = loaded.compile(command="torque")
holding["load"].set(wrench=[0.0, 0.0, -50.0, 0.0, 5.0, 0.0])
held = holding.step(q, np.zeros(robot.nv))
bears = ", ".join(f"{name} {np.linalg.norm(force):.0f} N" for name, force in held.loop_forces.items())
print(f"held by {' and '.join(f'{x:.2f}' for x in held.torque[list(robot.motors)])} N m; rods bear {bears}")

scene = Scene(robot)
scene.add_robot(robot.neutral, pale=True)
scene.add_robot(q)
print(scene.save("closed_loops.png", size=(560, 640), azimuth=-0.7, elevation=0.15))
