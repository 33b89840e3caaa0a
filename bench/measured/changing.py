"""A loop at 1 kHz while its stack's library is compiled behind it and taken over, beside one that may not change."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile

import numpy as np

from bench.pool import user_environment
from bench.sheet import Sheet

#: Processes of each kind, in turns
PROCESSES = 3
#: Robots, base, and the frame whose pose is asked for
ROBOTS = {"panda": ("fixed", "panda_hand"), "talos": ("floating", "wrist_left_ft_link")}
#: Ticks of a loop at least, and after its change
LEAST, AFTER = 10_000, 1000
#: Where the system lets it, the loop is in real time at this priority
PRIORITY = 60

#: A step's own time and how late it began, of every tick [ms], and which tick changed
_LOOP = f"""
import gc, json, os, sys, time, wbc
robot = wbc.robots.load(sys.argv[1], base=sys.argv[2])
stack = wbc.Stack(robot, dt=0.001).add(wbc.tasks.EndEffector(sys.argv[3]))
controller = stack.add(wbc.tasks.Posture(), weight=1e-2).add(wbc.tasks.JointLimits()).compile()
controller.may_change = sys.argv[4] == "True"
q, behind = robot.neutral, controller._artifact.behind
for _ in range(20):
    q = controller.step(q).q_next
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param({PRIORITY}))
except (OSError, AttributeError):
    pass
gc.collect()
gc.freeze()
now, spent, late, last = time.perf_counter, [], [], {LEAST}
begin = now() + 0.01
while len(spent) < last:
    due = begin + 0.001 * len(spent)
    time.sleep(max(0.0, due - now()))
    began = now()
    q = controller.step(q).q_next
    spent.append(1e3 * (now() - began))
    late.append(1e3 * (began - due))
    if not behind.ended.is_set():
        last = max({LEAST}, len(spent) + {AFTER})
print(json.dumps([controller.tier, spent, late]))
"""


def parts() -> dict[str, Sheet | str]:
    """A table with two rows a robot."""
    kinds = [(name, may) for name in ROBOTS for may in (True, False)]
    spent: dict[tuple[str, bool], list[float]] = {kind: [] for kind in kinds}
    late: dict[tuple[str, bool], list[float]] = {kind: [] for kind in kinds}
    for _ in range(PROCESSES):
        for kind in kinds:
            tier, own, behind = _run(*kind)
            assert tier == ("native" if kind[1] else "vm"), tier
            spent[kind] += own
            late[kind] += behind
    rows = [
        (
            f"{name}, {'changes over to native code' if may else '`may_change = False`'}",
            str(len(spent[name, may])),
            *(f"{value:.3f}" for value in (*_tails(spent[name, may]), *_tails(late[name, may]))),
        )
        for name, may in kinds
    ]
    columns = ("1 kHz, all processes together", "ticks", "step: p99.99 [ms]", "max [ms]", "begins late by: p99.99 [ms]")
    return {"loops": Sheet("", (*columns, "max [ms]"), rows)}


def _tails(times: list[float]) -> tuple[float, float]:
    return float(np.percentile(times, 99.99)), max(times)


def _run(name: str, may: bool) -> tuple[str, list[float], list[float]]:
    with tempfile.TemporaryDirectory(prefix="wbc-changing-") as empty:
        told = subprocess.run(
            [sys.executable, "-c", _LOOP, name, *ROBOTS[name], str(may)],
            env={**user_environment(), "WBC_CACHE": empty}, capture_output=True, text=True, check=True, cwd=os.sep,
        ).stdout  # fmt: skip
    tier, spent, late = json.loads(told.splitlines()[-1])
    return tier, spent, late
