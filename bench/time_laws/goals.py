"""The goals beside the figures of a run."""

from __future__ import annotations

import numpy as np

from bench.goals import Goal
from bench.time_laws.states import BENT
from bench.time_laws.tables import KEPT, Parts, good_instance, grouped, known, longer, median

#: States of which none may raise
GOAL = 1_000_000


def goals(parts: Parts) -> list[Goal]:
    """All goals that the parts can speak of."""
    makers = {
        "random set": _random_set, "small moves": _small_moves, "suite": _suite, "torques": _torques,
        "states": _states, "straight": _straight, "walls": _walls, "ticks": _ticks, "along": _along,
    }  # fmt: skip
    return [goal for name, make in makers.items() if parts.get(name) for goal in make(parts)]


def _random_set(parts: Parts) -> list[Goal]:
    out = []
    for number, some in grouped(parts["random set"], "waypoints").items():
        excess = max(known(some, "ours", "ratio")) - 1.0
        out.append(Goal(f"{number} waypoints: exact worst ratio, above 1", excess, KEPT - 1.0, ""))
        over = 100.0 * max(longer(some, "ours"))
        out.append(Goal(f"{number} waypoints: worst duration above toppra at 6401 points", over, 1.0, "%"))
        ours, theirs = (median(known(some, name, "ms")) for name in ("ours", "default"))
        # The goal is set for 5 waypoints; that for 10 says where it stands
        out.append(Goal(f"{number} waypoints: time for a law, of toppra's as it comes", ours / theirs, 1.0, ""))
    return out


def _small_moves(parts: Parts) -> list[Goal]:
    bad = [r for r in parts["small moves"] if r["ours"]["ratio"] is None or r["ours"]["ratio"] > KEPT]
    return [Goal(f"failures of {len(parts['small moves'])} small moves", len(bad), 0, "")]


def _suite(parts: Parts) -> list[Goal]:
    bad = sum(not good_instance(r) for r in parts["suite"])
    return [Goal(f"failures of the {len(parts['suite'])} instances of toppra's suite", bad, 0, "")]


def _torques(parts: Parts) -> list[Goal]:
    bound = known(parts["torques"], "ours", "bound")
    lost = len(parts["torques"]) - len(bound)
    return [
        Goal("torques: largest bound of a ratio, above 1", max(bound) - 1.0, KEPT - 1.0, ""),
        Goal("torques: paths without a law", lost, 0, ""),
    ]


def _states(parts: Parts) -> list[Goal]:
    count = sum(r["states"] for r in parts["states"])
    return [
        Goal(f"exceptions in {count} states (the goal is for {GOAL})", sum(r["ours"] for r in parts["states"]), 0, ""),
        Goal("excess of limits in them, as a share", max(r["excess"] for r in parts["states"]), 1e-9, ""),
        Goal("error of states at ends and breaks in them", max(r["off"] for r in parts["states"]), 1e-8, ""),
    ]


def _straight(parts: Parts) -> list[Goal]:
    bad = sum(r["ours"] > BENT or not r["kept"] for r in parts["straight"])
    return [Goal(f"bent ones of {len(parts['straight'])} straight moves", bad, 0, "")]


def _walls(parts: Parts) -> list[Goal]:
    out = [r for r in parts["walls"] if r["ours"] is not None and r["ours"] > KEPT - 1.0]
    lost = [r for r in parts["walls"] if r["ours"] is None and r["able"]]
    return [
        Goal("moves that leave position limits", len(out), 0, ""),
        Goal("moves refused though every joint can stop in time", len(lost), 0, ""),
    ]


def _ticks(parts: Parts) -> list[Goal]:
    out = []
    for course, some in grouped(parts["ticks"], "course").items():
        ours, raw = (float(np.median(np.concatenate([r[name] for r in some]))) for name in ("ours", "raw"))
        out.append(Goal(f"online, {course}: median above Ruckig.update", ours - raw, 15.0, "us"))
    beyond = max(r["beyond"] for r in parts["ticks"])
    return [*out, Goal("online: farthest beyond a position limit", max(beyond, 0.0), 1e-8, "rad")]


def _along(parts: Parts) -> list[Goal]:
    excess = max(r["ratio"] for r in parts["along"]) - 1.0
    inexact = sum(not r["exact"] for r in parts["along"])
    return [
        Goal("jerk-limited along paths: exact worst ratio, above 1", max(excess, 0.0), KEPT - 1.0, ""),
        Goal("jerk-limited along paths: laws without an exact certificate", inexact, 0, ""),
    ]
