"""Runs past obstacles and limits by spaces of solutions, and paths resolved as a whole."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bench.sheet import Sheet
from tests.explore.test_explorer import planar, plane_stack
from wbc.errors import InfeasibleError
from wbc.explore import Explorer
from wbc.published.ikor import Driver, Method, Settings, hermies
from wbc.published.ikor.cases import route

OBSTACLES = (
    "method", "done", "least clearance [mm]", "way of the joints [rad]", "beyond the limit [mrad]",
    "miss at the end [mm]", "longest step [rad]", "a step [ms]",
)  # fmt: skip


def parts() -> dict[str, Sheet | str]:
    """Both tables."""
    count, done = paths()
    shown = [(name, f"{number} of {count}") for name, number in done.items()]
    return {
        "obstacles": Sheet("", OBSTACLES, obstacles()),
        "paths": Sheet("", ("way of resolution", "paths done"), shown),
    }


def obstacles() -> list[tuple[str, ...]]:
    """Trajectory 1 past a sphere that its forearm goes into, and with a joint limit that it passes."""
    machine = hermies()
    path = route(machine, "1")
    free = Driver(machine).run(path).q
    points = machine.points(free[100])
    spheres = [(*(0.5 * (points[2] + points[3]) + [0, 0.05, 0]), 0.1)]
    upper = machine.upper.copy()
    upper[3] = 0.6 * free[:, 3].max()
    tight = replace(machine, upper=upper)
    ways = {
        "FSP, one shot, as published": Settings(),
        "FSP, two steps, as published": Settings(two_step=True),
        "FSP, ahead": Settings(ahead=True, generator="orthogonal", margin=0.005),
        "stack": Settings(resolver="stack", margin=0.005),
    }
    out = []
    for name, settings in ways.items():
        past = Driver(machine, replace(settings, method=Method.OBSTACLES), spheres).run(path)
        within = Driver(tight, replace(settings, method=Method.LIMITS)).run(path)
        out.append((
            name, "yes" if past.code == 0 and within.code == 0 else "no", f"{1e3 * past.clearance.min():.1f}",
            f"{np.linalg.norm(np.diff(past.q, axis=0), axis=1).sum():.3f}", f"{1e3 * (within.q - upper).max():.1f}",
            f"{1e3 * max(past.errors[-1], within.errors[-1]):.3f}", f"{np.abs(np.diff(past.q, axis=0)).max():.3f}",
            f"{1e3 * np.median(past.seconds):.1f}",
        ))  # fmt: skip
    return out


def paths(count: int = 100) -> tuple[int, dict[str, int]]:
    """Random straight paths of a planar arm of three joints with limits of 1.9 rad, whole and step by step."""
    stack = plane_stack(planar(1.9))
    explorer = Explorer(stack, np.full(3, 0.3))
    ways: dict[str, dict[str, Any]] = {
        "whole, same start and branch": {},
        "whole, any start": {"anywhere": True},
        "whole, any start, the branch may change": {"anywhere": True, "change": 1.0},
    }
    done = {"step by step": 0} | dict.fromkeys(ways, 0)
    for seed in range(count):
        rng = np.random.default_rng(seed)
        first, last = rng.uniform(-1.9, 1.9, (2, 3))
        ends = [np.array([np.cos(np.cumsum(q)).sum(), np.sin(np.cumsum(q)).sum()]) for q in (first, last)]
        targets = [ends[0] + k * (ends[1] - ends[0]) for k in np.linspace(0, 1, 12)]
        done["step by step"] += not explorer.step_by_step({"tip": targets}, first, step=0.6)[1]
        for name, way in ways.items():
            try:
                explorer.along({"tip": targets}, first, step=0.6, nodes=24, **way)
                done[name] += 1
            except InfeasibleError:
                pass
    return count, done
