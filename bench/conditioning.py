"""Error and time of every back end by the conditioning of H: ``python -m bench.conditioning``.

A Panda with a hand's pose, a posture, joint limits, a speed limit and a ball, as a linear model (``calm=False``); the
posture's weight spreads the eigenvalues of H. Errors are those of the commands against the exact minimiser of
:mod:`bench.qp.reference`, whose optimality conditions are verified with 60 digits. Ticks with rows that give way are
left out.
"""

from __future__ import annotations

import argparse
from time import perf_counter

import numpy as np
import pinocchio as pin
from rich.console import Console

import wbc
from bench.qp.reference import reference
from bench.sheet import Sheet, us
from wbc.api import Controller
from wbc.errors import SolverError
from wbc.explain.past import past_of
from wbc.qp import make_solver
from wbc.shapes import Sphere
from wbc.tasks import EndEffector, FrameVelocityLimit, JointLimits, Obstacle, Posture

#: Back end and solver
CONTENDERS = (("native", "daqp"), ("vm", "daqp"), ("vm", "osqp"), ("vm", "qpoases"))
WEIGHTS = (1.0, 1e-2, 1e-4, 1e-6, 1e-8)
TIP, DT = "panda_hand_tcp", 0.005


def stack() -> wbc.Stack:
    """See the module."""
    out = wbc.Stack(wbc.robots.load("panda"), DT, damping=1e-10, calm=False)
    out.add(EndEffector(TIP), name="hand").add(Posture(), name="posture").add(JointLimits(), name="limits")
    out.add(FrameVelocityLimit(TIP, linear=0.5), name="speed").add(
        Obstacle(Sphere(0.1), links="panda_hand"), name="ball"
    )
    return out


def begin(controller: Controller, weight: float, rng: np.random.Generator) -> np.ndarray:
    """A random state with random targets; the configuration."""
    limits = controller.stack.robot.limits
    q: np.ndarray = rng.uniform(limits.position_lower, limits.position_upper)
    controller.reset(q, 0.2 * rng.normal(size=q.size))
    controller["hand"].target = pose_near(controller, q + 0.03 * rng.normal(size=q.size))
    controller["posture"].weight = weight
    controller["ball"].pose = pin.SE3(np.eye(3), rng.uniform(-0.6, 0.6, 3))
    return q


def pose_near(controller: Controller, q: np.ndarray) -> pin.SE3:
    """The hand's pose at q."""
    model = controller.stack.robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(TIP)].copy()


def measure(controller: Controller, weight: float, states: int) -> tuple[list[float], list[float], list[float]]:
    """(condition numbers of H, errors [rad/s], times of a tick [s])."""
    rng = np.random.default_rng(0)
    conditions, errors, times = [], [], []
    for _ in range(states):
        q = begin(controller, weight, rng)
        start = perf_counter()
        step = controller.step(q)
        times.append(perf_counter() - start)
        if step.status not in ("solved", "recovered") or step.relaxed:
            continue
        qp = past_of(step._data, step._context).qp
        try:
            best = reference(qp, make_solver("daqp", qp.n, qp.m).solve(qp, warm=False)).x
        except SolverError:
            continue
        conditions.append(float(np.linalg.cond(qp.H)))
        errors.append(float(np.abs(step.v - best).max()))
    return conditions, errors, times


def sheet(states: int, weights: tuple[float, ...] = WEIGHTS) -> Sheet:
    """The table."""
    rows = []
    for backend, solver in CONTENDERS:
        controller = stack().compile(solver=solver, backend=backend)
        for weight in weights:
            conditions, errors, times = measure(controller, weight, states)
            numbers = [f"{x:.1e}" for x in (np.median(conditions), np.median(errors), max(errors))]
            rows.append(
                (f"{backend}, {solver}", f"{weight:.0e}", *numbers, f"{len(errors)}", us(1e6 * np.median(times)))
            )
    columns = ("back end, solver", "posture", "condition of H", "median error", "largest error", "ticks", "median us")
    return Sheet("Errors [rad/s] and times by conditioning", columns, rows)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m bench.conditioning", description=__doc__)
    parser.add_argument("--states", type=int, default=150)
    Console(width=160).print(sheet(parser.parse_args().states).markdown(), markup=False)


if __name__ == "__main__":
    main()
