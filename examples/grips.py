"""The three-armed robot floats on two grips and moves its body by torques: no grip bears more than its rating."""

import numpy as np
import pinocchio as pin

import wbc
from wbc.track import Scene

DT, SECONDS = 0.01, 4.0
RATING = {"force": 60.0, "torque": 15.0}  # what a grip may bear along and about each axis, N and N m
MOVE = np.array([0.12, 0.08, 0.10])  # of the body, m

robot = wbc.robots.with_masses(wbc.robots.walker()).robot


def carried(rated: bool) -> tuple[float, list[np.ndarray]]:
    """Largest share of a rating that a grip bears, and the configurations on the way."""
    stack = wbc.Stack(robot, dt=DT)
    stack.add(wbc.tasks.EndEffector("body", gain=2.0), name="body")
    stack.add(wbc.tasks.Posture(), weight=1e-5)
    stack.add(wbc.tasks.JointLimits()).add(wbc.tasks.TorqueLimits())
    for arm in (1, 2):
        stack.add(wbc.tasks.RigidGrasp(f"arm{arm}_hand", **(RATING if rated else {})), name=f"grip {arm}")
    controller = stack.compile(command="torque")
    q, v, share, path = robot.neutral, np.zeros(robot.nv), 0.0, []
    controller.reset(q)
    goal = robot.pose(q, "body")
    goal.translation += MOVE
    controller["body"].target = goal
    for _ in range(round(SECONDS / DT)):
        step = controller.step(q, v)
        for wrench in step.forces.values():
            share = max(share, *np.abs(wrench[:3]) / RATING["force"], *np.abs(wrench[3:]) / RATING["torque"])
        path.append(q)
        q, v = pin.integrate(robot.model, q, 0.5 * (v + step.v) * DT), step.v
    slip = max(np.linalg.norm(robot.pose(q, f"arm{k}_hand").translation - first[k]) for k in (1, 2))
    off = np.linalg.norm(robot.pose(q, "body").translation - goal.translation)
    print(f"  {step.status}: body {1e3 * off:.2f} mm from its goal, hands slipped at most {1e6 * slip:.1f} um")
    return share, path


first = {k: robot.pose(robot.neutral, f"arm{k}_hand").translation for k in (1, 2)}
for rated in (False, True):
    print(f"{'with' if rated else 'without'} ratings:")
    share, path = carried(rated)
    print(f"  a grip bears at most {100 * share:.1f} % of its rating")
scene = Scene(robot, dark=[f"arm{k}_hand" for k in (1, 2, 3)], floor=False)
scene.add_robot(path[0], pale=True)
scene.add_robot(path[-1])
print(scene.save("runs/grips.png", size=(700, 560)))
