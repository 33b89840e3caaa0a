"""What measuring distances costs on Talos."""

from __future__ import annotations

from itertools import combinations
from time import perf_counter

import numpy as np
import pinocchio as pin

import wbc.robots
from bench.sheet import Sheet, us
from wbc.proximity import Body, PairSensor
from wbc.shapes import Box, Capsule, Convex, Cylinder

COUNTS = (1, 5, 20, 50, 200)
#: Configurations of a period
PERIOD = 1000


def shape(kind: str) -> object:
    """One of about 6 cm."""
    points = np.random.default_rng(0).normal(size=(int(kind.split()[2]) if kind.startswith("hulls") else 4, 3))
    ball = 0.03 * points / np.linalg.norm(points, axis=1)[:, None]
    return {"capsules": Capsule(0.03, 0.06), "boxes": Box((0.05, 0.05, 0.1)), "cylinders": Cylinder(0.03, 0.1)}.get(
        kind, Convex(ball) if kind.startswith("hulls") else None
    )


def parts() -> dict[str, Sheet | str]:
    """Median of one ``sense(q)`` by kind of body and number of pairs."""
    rows = []
    for kind in ("capsules", "boxes", "cylinders", "hulls of 12 points", "hulls of 60 points"):
        rows.append((kind, *(us(sense_us(kind, count, count)) for count in COUNTS), us(sense_us(kind, 400, 20))))
    columns = ("pairs, all with rows", *map(str, COUNTS), "20 rows of 400 pairs")
    return {"sense": Sheet("", columns, rows)}


def sense_us(kind: str, pairs: int, rows: int) -> float:
    """A body on every joint, on a path of the joints; the same pairs for every kind [us]."""
    robot = wbc.robots.load("talos", shapes="none")
    frames = [
        frame.name for frame in robot.model.frames if frame.type == pin.FrameType.JOINT and "root" not in frame.name
    ]
    bodies = [Body(name, name, pin.SE3.Identity(), shape(kind)) for name in frames]
    every = list(combinations(bodies, 2))
    chosen = [every[k] for k in np.random.default_rng(1).permutation(len(every))[:pairs]]
    sizes = {"distance": rows, "drift": rows, "line": 6 * rows, "side": robot.nv * rows, "pose": 12, "velocity": 6}
    sensor = PairSensor(robot, chosen, rows, {name: np.zeros(size) for name, size in sizes.items()})
    start, spent = robot.neutral, np.empty(PERIOD)
    numbers = np.arange(robot.nv - 6)
    for k in range(PERIOD):
        q = start.copy()
        q[7:] += 0.15 * (np.sin(2 * np.pi * k / PERIOD + numbers) - np.sin(numbers))
        began = perf_counter()
        sensor.sense(q)
        spent[k] = perf_counter() - began
    return 1e6 * float(np.median(spent))
