"""The contenders: each solves for one pose after the other and says how long each call took.

``python -m bench.ik.contenders NAME FOLDER [CORE]`` runs one of them in an interpreter of its own, see
:class:`bench.pool.Worker`; the peers have their own environment.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from bench.descriptions import mujoco_urdf
from bench.problems import Array
from bench.worker_process import begin, serve

#: pose [4, 4] -> q of Pinocchio, seconds
Solve = Callable[[Array], tuple[Array, float]]


def wbc_stack(given: dict) -> Any:
    """The compiled solver."""
    import wbc

    robot = wbc.robots.load(given["urdf"], shapes="none")
    stack = wbc.Stack(robot, dt=0.005)
    stack.add(wbc.tasks.EndEffector(given["tip"]), name="hand")
    stack.add(wbc.tasks.JointLimits())
    return stack.inverse_kinematics()


def wbc_solver(given: dict, budget: float, tolerance: float) -> Solve:
    """``InverseKinematics.solve``, the whole Python call."""
    import pinocchio as pin

    solver, start = wbc_stack(given), np.array(given["q0"])

    def solve(pose: Array) -> tuple[Array, float]:
        solver["hand"].target = pin.SE3(pose)
        begin = perf_counter()
        found = solver.solve(start, budget=budget, tolerance=tolerance, restarts=1000)
        return found.q, perf_counter() - begin

    return solve


def pink_loop(given: dict, budget: float, tolerance: float) -> Solve:
    """``pink.solve_ik`` and ``integrate_inplace`` until the error is small: position limits, gain 1, DAQP."""
    import pink
    import pinocchio as pin

    model = pin.buildModelFromUrdf(given["urdf"])
    limits = [pink.limits.ConfigurationLimit(model, config_limit_gain=1.0)]
    task = pink.FrameTask(given["tip"], position_cost=1.0 / given["length"], orientation_cost=1.0, lm_damping=1e-3)
    start, frame = np.array(given["q0"]), model.getFrameId(given["tip"])

    def solve(pose: Array) -> tuple[Array, float]:
        goal = pin.SE3(pose)
        task.set_target(goal)
        begin = perf_counter()
        configuration = pink.Configuration(model, model.createData(), start)
        while perf_counter() - begin < budget:
            here = configuration.data.oMf[frame]
            turn = pin.log3(goal.rotation.T @ here.rotation)
            if max(np.abs(here.translation - goal.translation).max(), np.abs(turn).max()) < 0.5 * tolerance:
                break
            velocity = pink.solve_ik(configuration, [task], 1.0, solver="daqp", limits=limits)
            configuration.integrate_inplace(velocity, 1.0)
        return np.array(configuration.q), perf_counter() - begin

    return solve


def mink_loop(given: dict, budget: float, tolerance: float) -> Solve:
    """``mink.solve_ik`` and ``integrate_inplace`` until the error is small: position limits, gain 1, DAQP."""
    import mink
    import mujoco

    model = mujoco.MjSpec.from_string(mujoco_urdf(Path(given["urdf"]).read_text())).compile()
    slots = [int(model.joint(name).qposadr[0]) for name in given["joints"]]
    start = np.array(model.qpos0)
    start[slots] = given["start"]
    limits = [mink.ConfigurationLimit(model, gain=1.0)]
    task = mink.FrameTask(
        given["tip"], "body", position_cost=1.0 / given["length"], orientation_cost=1.0, lm_damping=1e-3
    )
    configuration = mink.Configuration(model, q=start)

    def solve(pose: Array) -> tuple[Array, float]:
        task.set_target(mink.SE3.from_matrix(pose))
        begin = perf_counter()
        configuration.update(start)
        while perf_counter() - begin < budget:
            if np.abs(task.compute_error(configuration)).max() < 0.5 * tolerance:
                break
            velocity = mink.solve_ik(configuration, [task], 1.0, solver="daqp", limits=limits)
            configuration.integrate_inplace(velocity, 1.0)
        spent, angles = perf_counter() - begin, np.array(configuration.q)[slots]
        parts = [[np.cos(a), np.sin(a)] if free else [a] for a, free in zip(angles, given["unbounded"], strict=True)]
        return np.concatenate(parts), spent

    return solve


CONTENDERS = {"wbc": wbc_solver, "pink": pink_loop, "mink": mink_loop}


def wbc_batch(given: dict, poses: Array) -> dict:
    """``InverseKinematics.solve_batch`` for all poses at once, on all cores."""
    import pinocchio as pin

    solver, start = wbc_stack(given), np.array(given["q0"])
    targets = [pin.SE3(pose) for pose in poses]
    threads = len(os.sched_getaffinity(0))
    options = {"budget": given["budget"], "tolerance": given["tolerance"], "restarts": 1000, "workers": threads}
    solver.solve_batch(start, {"hand": targets[:20]}, **options)
    begin = perf_counter()
    found = solver.solve_batch(start, {"hand": targets}, **options)
    return {"seconds": perf_counter() - begin, "q": found.q.tolist(), "threads": threads}


def main() -> None:
    """Answer each line of standard input: {"do": "solve", "first": i, "end": k} or {"do": "batch"}."""
    name, folder, *core = sys.argv[1:]
    begin(core)
    given = json.loads((Path(folder) / "given.json").read_text())
    poses = np.load(Path(folder) / "poses.npy")
    solve = CONTENDERS[name](given, given["budget"], given["tolerance"])
    for pose in poses[:20]:
        solve(pose)

    def answer(asked: dict[str, Any]) -> dict[str, Any]:
        if asked["do"] == "batch":
            return wbc_batch(given, poses)
        answers = [solve(pose) for pose in poses[asked["first"] : asked["end"]]]
        return {"q": [q.tolist() for q, _ in answers], "seconds": [seconds for _, seconds in answers]}

    serve(answer, {"ready": name})


if __name__ == "__main__":
    main()
