"""What spaces of solutions and their steps cost, runs past obstacles and limits, and paths resolved as a whole."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import wbc
from bench.sheet import Sheet
from wbc.errors import InfeasibleError
from wbc.explore import Explorer
from wbc.published.ikor import Driver, Method, Settings, hermies
from wbc.published.ikor.cases import route
from wbc.resolvers import FullSpace, PseudoInverse, RateProblem
from wbc.resolvers.fsp import best, blocked, joint_row, orthogonal, parametric, point_row

#: Calls of a batch; of every timing the least median of so many batches, as other work on the machine only adds
CALLS, BATCHES = 40, 5


STEPS = {
    "full_space": "`FullSpace().resolve`, two obstacles and three limits",
    "orthogonal": "orthogonal space, then the closed form, the same constraints",
    "orthogonal_free": "the same without constraints",
    "blocked": "blocked columns, then the closed form, the same constraints",
    "blocked_free": "the same without constraints",
    "two_steps": "blocked columns in two steps, three limits",
    "pseudo_inverse": "`PseudoInverse().resolve`, without constraints",
}
GENERATORS = ("joints", "vectors", "orthogonal [us], cond G", "exchange", "exhaustive")
OBSTACLES = (
    "method", "done", "least clearance [mm]", "beyond the limit [mrad]", "miss at the end [mm]", "longest step [rad]",
    "a step [ms]",
)  # fmt: skip


def parts() -> dict[str, Sheet | str]:
    """All of it."""
    return shown(steps(), generators(), obstacles(), paths())


def shown(
    step: dict[str, float], spaces: list[dict[str, float]], past: list[dict[str, Any]], whole: dict[str, Any]
) -> dict[str, Sheet | str]:
    """Tables of the numbers."""
    costs = [
        (f"{row['joints']}", f"{row['vectors']}", *(f"{row[n]:.0f}, {row[f'{n}_condition']:.0e}" for n in made))
        for made in [("orthogonal", "exchange", "exhaustive")]
        for row in spaces
        if row["joints"] in (4, 7, 10, 15, 20)
    ]
    obstacle = []
    for one in past:
        lengths = (f"{1e3 * one[key]:.{digits}f}" for key, digits in (("clearance", 1), ("beyond", 1), ("miss", 3)))
        times = f"{one['step']:.3f}", f"{one['milliseconds']:.1f}"
        obstacle.append((one["method"], "yes" if one["done"] else "no", *lengths, *times))
    share = [(name, f"{done} of {whole['paths']}") for name, done in whole["done"].items()]
    return {
        "steps": Sheet("", ("step of 3 x 10", "us"), [(STEPS[k], f"{v:.0f}") for k, v in step.items()]),
        "generators": Sheet("", GENERATORS, costs),
        "obstacles": Sheet("", OBSTACLES, obstacle),
        "paths": Sheet("", ("way of resolution", "paths done"), share),
        "path": f"One path as a whole: {whole['seconds']:.2f} s.",
    }


def microseconds(call: Callable[[], Any], calls: int = CALLS) -> float:
    """Median time of a call in the quietest batch [us], after a warm-up."""
    call()
    medians = []
    for _ in range(BATCHES):
        spent = []
        for _ in range(calls):
            began = time.perf_counter()
            call()
            spent.append(time.perf_counter() - began)
        medians.append(1e6 * float(np.median(spent)))
    return min(medians)


def generators(most: int = 20) -> list[dict[str, float]]:
    """Time and conditioning of the spaces of random tasks of 3 rows, over the number of joints."""
    rng, out = np.random.default_rng(0), []
    for joints in range(4, most + 1):
        J, x = rng.normal(size=(3, joints)), rng.normal(size=3)
        row: dict[str, float] = {"joints": joints, "vectors": joints - 2}
        for name, make, calls in (
            ("orthogonal", orthogonal, CALLS),
            ("exchange", blocked, CALLS),
            ("exhaustive", lambda J, x: blocked(J, x, search="exhaustive"), 2),
        ):
            row[name] = microseconds(lambda make=make, J=J, x=x: make(J, x), calls)
            space = make(J, x)
            assert space.span == joints - 2
            row[f"{name}_condition"] = space.condition()
        out.append(row)
    return out


def steps() -> dict[str, float]:
    """One step of 3 x 10, HERMIES-III with its platform, with two obstacles and three limits: from Jacobians on."""
    machine = hermies("holonomic")
    q = np.concatenate((np.radians([10, 150, 20, 30, -15, 60, 25]), [0.1, 0.2, 0.3]))
    J, x, normal = machine.jacobian(q)[:3], np.array([0.003, -0.002, 0.004]), np.array([0.0, 0.6, 0.8])
    points = machine.points(q)
    near = [machine.point_jacobian(q, link, 0.5 * (points[link] + points[link + 1])) for link in (2, 3)]
    A = np.zeros((5, 10))
    for k, joint in enumerate((0, 2, 5)):
        A[2 + k, joint] = 1.0
    values = np.array([0.002, 0.001, 0.001, -0.001, 0.002])
    resolver, plain = FullSpace(), PseudoInverse()

    def fused() -> Any:
        A[0], A[1] = normal @ near[0], normal @ near[1]
        return resolver.resolve(RateProblem(J, x, A, values))

    def spaces(make: Callable[..., Any], constrained: bool) -> Any:
        if not constrained:
            return best(make(J, x, free=True))
        rows = [point_row(f"sphere {k}", near[k], normal, values[k]) for k in range(2)]
        rows += [joint_row(f"joint {k}", k, 10, value) for k, value in zip((0, 2, 5), values[2:], strict=True)]
        return best(make(J, x, free=True), rows=rows)

    def two_steps() -> Any:
        spaces(blocked, False)
        rows = [joint_row(f"joint {k}", k, 10, value) for k, value in zip((0, 2, 5), values[2:], strict=True)]
        space = blocked(J, x, free=True)
        return space.at(parametric(space, rows, null=True))

    same = [spaces(make, True).v for make in (orthogonal, blocked)]
    assert max(np.abs(v - fused()).max() for v in same) < 1e-9
    return {
        "full_space": microseconds(fused),
        "orthogonal": microseconds(lambda: spaces(orthogonal, True)),
        "orthogonal_free": microseconds(lambda: spaces(orthogonal, False)),
        "blocked": microseconds(lambda: spaces(blocked, True)),
        "blocked_free": microseconds(lambda: spaces(blocked, False)),
        "two_steps": microseconds(two_steps),
        "pseudo_inverse": microseconds(lambda: plain.resolve(RateProblem(J, x))),
    }


def obstacles() -> list[dict[str, Any]]:
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
        "stack": Settings(resolver="stack", margin=0.002),
    }
    out = []
    for name, settings in ways.items():
        past = Driver(machine, replace(settings, method=Method.OBSTACLES), spheres).run(path)
        within = Driver(tight, replace(settings, method=Method.LIMITS)).run(path)
        out.append(
            {
                "method": name,
                "done": past.code == 0 and within.code == 0,
                "clearance": float(past.clearance.min()),
                "beyond": float((within.q - upper).max()),
                "miss": float(max(past.errors[-1], within.errors[-1])),
                "step": float(np.abs(np.diff(past.q, axis=0)).max()),
                "milliseconds": 1e3 * float(np.median(past.seconds)),
            }
        )
    return out


def paths(count: int = 100) -> dict[str, Any]:
    """Random straight paths of a planar arm of three joints with limits of 1.9 rad, whole and step by step."""
    robot = wbc.robots.from_dh([wbc.robots.DHRow(a=1.0, lower=-1.9, upper=1.9, velocity=1.0) for _ in range(3)])
    tip = wbc.tasks.Expression(
        lambda kin, p: kin.position("tip")[:2] - p["target"],
        units="m",
        inputs=(wbc.tasks.Input("target", size=2, unit="m", default=np.zeros(2)),),
    )
    stack = wbc.Stack(robot, dt=0.01).add(tip, name="tip")
    explorer = Explorer(stack, np.full(3, 0.3))
    done = {"step by step": 0, "whole, same start": 0, "whole, any start": 0}
    seconds = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        first, last = rng.uniform(-1.9, 1.9, (2, 3))
        ends = [np.array([np.cos(np.cumsum(q)).sum(), np.sin(np.cumsum(q)).sum()]) for q in (first, last)]
        targets = [ends[0] + k * (ends[1] - ends[0]) for k in np.linspace(0, 1, 12)]
        done["step by step"] += not explorer.step_by_step({"tip": targets}, first, step=0.6)[1]
        for name, anywhere in (("whole, same start", False), ("whole, any start", True)):
            began = time.perf_counter()
            try:
                explorer.along({"tip": targets}, first, step=0.6, nodes=30, anywhere=anywhere)
                done[name] += 1
            except InfeasibleError:
                pass
            seconds.append(time.perf_counter() - began)
    return {"paths": count, "done": done, "seconds": float(np.median(seconds))}
