"""A process in the peers' environment, see :class:`bench.pool.Worker`: a problem a line in, a path a line out."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from bench.worker_process import begin, serve

#: (seed, seconds) -> (points of a path, None: none; processor time of the search alone [s])
Plan = Callable[[int, float], tuple[list[list[float]] | None, float]]
#: Step of collision checks along edges, the default of RoboPlan [rad]
STEP = 0.05


def ompl_of(problem: dict[str, Any]) -> Plan:
    """RRT-Connect of OMPL, with Pinocchio and Coal to say what is free."""
    import pinocchio as pin
    from ompl import base, geometric

    with (
        tempfile.NamedTemporaryFile("w", suffix=".urdf") as file,
        tempfile.NamedTemporaryFile("w", suffix=".srdf") as groups,
    ):
        file.write(problem["urdf"])
        file.flush()
        groups.write(problem["srdf"])
        groups.flush()
        model = pin.buildModelFromUrdf(file.name)
        bodies = pin.buildGeomFromUrdf(model, file.name, pin.GeometryType.COLLISION)
        bodies.addAllCollisionPairs()
        pin.removeCollisionPairs(model, bodies, groups.name)
    data, geometry = model.createData(), bodies.createData()
    order = [model.joints[model.getJointId(name)].idx_q for name in problem["joints"]]
    n, q = len(order), np.zeros(model.nq)

    def is_valid(state: Any) -> bool:
        for k, at in enumerate(order):
            q[at] = state[k]
        return not pin.computeCollisions(model, data, bodies, geometry, q, True)

    space = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    for k in range(n):
        bounds.setLow(k, problem["low"][k])
        bounds.setHigh(k, problem["high"][k])
    space.setBounds(bounds)

    def plan(seed: int, seconds: float) -> tuple[list[list[float]] | None, float]:
        begin = time.process_time()
        # Before a goal that is not free it sleeps until its time is over
        if not (is_valid(problem["start"]) and is_valid(problem["goal"])):
            return None, time.process_time() - begin
        information = base.SpaceInformation(space)
        information.setStateValidityChecker(is_valid)
        information.setStateValidityCheckingResolution(STEP / space.getMaximumExtent())
        information.setup()
        ends = []
        for name in ("start", "goal"):
            state = information.allocState()
            for k in range(n):
                state[k] = problem[name][k]
            ends.append(state)
        definition = base.ProblemDefinition(information)
        definition.setStartAndGoalStates(*ends)
        planner = geometric.RRTConnect(information)
        planner.setProblemDefinition(definition)
        planner.setup()
        if not planner.solve(seconds) or definition.hasApproximateSolution():
            return None, time.process_time() - begin
        path, searched = definition.getSolutionPath(), time.process_time() - begin
        geometric.PathSimplifier(information).simplifyMax(path)
        return [[state[k] for k in range(n)] for state in path.getStates()], searched

    return plan


def roboplan_of(problem: dict[str, Any]) -> Plan:
    """RRT-Connect and shortcuts of RoboPlan."""
    from roboplan import core, rrt

    scene = core.Scene("scene", core.loadUrdfSceneDescriptionFromXml(problem["urdf"]))
    scene.importSrdf(problem["srdf"])
    options = rrt.RRTOptions(group_name="arm", rrt_connect=True, max_nodes=100000, collision_check_step_size=STEP)
    names = scene.getJointGroupInfo("arm").joint_names
    order = [names.index(name) for name in problem["joints"]]

    def configuration(values: Any) -> Any:
        out = np.zeros(len(order))
        out[order] = values
        return core.JointConfiguration(list(names), out)

    def plan(seed: int, seconds: float) -> tuple[list[list[float]] | None, float]:
        options.max_planning_time = seconds
        planner = rrt.RRT(scene, options)
        planner.setRngSeed(seed)
        begin = time.process_time()
        try:
            path = planner.plan(configuration(problem["start"]), configuration(problem["goal"]))
        except RuntimeError:
            return None, time.process_time() - begin
        searched = time.process_time() - begin
        shorter = core.PathShortcutter(
            scene, core.PathShortcuttingOptions(group_name="arm", max_step_size=STEP, seed=seed)
        )
        path = shorter.shortcut(path)
        return [[float(x[k]) for k in order] for x in path.positions], searched

    return plan


def patiently(plan: Plan, seed: int, seconds: float) -> dict[str, Any]:
    """A path and the processor time that it took. Planners stop by the clock: where a busy core gave them less than
    0.9 of ``seconds`` of processor until then, they plan again with as much more.
    """
    clock = seconds
    while True:
        began, used = time.monotonic(), time.process_time()
        path, search = plan(seed, clock)
        elapsed, used = time.monotonic() - began, time.process_time() - used
        if path is not None or used > 0.9 * seconds or elapsed < 0.9 * clock:
            return {"path": path, "seconds": used, "search": search}
        clock *= 1.1 * seconds / used


MAKERS = {"ompl": ompl_of, "roboplan": roboplan_of}


def main() -> None:
    """See the module."""
    name, _, *core = sys.argv[1:]
    begin(core)
    # What is printed besides says nothing to anybody
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    if name == "ompl":
        from ompl import util

        # Once a process: later seeds count for nothing
        util.RNG.setSeed(1)

    def answer(problem: dict[str, Any]) -> dict[str, Any]:
        return patiently(MAKERS[name](problem), problem["seed"], problem["seconds"])

    serve(answer, {"ready": name})


if __name__ == "__main__":
    main()
