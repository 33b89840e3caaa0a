"""placo's dynamics solver on one problem; runs where placo is installed and prints a median tick in microseconds.

python -m bench.torque_peer problem.json
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from time import perf_counter

import numpy as np
import placo

#: Ticks of a turn, and turns of which the quickest counts
TICKS, TURNS = 600, 5


def main(file: str) -> None:
    """Tasks and contacts of the problem, hard contacts, torque and joint limits on."""
    problem = json.loads(Path(file).read_text())
    robot = placo.RobotWrapper(problem["urdf"])
    floating = problem["floating"]
    places = [np.array(q) if floating else np.concatenate([[0, 0, 0, 0, 0, 0, 1], q]) for q in problem["states"]]
    robot.state.q = places[0]
    robot.update_kinematics()
    solver = placo.DynamicsSolver(robot)
    solver.dt = problem["dt"]
    solver.mask_fbase(not floating)
    solver.enable_torque_limits(True)
    solver.enable_joint_limits(True)
    solver.enable_velocity_limits(True)
    for contact in problem["contacts"]:
        task = solver.add_frame_task(contact["frame"], robot.get_T_world_frame(contact["frame"]))
        if contact["kind"] == "surface":
            body = solver.add_planar_contact(task)
            body.length, body.width = 2 * contact["half_lengths"][0], 2 * contact["half_lengths"][1]
            body.mu = contact["friction"]
        else:
            body = solver.add_fixed_contact(task)
        body.weight_forces = body.weight_moments = 1e-6
    if problem["com"]:
        solver.add_com_task(robot.com_world()).configure("com", "soft", 1.0)
    for frame in problem["frames"]:
        target = robot.get_T_world_frame(frame)
        target[:3, 3] += 0.05
        solver.add_frame_task(frame, target).configure(frame, "soft", 1.0, 1.0)
    posture = solver.add_joints_task()
    posture.set_joints({name: robot.get_joint(name) for name in robot.joint_names()})
    posture.configure("posture", "soft", 1e-2)
    least, good = np.inf, 0
    for _ in range(TURNS):
        spent = np.empty(TICKS)
        for k in range(TICKS):
            at = places[k % len(places)]
            began = perf_counter()
            robot.state.q = at
            robot.update_kinematics()
            good += bool(solver.solve(False).success)
            spent[k] = perf_counter() - began
        least = min(least, float(np.median(spent)))
    print(json.dumps({"us": 1e6 * least, "solved": good / (TICKS * TURNS)}))


if __name__ == "__main__":
    main(sys.argv[1])
