"""What commands of a humanoid's upper body and their gradients cost a learner."""

from __future__ import annotations

import time

import numpy as np

import wbc
from bench.measured.recorded import real_time
from bench.sheet import Sheet

#: Robots of a learner, as policies of humanoids are trained with
ROBOTS = 4096
#: How often the learner's step is timed; the best counts
TURNS = 6


def parts() -> dict[str, Sheet | str]:
    """A batch with its gradients."""
    return {"learning": learning(ROBOTS)}


def learning(count: int) -> Sheet:
    """Commands and gradients of the upper body of a G1, without PyTorch around them."""
    robot = wbc.robots.load("g1", base="fixed", lock=("*hip*", "*knee*", "*ankle*"))
    stack = wbc.Stack(robot, dt=0.02, calm=False)
    hands = ("left_wrist_yaw_link", "right_wrist_yaw_link")
    for hand in hands:
        stack.add(wbc.tasks.EndEffector(hand), name=hand.split("_")[0])
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3).add(wbc.tasks.JointLimits())
    batch, rng = stack.compile(backend="native").batch(count, threads=2), np.random.default_rng(0)
    q = np.array([0.7 * robot.neutral + 0.3 * robot.random(rng) for _ in range(count)])
    poses = np.array([[robot.pose(row, hand).homogeneous for row in q] for hand in hands])
    poses[:, :, :3, 3] += 0.05 * rng.normal(size=(2, count, 3))
    weights, spent = rng.normal(size=(count, robot.nv)), list[tuple[float, float, float]]()
    with real_time():
        for _ in range(TURNS):
            clock, processor = time.perf_counter(), time.process_time()
            batch.set(left=poses[0], right=poses[1])
            step = batch.step(q)
            forward = time.process_time() - processor
            step.pull(weights)
            spent.append((time.perf_counter() - clock, time.process_time() - processor, forward))
    best = 1e3 * np.array(spent).min(axis=0)
    rows = [tuple(f"{value:.0f} ms" for value in best)]
    columns = ("commands and gradients, clock", "processor time of both threads", "of which commands")
    return Sheet("", columns, rows)
