"""Seeded problems whose rows hold on the whole path, which planners among boxes cannot state."""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from tests.plan.scenes import base_with_a_body, mechanism, standing_g1, tray
from wbc.errors import WbcError
from wbc.plan import MotionPlanner
from wbc.shapes import Box

#: What is planned: a cup that stays level (Panda, UR5), a tray in two hands (PR2), a base that drives any way in the
#: plane (TIAGo Pro), a parallel gripper and a delta robot with their closed loops, a G1 that stands on both feet and
#: reaches from over a table to under it, and a base on two wheels that must not slip (TIAGo)
KINDS = ("cup panda", "cup ur5", "tray pr2", "base tiago_pro", "loop gripper", "loop delta", "feet g1", "base tiago")
#: Rows hold within this on the smooth path [m, rad], and along its law on wheels [m/s]
HELD = 1e-5
#: Samples of a smooth path
SAMPLES = 200
#: Goals that are tried until one is free
TRIES = 30


def row(kind: str, seed: int, seconds: float) -> dict[str, Any]:
    """A problem and what became of it."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    maker, name = kind.split()
    planner, start, goal = MAKERS[maker](name, rng)
    begin = time.process_time()
    out: dict[str, Any] = {"kind": kind, "seed": seed, "solved": False, "off": None}
    try:
        path = planner.plan(start, goal, seed=seed, seconds=seconds)
        out["seconds"] = time.process_time() - begin
        smooth = path.smooth
        places = smooth.evaluate(np.linspace(smooth.knots[0], smooth.knots[-1], SAMPLES))
        rows = planner.rows()
        values = [np.asarray(rows.function(x, planner.values)[0]).ravel()[: rows.equalities] for x in places]
        out["off"] = float(np.abs(np.array(values)).max()) if rows.equalities else 0.0
        if planner.coordinates.rolling is not None:
            law = path.law()
            _, v = path.configurations(law, np.linspace(0.0, law.duration, SAMPLES))
            out["off"] = float(np.abs(v[:, 1]).max())
        out["solved"], out["length"] = out["off"] <= HELD, path.length
    except WbcError as error:
        out |= {"seconds": time.process_time() - begin, "error": str(error)}
    return out


def _cup(name: str, rng: np.random.Generator) -> tuple[MotionPlanner, Any, Any]:
    """From one side of a wall to the other."""
    hand = {"panda": "panda_hand_tcp", "ur5": "ee_link"}[name]
    robot = wbc.robots.load(name)
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector(hand, kind="position"), name="hand")
    stack.add(wbc.tasks.AxisAlign(hand, axis=(0, 0, -1)), name="cup")
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.SelfCollision(), name="self")
    height = rng.uniform(0.2, 0.4)
    wall = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.5 * height]))
    stack.add(wbc.tasks.Obstacle(Box((0.3, 0.05, height)), pose=wall, margin=0.003), name="wall")
    planner, free = stack.planner(keep=("cup",)), stack.planner()
    low, high = np.array([0.35, 0.2, 0.1]), np.array([0.6, 0.4, 0.35])
    for k in range(TRIES):
        level = {"hand": rng.uniform(low, high), "cup": np.array([0.0, 0.0, 1.0])}
        try:
            start = free.coordinates.configuration(free.branches(robot.neutral, level, seed=k)[0])
        except WbcError:
            continue
        middle = np.array([0.475, -0.3, 0.225])
        return planner, start, _free(planner, start, "hand", middle, 0.5 * (high - low), rng)
    raise RuntimeError("no free start")


def _tray(_: str, rng: np.random.Generator) -> tuple[MotionPlanner, Any, Any]:
    planner, hands = tray()
    robot = planner.stack.robot
    place = robot.pose(robot.neutral, hands[0]).translation
    return planner, robot.neutral, _free(planner, robot.neutral, "left", place, np.array([0.15, 0.15, 0.2]), rng)


def _base(name: str, rng: np.random.Generator) -> tuple[MotionPlanner, Any, Any]:
    robot = base_with_a_body(name)
    frame = robot.frames["base"]
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector(frame, kind="position"), name="base")
    for k in range(6):
        at = pin.SE3(pin.exp3(np.array([0.0, 0.0, rng.uniform(-3, 3)])), rng.uniform((0.8, -1.5, 0.5), (2.5, 1.5, 0.5)))
        stack.add(wbc.tasks.Obstacle(Box((0.1, 1.0, 1.0)), pose=at, margin=0.02), name=f"wall{k}")
    planner = stack.planner()
    place = robot.pose(robot.neutral, frame).translation + np.array([3.5, 0.0, 0.0])
    return planner, robot.neutral, _free(planner, robot.neutral, "base", place, np.array([0.5, 1.0, 0.0]), rng)


def _loop(name: str, rng: np.random.Generator) -> tuple[MotionPlanner, Any, Any]:
    stack, start, goal = mechanism(name, rng)
    return stack.planner(), start, goal


def _feet(_: str, rng: np.random.Generator) -> tuple[MotionPlanner, Any, Any]:
    stack, q, (over, under) = standing_g1(int(rng.integers(10**6)))
    planner = stack.planner()
    return planner, planner.coordinates.configuration(planner.branches(q, {"hand": over})[0]), {"hand": under}


def _free(
    planner: MotionPlanner, start: Any, task: str, place: Any, half: Any, rng: np.random.Generator
) -> dict[str, Any]:
    """A target in a box about a place that some free configuration meets."""
    for k in range(TRIES):
        goal = {task: place + half * rng.uniform(-1.0, 1.0, 3)}
        try:
            planner.branches(start, goal, seed=k)
        except WbcError:
            continue
        return goal
    raise RuntimeError(f"no free goal for {task}")


MAKERS = {"cup": _cup, "tray": _tray, "base": _base, "loop": _loop, "feet": _feet}


def table(rows: list[dict[str, Any]]) -> str:
    """Solved and median time by kind."""
    heads = ("kind", "problems", "solved", "median time [ms]", "rows off by at most")
    lines = [f"| {' | '.join(heads)} |", f"|{' --- |' * len(heads)}"]
    kinds = dict.fromkeys(r["kind"] for r in rows)
    for name, some in [*((k, [r for r in rows if r["kind"] == k]) for k in kinds), ("all", rows)]:
        off = max((r["off"] for r in some if r["off"] is not None), default=float("nan"))
        solved, took = sum(r["solved"] for r in some), 1e3 * statistics.median(r["seconds"] for r in some)
        lines.append(f"| {name} | {len(some)} | {solved} ({solved / len(some):.0%}) | {took:.1f} | {off:.1e} |")
    return "\n".join(lines)


def page(data: Any) -> str:
    """Table of a file that ``python -m bench.plan --constrained --write`` wrote."""
    return table(data["rows"])
