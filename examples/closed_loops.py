"""An ankle that two motors move by rods, as humanoids have, and a delta of three arms: foot and plate are commanded,
and the motors follow.
"""

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


def arm(number: int) -> tuple[str, str]:
    """A crank of the delta with its rod, and the ball joint between rod and plate."""
    angle = 2.0 * np.pi * number / 3.0
    x, y = np.cos(angle), np.sin(angle)
    return (
        f"""<body name="crank{number}" pos="{0.6 + 0.1 * x} {0.1 * y} 0">
        <joint name="motor{number}" axis="{-y} {x} 0" range="-1.2 1.2"/>
        <geom type="capsule" fromto="0 0 0 {0.15 * x} {0.15 * y} 0" size="0.01" mass="0.2"/>
        <body name="thin{number}" pos="{0.15 * x} {0.15 * y} 0"><joint name="ball{number}" type="ball"/>
        <geom type="capsule" fromto="0 0 0 {-0.2 * x} {-0.2 * y} -0.35" size="0.006" mass="0.1"/></body></body>""",
        f"""<connect name="arm{number}" body1="thin{number}" body2="plate" anchor="{-0.2 * x} {-0.2 * y} -0.35"/>""",
    )


arms, joins = (" ".join(parts) for parts in zip(*map(arm, range(3)), strict=True))
MODEL = f"""<mujoco model="linkages"><compiler angle="radian"/><worldbody><body name="shank">
    <geom type="capsule" fromto="0 0 0 0 0 -0.27" size="0.02" mass="2"/>
    <body name="cross" pos="0 0 -0.3"><joint name="pitch" axis="0 1 0" range="-0.8 0.8"/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
      <body name="foot"><joint name="roll" axis="1 0 0" range="-0.4 0.4"/>
        <geom type="box" pos="0.04 0 -0.04" size="0.1 0.045 0.01" mass="0.8"/></body></body>
    {rod(0.04, "left")}{rod(-0.04, "right")}</body>
    <body name="plate" pos="0.6 0 -0.35"><geom type="cylinder" size="0.06 0.008" mass="0.3"/>
      <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
      <joint name="z" type="slide" axis="0 0 1"/></body>{arms}</worldbody>
    <equality><connect name="left" body1="left_rod" body2="foot" anchor="0 0 -0.25"/>
    <connect name="right" body1="right_rod" body2="foot" anchor="0 0 -0.25"/>{joins}</equality></mujoco>"""

driven = ("left_motor", "right_motor", *(f"motor{number}" for number in range(3)))
robot = wbc.robots.load(MODEL, shapes="exact", actuated=driven).with_limits(velocity=dict.fromkeys(driven, 2.0))
stack = wbc.Stack(robot, dt=DT)
stack.add(wbc.tasks.EndEffector("foot", kind="orientation", gain=50.0), name="foot")
stack.add(wbc.tasks.EndEffector("plate", kind="position", gain=50.0), name="plate")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4).add(wbc.tasks.JointLimits())
controller, q, rows = stack.compile(), robot.neutral, []
motors, centre = robot.position_index[list(robot.motors)], robot.pose(robot.neutral, "plate").translation
for t in DT * np.arange(round(SECONDS / DT)):
    controller["foot"].target = pin.rpy.rpyToMatrix(0.25 * np.sin(3.0 * t), 0.4 * np.sin(2.0 * t), 0.0)
    controller["plate"].target = centre + 0.05 * np.array([np.sin(3.0 * t), 1.0 - np.cos(3.0 * t), np.sin(2.0 * t)])
    step = controller.step(q)
    q = pin.integrate(robot.model, q, step.v * DT)
    off = [np.linalg.norm(step.residuals[name].values) for name in ("foot", "plate")]
    rows.append((*q[motors], *off, max(robot.loop_gaps(q).values())))
rows = np.array(rows)
moved, off = np.degrees(np.ptp(rows[:, :2], axis=0)), np.degrees(rows[500:, 5].max())
print(f"{step.status}: motors moved over {moved[0]:.0f} and {moved[1]:.0f} degrees, foot at most {off:.1f} degrees off")
print(f"plate at most {1e3 * rows[500:, 6].max():.1f} mm off; loops open by at most {rows[:, 7].max():.0e} m")

# What the motors give to hold it there against 50 N down, 0.1 m ahead of the ankle, and what the rods bear
loaded = wbc.Stack(robot, dt=DT).add(wbc.tasks.Posture()).add(wbc.tasks.ExternalWrench("foot"), name="load")
holding = loaded.compile(command="torque")
holding["load"].set(wrench=[0.0, 0.0, -50.0, 0.0, 5.0, 0.0])
held = holding.step(q, np.zeros(robot.nv))
bears = ", ".join(f"{name} {np.linalg.norm(force):.0f} N" for name, force in held.loop_forces.items())
print(f"held by {' and '.join(f'{x:.2f}' for x in held.torque[list(robot.motors)][:2])} N m; rods bear {bears}")

# Where cranks and rods of the delta come into line is a dead point, which is named from afar
lifted = robot.integrate(robot.neutral, robot.motor_jacobian(robot.neutral) @ [0.0, 0.0, -1.0, -1.0, -1.0])
print(robot.dead_points(lifted, within=2.0)[0])

scene = Scene(robot)
scene.add_robot(robot.neutral, pale=True)
scene.add_robot(q)
print(scene.save("closed_loops.png", size=(900, 640), azimuth=-0.9, elevation=0.2))
