"""What recording costs a loop of a humanoid, and what commands and their gradients cost a learner."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

import wbc
from bench.sheet import Sheet
from wbc.formats import convert

DT, WARM = 0.001, 20_000  # s, ticks
#: Ticks that are recorded, a minute of them
TICKS = 60_000
#: Robots of a learner, as policies of humanoids are trained with
ROBOTS = 4096
#: How often the learner's step is timed; the best counts
TURNS = 6


def parts() -> dict[str, Sheet | str]:
    """Recording, and a batch with its gradients."""
    return {"recording": recording(TICKS), "learning": learning(ROBOTS)}


def humanoid() -> wbc.Controller:
    """Hands, feet, centre of mass, posture and limits of a robot of 30 joints."""
    robot = wbc.robots.load("g1")
    stack = wbc.Stack(robot.with_limits(velocity={"root_joint": [2.0] * 6}), dt=DT)
    for side in ("left", "right"):
        stack.add(wbc.tasks.EndEffector(f"{side}_ankle_roll_link"), name=f"{side}_foot")
        stack.add(wbc.tasks.EndEffector(f"{side}_wrist_yaw_link"), name=f"{side}_hand")
    stack.add(wbc.tasks.CenterOfMass(), name="com", weight=0.1).add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    return stack.add(wbc.tasks.JointLimits()).compile()


def loop(controller: wbc.Controller, ticks: int) -> np.ndarray:
    """Processor time of each tick [us]."""
    robot, spent = controller.stack.robot, np.empty(ticks)
    q, target = robot.neutral.copy(), robot.pose(robot.neutral, "right_wrist_yaw_link")
    start = target.translation.copy()
    controller.reset(q)
    for k in range(ticks):
        target.translation = start + 0.1 * np.sin(k / np.array([300.0, 500.0, 800.0]))
        controller["right_hand"].target = target
        before = time.thread_time_ns()
        step = controller.step(q)
        spent[k] = time.thread_time_ns() - before
        q = robot.integrate(q, step.v, DT)
    return spent / 1e3


def spread(spent: np.ndarray) -> list[float]:
    """Processor time that 99 % and 99.99 % of ticks stay below, and the largest."""
    return [*np.percentile(spent, [99.0, 99.99]).tolist(), float(spent.max())]


def recording(ticks: int) -> Sheet:
    """Processor time and size of files."""
    controller = humanoid()
    loop(controller, WARM)
    without = loop(controller, ticks)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ticks.npz"
        with controller.record(file):
            recorded = loop(controller, ticks)
        native = file.stat().st_size
        made, _ = convert(file, "mcap")
        size = made.stat().st_size
    more = np.median(recorded) - np.median(without)
    rows = [
        ("a tick without recording, median", f"{np.median(without):.1f} us"),
        ("recording costs it, median", f"{more:.1f} us"),
        *(
            (f"{name} of {ticks} ticks with recording, without it", f"{with_it:.0f}, {without_it:.0f} us")
            for name, with_it, without_it in zip(
                ("99 %", "99.99 %", "largest"), spread(recorded), spread(without), strict=True
            )
        ),
        ("native file", f"{native / 1e6:.0f} MB"),
        ("MCAP", f"{size / 1e6:.0f} MB, {size / native:.2f} of it"),
    ]
    return Sheet("", ("G1, 1 kHz, processor time", ""), rows)


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
