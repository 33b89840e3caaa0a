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
from wbc.published.ikor import Driver, Method, Settings, airarm, hermies, straight
from wbc.published.ikor.cases import route
from wbc.resolvers import FullSpace, PseudoInverse, RateProblem
from wbc.resolvers.fsp import best, blocked, joint_row, orthogonal, parametric, point_row

#: Calls of a batch; of every timing the least median of so many batches, as other work on the machine only adds
CALLS, BATCHES = 40, 5
#: Rounds, in each of which every way of a size has its calls in turn, so that all have the same machine
ROUNDS = 60

STEPS = {
    "full_space": "`FullSpace().resolve`, two obstacles and three limits",
    "orthogonal": "orthogonal space, then the closed form, the same constraints",
    "blocked": "blocked columns, then the closed form, the same constraints",
    "two_steps": "blocked columns in two steps, three limits",
    "pseudo_inverse": "`PseudoInverse().resolve`, without constraints",
}
#: FSP over the pseudo-inverse for runs without constraints, user time: the quotients of the report's three trajectories
PRINTED = {"3x10": "1.7 to 1.8", "3x7": "1.4 to 1.7", "6x7": "1.7 to 1.9", "6x10": "2.3 to 3.6"}
SIZES = (
    "task", "pseudo-inverse [us]", "printed: FSP / pseudo-inverse", "FSP by blocks", "FSP by a factorisation",
    "`FullSpace` / numpy's SVD",
)  # fmt: skip
#: Constraints act in so many steps -> seconds of the pseudo-inverse, of one shot, of two steps, as printed for AIRARM
AIRARM = {"none": (10.0, 19.7, 19.9), "80 %": (10.0, 19.7, 30.9), "all": (10.0, 19.7, 36.0)}
CONSTRAINED = (
    "steps with constraints",
    "one shot / free, printed",
    "measured",
    "two steps / one shot, printed",
    "measured",
)
OBSTACLES = (
    "method", "done", "least clearance [mm]", "way of the joints [rad]", "beyond the limit [mrad]",
    "miss at the end [mm]", "longest step [rad]", "a step [ms]",
)  # fmt: skip


def parts() -> dict[str, Sheet | str]:
    """All of it."""
    return shown(steps(), sizes(), constrained(), obstacles(), paths())


def shown(
    step: dict[str, float],
    size: list[tuple[str, ...]],
    share: list[tuple[str, ...]],
    past: list[dict[str, Any]],
    whole: dict[str, Any],
) -> dict[str, Sheet | str]:
    """Tables of the numbers."""
    obstacle = []
    for one in past:
        lengths = (f"{1e3 * one[key]:.{digits}f}" for key, digits in (("clearance", 1), ("beyond", 1), ("miss", 3)))
        times = f"{one['step']:.3f}", f"{one['milliseconds']:.1f}"
        first, *rest = lengths
        obstacle.append((one["method"], "yes" if one["done"] else "no", first, f"{one['way']:.3f}", *rest, *times))
    done = [(name, f"{done} of {whole['paths']}") for name, done in whole["done"].items()]
    return {
        "steps": Sheet("", ("step of 3 x 10", "us"), [(STEPS[k], f"{v:.0f}") for k, v in step.items()]),
        "sizes": Sheet("", SIZES, size),
        "constrained": Sheet("", CONSTRAINED, share),
        "obstacles": Sheet("", OBSTACLES, obstacle),
        "paths": Sheet("", ("way of resolution", "paths done"), done),
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

    def spaces(make: Callable[..., Any]) -> Any:
        rows = [point_row(f"sphere {k}", near[k], normal, values[k]) for k in range(2)]
        rows += [joint_row(f"joint {k}", k, 10, value) for k, value in zip((0, 2, 5), values[2:], strict=True)]
        return best(make(J, x, free=True), rows=rows)

    def two_steps() -> Any:
        best(blocked(J, x, free=True))
        rows = [joint_row(f"joint {k}", k, 10, value) for k, value in zip((0, 2, 5), values[2:], strict=True)]
        space = blocked(J, x, free=True)
        return space.at(parametric(space, rows, null=True))

    same = [spaces(make).v for make in (orthogonal, blocked)]
    assert max(np.abs(v - fused()).max() for v in same) < 1e-9
    return {
        "full_space": microseconds(fused),
        "orthogonal": microseconds(lambda: spaces(orthogonal)),
        "blocked": microseconds(lambda: spaces(blocked)),
        "two_steps": microseconds(two_steps),
        "pseudo_inverse": microseconds(lambda: plain.resolve(RateProblem(J, x))),
    }


def sizes() -> list[tuple[str, ...]]:
    """A step of HERMIES-III without constraints, from the Jacobian on: shares of processor time by size of the task."""
    out = []
    for size, printed in PRINTED.items():
        rows, joints = map(int, size.split("x"))
        machine = hermies("none" if joints == 7 else "holonomic")
        q = np.concatenate((np.radians([10, 150, 20, 30, -15, 60, 25]), [0.1, 0.2, 0.3]))[:joints]
        J, x = machine.jacobian(q)[:rows], np.array([0.001, -0.003, -0.004, 0.01, 0.02, -0.01])[:rows]
        inverse, whole = PseudoInverse(), FullSpace()
        spent = processor_time(
            {
                "inverse": lambda J=J, x=x, inverse=inverse: inverse.resolve(RateProblem(J, x)),
                "blocked": lambda J=J, x=x: best(blocked(J, x)),
                "orthogonal": lambda J=J, x=x: best(orthogonal(J, x)),
                "whole": lambda J=J, x=x, whole=whole: whole.resolve(RateProblem(J, x)),
                "svd": lambda J=J: np.linalg.svd(J, full_matrices=False),
            }
        )
        plain = spent["inverse"]
        shares = (spent["blocked"] / plain, spent["orthogonal"] / plain, spent["whole"] / spent["svd"])
        out.append((size, f"{plain:.0f}", printed, *(f"{share:.2f}" for share in shares)))
    return out


def processor_time(ways: dict[str, Callable[[], Any]]) -> dict[str, float]:
    """Median processor time of a call of each way [us], all in turn in one process."""
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, way in ways.items():
            way()
            began = time.process_time_ns()
            for _ in range(CALLS):
                way()
            spent[name].append(1e-3 * (time.process_time_ns() - began) / CALLS)
    return {name: float(np.median(times)) for name, times in spent.items()}


def constrained() -> list[tuple[str, ...]]:
    """Runs of AIRARM by blocked columns with a limit of a joint that acts in none, most or all of the steps."""
    machine, steps = airarm(), 200
    path = straight(machine, (0.0008, 0.0, -0.001), steps)
    free = Driver(machine).run(path).q[:, 2]
    out = []
    for share, (_, one, two) in AIRARM.items():
        upper = machine.upper.copy()
        # The slide goes out all the way: the limit is where it is after so many steps
        upper[2] = {"none": free.max() + 1.0, "80 %": free[int(0.2 * steps)], "all": free[0] - 1e-4}[share]
        tight = replace(machine, upper=upper)
        runs = {}
        for name, settings in (
            ("free", Settings()),
            ("one", Settings(Method.LIMITS)),
            ("two", Settings(Method.LIMITS, two_step=True)),
        ):
            spent = [Driver(tight, settings).run(path) for _ in range(3)]
            runs[name] = min(float(run.seconds.sum()) for run in spent)
            acted = sum(map(bool, spent[0].acted))
        numbers = one / AIRARM["none"][1], runs["one"] / runs["free"], two / one, runs["two"] / runs["one"]
        out.append((f"{share} ({acted} of {steps})", *(f"{number:.2f}" for number in numbers)))
    return out


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
        "stack": Settings(resolver="stack", margin=0.005),
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
                "way": float(np.linalg.norm(np.diff(past.q, axis=0), axis=1).sum()),
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
    return {"paths": count, "done": done}
