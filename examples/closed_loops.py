"""An ankle that two motors move by rods, as humanoids have, and a delta of three arms: foot and plate are commanded,
and the motors follow.
"""

from pathlib import Path

import numpy as np
import pinocchio as pin

import wbc
from wbc.track import Scene

DT, SECONDS = 0.002, 4.0  # s


driven = ("left_motor", "right_motor", *(f"motor{number}" for number in range(3)))
model = Path(__file__).with_name("linkages.xml")
robot = wbc.robots.load(model, shapes="exact", actuated=driven).with_limits(velocity=dict.fromkeys(driven, 2.0))
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
