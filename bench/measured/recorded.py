"""What recording costs a loop of a humanoid."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

import wbc
from bench.sheet import Sheet, us
from wbc.formats import recorded

DT, WARM = 0.001, 5_000  # s, ticks
#: Ticks that are recorded, ten minutes of them
TICKS = 600_000
#: A tick is not to be longer [us]
LONG = 1000.0
#: Real-time priority of what is measured
PRIORITY = 50
#: Ways to run the loop, as the table calls them
WAYS = ("alone", "recorded", "and copied to MCAP")


def parts() -> dict[str, Sheet | str]:
    """Times and sizes."""
    return {"recording": recording(TICKS)}


@contextmanager
def real_time() -> Iterator[str]:
    """Priority over all other programs, as the loop of a robot has, where the machine gives it; says which."""
    before, given = os.sched_getscheduler(0), f"priority {PRIORITY} of SCHED_FIFO"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        given = "no real-time priority"
    try:
        yield given
    finally:
        os.sched_setscheduler(0, before, os.sched_param(0))


def humanoid() -> wbc.Controller:
    """Hands, feet, centre of mass, posture and limits of a robot of 30 joints."""
    robot = wbc.robots.load("g1")
    stack = wbc.Stack(robot.with_limits(velocity={"root_joint": [2.0] * 6}), dt=DT)
    for side in ("left", "right"):
        stack.add(wbc.tasks.EndEffector(f"{side}_ankle_roll_link"), name=f"{side}_foot")
        stack.add(wbc.tasks.EndEffector(f"{side}_wrist_yaw_link"), name=f"{side}_hand")
    stack.add(wbc.tasks.CenterOfMass(), name="com", weight=0.1).add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    return stack.add(wbc.tasks.JointLimits()).compile(backend="native")


def loop(controllers: Sequence[wbc.Controller], ticks: int) -> np.ndarray:
    """Time of each tick by the clock [controllers x ticks, us]; each has 1 kHz, and they take turns."""
    robot, spent, share = controllers[0].stack.robot, np.empty((len(controllers), ticks)), DT / len(controllers)
    states, target = [robot.neutral.copy() for _ in controllers], robot.pose(robot.neutral, "right_wrist_yaw_link")
    start = target.translation.copy()
    due = time.perf_counter()
    for k in range(ticks):
        target.translation = start + 0.1 * np.sin(k / np.array([300.0, 500.0, 800.0]))
        for j, controller in enumerate(controllers):
            controller["right_hand"].target = target
            before = time.perf_counter_ns()
            step = controller.step(states[j])
            spent[j, k] = time.perf_counter_ns() - before
            states[j] = robot.integrate(states[j], step.v, DT)
            due = max(due + share, time.perf_counter() - share)
            time.sleep(max(0.0, due - time.perf_counter()))
    return spent / 1e3


def recording(ticks: int) -> Sheet:
    """Time of ticks, and size of files."""
    controllers = [humanoid() for _ in WAYS]
    with tempfile.TemporaryDirectory() as name, ExitStack() as around:
        folder = Path(name)
        around.enter_context(controllers[1].record(folder / "alone.npz"))
        around.enter_context(recorded(controllers[2], folder / "ticks.npz", "mcap"))
        # The copy's process has begun without the loop's priority
        with real_time() as given:
            loop(controllers, min(WARM, ticks))
            spent = loop(controllers, ticks)
        around.close()
        native, copy = (folder / "ticks.npz").stat().st_size, (folder / "ticks.mcap").stat().st_size
    medians = np.median(spent, axis=1)
    rows = [
        ("a tick, median", *map(us, medians)),
        ("more than alone", "", *map(us, medians[1:] - medians[0])),
        *((f"{share} % of ticks are below", *map(us, np.percentile(spent, share, axis=1))) for share in (99, 99.99)),
        ("the longest", *map(us, spent.max(axis=1))),
        ("ticks longer than 1 ms", *map(str, (spent > LONG).sum(axis=1))),
        ("file", "", f"{native / 1e6:.0f} MB", f"{copy / 1e6:.0f} MB, {copy / native:.2f} of it"),
    ]
    return Sheet("", (f"{ticks} ticks at 1 kHz, {given} [us]", *WAYS), rows)
