"""Ticks a second of many robots, beside mink and pink; and a map of what an arm reaches."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

import wbc
from bench.ours import Ours
from bench.pool import Worker, cores
from bench.prepare import panda, talos
from bench.problems import Case, load
from bench.sheet import Sheet, us
from wbc.validation import Array

#: Where the peers are installed, see the Makefile
PEERS = Path(".venv-peers/bin/python")
#: Passes of a problem's path that a batch has at once, and how often it is timed
PASSES, TURNS = {"panda": 50, "talos": 10}, 7
#: Where the Panda's first two joints meet, and the shells of the map [m]
SHOULDER, RADII = np.array([0.0, 0.0, 0.333]), (0.0, 0.2, 0.4, 0.6, 0.8)
#: Poses of the map, and how many are sought at once
POSES, CHUNK = 1_000_000, 50_000
#: Searches from other configurations that a pose is given: with 100 of them 2 in 100 reachable poses more are found
RESTARTS = 8


def parts() -> dict[str, Sheet | str]:
    """Rates, then the map."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, make in (("panda", panda), ("talos", talos)):
            place = make(Path(folder) / name)
            case = load(place)
            alone = single(case)
            by_threads = [rate(case, PASSES[name], threads) for threads in (1, 2)]
            peers = [peer(contender, place, case) for contender in ("mink + daqp", "pink + daqp")]
            cells = [f"{x:,.0f}" if x else "" for x in (alone, *by_threads, *peers)]
            rows.append((case.problem.title, *cells))
    columns = (
        "ticks a second",
        "`step` in a loop",
        "batch, 1 thread",
        "batch, 2 threads",
        "mink + daqp",
        "pink + daqp",
    )
    return {"rates": Sheet("", columns, rows), "derivatives": derivatives(), "map": reach_map()}


def derivatives() -> Sheet:
    """Of the Panda's ticks, by the configuration and by the target of the hand, on one thread."""
    with tempfile.TemporaryDirectory() as folder:
        case = load(panda(Path(folder)))
        ours, q = states(case)
    batch = ours.controller.batch(len(q), threads=1)
    batch.set(**{case.problem.frames[0]: case.poses[:, 0]})
    step, rows = batch.step(q), []
    asked: list[tuple[str, tuple[str, ...]]] = [
        ("q", ("q",)),
        ("the target of the hand", (case.problem.frames[0], "target")),
    ]
    for text, names in asked:
        together = alone = np.inf
        for _ in range(TURNS):
            began = perf_counter()
            step.derivative(*names)
            middle = perf_counter()
            for k in range(0, len(q), 20):
                step[k].derivative(*names)
            together = min(together, (middle - began) / len(q))
            alone = min(alone, (perf_counter() - middle) / len(range(0, len(q), 20)))
        rows.append((f"by {text}", us(1e6 * together), us(1e6 * alone)))
    return Sheet("", ("derivative of a tick [us]", "of a batch", "of single steps"), rows)


def states(case: Case) -> tuple[Ours, Array]:
    """A contender, and the configurations of its path [ticks, nq]."""
    ours = Ours(case)
    found = []
    for k in range(case.ticks):
        ours.aim(k)
        found.append(ours.q.copy())
        ours.call()
        ours.settle()
    return ours, np.stack(found)


def single(case: Case) -> float:
    """Ticks a second of one controller along the path, targets set in every tick."""
    ours, q = states(case)
    least = np.inf
    for _ in range(TURNS):
        began = perf_counter()
        for k in range(case.ticks):
            ours.aim(k)
            _ = ours.controller.step(q[k]).v
        least = min(least, (perf_counter() - began) / case.ticks)
    return 1.0 / least


def rate(case: Case, passes: int, threads: int) -> float:
    """The same of a batch, each robot at another place of the path; targets set in every tick."""
    ours, q = states(case)
    count = passes * case.ticks
    batch = ours.controller.batch(count, threads=threads)
    many = np.tile(q, (passes, 1))
    poses = [np.tile(case.poses[:, k], (passes, 1, 1)) for k in range(len(case.problem.frames))]
    targets = dict(zip(case.problem.frames, poses, strict=True))
    if case.problem.com:
        targets["com"] = np.tile(case.com, (passes, 1))
    least = np.inf
    for _ in range(TURNS):
        began = perf_counter()
        batch.set(**targets)
        step = batch.step(many)
        least = min(least, perf_counter() - began)
    assert step.solved.mean() > 0.99, step
    return count / least


def peer(contender: str, folder: Path, case: Case) -> float:
    """Ticks a second of a peer along the path, targets set in every tick; 0 where it is not installed."""
    if not PEERS.exists():
        return 0.0
    with Worker(str(PEERS.absolute()), contender, folder, cores()[0]) as worker:
        worker.ask("time", ticks=case.ticks)
        return 1e9 / float(np.median(worker.ask("time", ticks=case.ticks)["cycle"]))


def reach_map(poses: int = POSES) -> Sheet:
    """Poses of a Panda's hand, drawn evenly in a ball about its shoulder and over all orientations."""
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    stack.add(wbc.tasks.JointLimits())
    kinematics = stack.inverse_kinematics()
    q0 = (robot.limits.position_lower + robot.limits.position_upper) / 2.0
    rng = np.random.default_rng(1)
    targets = drawn(rng, poses)
    kinematics.solve_batch(q0, {"hand": targets[:1000]})
    found, began, used = np.zeros(poses, bool), perf_counter(), process_time()
    for start in range(0, poses, CHUNK):
        found[start : start + CHUNK] = kinematics.solve_batch(
            q0, {"hand": targets[start : start + CHUNK]}, restarts=RESTARTS, nearest=False
        ).solved
    spent, used = perf_counter() - began, process_time() - used
    places = np.linalg.norm(targets[:, :3, 3] - SHOULDER, axis=1)
    shells = [
        (f"{low:.1f} to {low + 0.2:.1f} m from the shoulder", (places >= low) & (places < low + 0.2)) for low in RADII
    ]
    rows = [(text, f"{inside.sum():,}", f"{100.0 * found[inside].mean():.1f} %") for text, inside in shells]
    rows.append(
        (
            f"all, in {spent:.1f} s on {len(os.sched_getaffinity(0))} cores, {used:.1f} s of processor time",
            f"{poses:,}",
            f"{100.0 * found.mean():.1f} %",
        )
    )
    return Sheet("", ("poses of the hand", "sought", "reached"), rows)


def drawn(rng: np.random.Generator, count: int) -> Array:
    """Random poses [count, 4, 4] in a ball of 1 m, each orientation as likely as any other."""
    out = np.tile(np.eye(4), (count, 1, 1))
    w, x, y, z = (part for part in unit(rng.normal(size=(count, 4))).T)
    out[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=1)
    out[:, 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=1)
    out[:, 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    out[:, :3, 3] = SHOULDER + unit(rng.normal(size=(count, 3))) * np.cbrt(rng.random((count, 1)))
    return out


def unit(x: Array) -> Array:
    """Rows of length 1."""
    return np.asarray(x / np.linalg.norm(x, axis=1, keepdims=True))
