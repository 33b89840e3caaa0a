"""What proven clearances cost, for a swing of a planner and for a whole log."""

from __future__ import annotations

import time
from collections.abc import Callable
from math import inf

import numpy as np
import pinocchio as pin

import wbc
from bench.sheet import Sheet
from wbc.clearance import Motion, Pair, Sweep, Sweeper, SweptBody, SweptScene, Tree, bodies_of, self_pairs
from wbc.shapes import Box, Capsule, Cylinder, HalfSpace
from wbc.validation import Array

#: Obstacles around, period of the samples [s], least distance [m]
AROUND, PERIOD, CLEARANCE = 30, 0.01, 0.0254
#: Name, arms, duration [s], how far the obstacles begin [m], what pairs have to spare [m] (inf: what they have), aim,
#: repeats
CASES = (
    ("swing among obstacles", 3, 1.2, 2.0, inf, "any", 200),
    ("swing, every pair within 1 mm of what is required", 3, 1.2, 2.0, 1e-3, "any", 20),
    ("log of 60 s", 3, 60.0, 2.0, inf, "any", 5),
    ("log of 60 s", 6, 60.0, 2.0, inf, "any", 5),
    ("log of 60 s, every pair within 1 mm", 6, 60.0, 2.0, 1e-3, "any", 2),
)


def parts() -> dict[str, Sheet | str]:
    """One table, a row a case."""
    columns = ("", "arms", "pairs", "clear", "least margin, mm", "pieces", "exact distances", "processor time, ms")
    return {"costs": Sheet("", columns, rows())}


def scene_of(arms: int, far: float) -> SweptScene:
    """A walker of so many arms over a plane, among obstacles that begin ``far`` from its middle [m]."""
    robot, rng = wbc.robots.walker(arms=arms).robot, np.random.default_rng(arms)
    tree = Tree.of_model(robot.model)
    links = bodies_of(robot)
    things = [SweptBody("plane", HalfSpace(), "world", pin.SE3(np.eye(3), np.array([0.0, 0.0, -far])))]
    for k in range(AROUND):
        shape = (Capsule(0.03, 1.0), Box((0.3, 0.2, 0.2)), Cylinder(0.05, 0.8))[k % 3]
        direction = rng.normal(size=3)
        position = direction / np.linalg.norm(direction) * (far + rng.uniform(0.5, 2.0))
        turn = pin.Quaternion(*(x := rng.normal(size=4)) / np.linalg.norm(x)).matrix()
        things.append(SweptBody(f"thing {k}", shape, "world", pin.SE3(turn, position)))
    pairs = [Pair(a.name, b.name, CLEARANCE) for a in links for b in things]
    return SweptScene(tree, [*links, *things], [*pairs, *self_pairs(robot, CLEARANCE)])


def motion_of(arms: int, duration: float) -> tuple[Array, Array, Array]:
    """Times, joints and poses: a body at 0.15 m/s, hands one after the other in the air."""
    times, count = np.arange(0.0, duration, PERIOD), 6 * arms
    posture = wbc.robots.walker(arms=arms).robot.neutral[7:]
    q = np.tile(posture, (len(times), 1))
    for k in range(count):
        swings = (np.floor(times).astype(int) % arms) == k // 6
        q[:, k] += 0.3 * np.where(swings, 1.0 - np.cos(2 * np.pi * times), 0.0) + 0.05 * np.sin(0.3 * times + k)
    poses = np.zeros((len(times), 7))
    poses[:, 0], poses[:, 6] = 0.15 * np.abs((times + 5.0) % 20.0 - 10.0) - 0.75, 1.0
    return times, q, poses


def spent(call: Callable[[], Sweep], repeats: int) -> tuple[Sweep, float]:
    """What a call gives, and the median of its processor time [s]."""
    costs = []
    for _ in range(repeats):
        begin = time.process_time()
        out = call()
        costs.append(time.process_time() - begin)
    return out, float(np.median(costs))


def rows() -> list[tuple[str, ...]]:
    """One a case."""
    out = []
    for name, arms, duration, far, spare, aim, repeats in CASES:
        scene, (times, q, poses) = scene_of(arms, far), motion_of(arms, duration)
        motion = Motion.linear(scene.tree, times, q, poses)
        own = Sweeper(scene).sweep(motion, aim="every", far=inf, tolerance=1e-2 if spare == inf else 1e-5)
        if spare < inf:
            pairs = zip(scene.pairs, own.bound.tolist(), strict=True)
            near = [Pair(pair.first, pair.second, pair.required + least - spare) for pair, least in pairs]
            scene = SweptScene(scene.tree, scene.bodies, near)
        # Links of the arms are too near to each other during this motion: the other pairs are swept
        chosen, sweeper = own.pairs[own.bound > 1e-3], Sweeper(scene)

        def call(
            s: Sweeper = sweeper, t: Array = times, x: Array = q, p: Array = poses, c: Array = chosen, a: str = aim
        ) -> Sweep:
            return s.sweep(Motion.linear(s.scene.tree, t, x, p), c, aim=a, far=inf if a == "least" else 0.0)

        found, cost = spent(call, repeats)
        least = f"{1e3 * float(found.found.min()):.2f}" if np.isfinite(found.found.min()) else "-"
        exact, pieces = found.measured
        clear = "yes" if found.clear else "no"
        out.append((name, str(arms), str(len(chosen)), clear, least, str(pieces), str(exact), f"{1e3 * cost:.3f}"))
    return out
