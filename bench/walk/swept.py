"""``python -m bench.walk.swept``: what proven clearances cost, for a swing of a planner and for a whole log."""

from __future__ import annotations

import time
from collections.abc import Callable
from math import inf

import numpy as np
import pinocchio as pin
from rich.console import Console

import wbc
from bench.sheet import Sheet
from wbc.clearance import Body, Motion, Pair, Scene, Sweep, Sweeper, Tree, bodies_of, self_pairs
from wbc.shapes import Box, Capsule, Cylinder, HalfSpace
from wbc.validation import Array

#: Obstacles around, period of the samples [s], least distance [m]
AROUND, PERIOD, CLEARANCE = 30, 0.01, 0.0254


def scene_of(arms: int, far: float) -> Scene:
    """A walker of so many arms over a plane, among obstacles that begin ``far`` from its middle [m]."""
    robot, rng = wbc.robots.walker(arms=arms).robot, np.random.default_rng(arms)
    tree = Tree.of_model(robot.model)
    links = bodies_of(robot)
    things = [Body("plane", HalfSpace(), "world", pin.SE3(np.eye(3), np.array([0.0, 0.0, -far])))]
    for k in range(AROUND):
        shape = (Capsule(0.03, 1.0), Box((0.3, 0.2, 0.2)), Cylinder(0.05, 0.8))[k % 3]
        way = rng.normal(size=3)
        place = way / np.linalg.norm(way) * (far + rng.uniform(0.5, 2.0))
        turn = pin.Quaternion(*(x := rng.normal(size=4)) / np.linalg.norm(x)).matrix()
        things.append(Body(f"thing {k}", shape, "world", pin.SE3(turn, place)))
    pairs = [Pair(a.name, b.name, CLEARANCE) for a in links for b in things]
    return Scene(tree, [*links, *things], [*pairs, *self_pairs(robot, CLEARANCE)])


def motion_of(scene: Scene, duration: float, arms: int) -> tuple[Array, Array, Array]:
    """Times, joints and poses: a body at 0.15 m/s, hands one after the other in the air."""
    times = np.arange(0.0, duration, PERIOD)
    count = len(scene.tree.coordinates)
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
    for name, arms, duration, far, aim, native, repeats in (
        ("swing, all far", 3, 1.2, 6.0, "any", True, 200),
        ("swing, all far", 6, 1.2, 6.0, "any", True, 200),
        ("swing among obstacles", 3, 1.2, 2.0, "any", True, 200),
        ("swing among obstacles, least", 3, 1.2, 2.0, "least", True, 50),
        ("log of 60 s", 3, 60.0, 2.0, "any", True, 5),
        ("log of 60 s, least", 3, 60.0, 2.0, "least", True, 5),
        ("log of 60 s", 6, 60.0, 2.0, "any", True, 5),
        ("log of 60 s, least", 6, 60.0, 2.0, "least", True, 3),
        ("swing, all far, numpy", 3, 1.2, 6.0, "any", False, 5),
        ("swing among obstacles, numpy", 3, 1.2, 2.0, "any", False, 1),
    ):
        scene = scene_of(arms, far)
        sweeper, (times, q, poses) = Sweeper(scene, native), motion_of(scene, duration, arms)
        # The arms' own links are near each other in places of this motion: those that are not are looked at
        motion = Motion.linear(scene.tree, times, q, poses)
        own = Sweeper(scene).sweep(motion, aim="every", far=inf, tolerance=1e-2)
        chosen = own.pairs[own.bound > 1e-3]

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


def main() -> None:
    """Measure and print."""
    columns = ("", "arms", "pairs", "clear", "least margin, mm", "pieces", "exact distances", "processor time, ms")
    console = Console()
    console.print(Sheet("Proven clearances, motion and sweep", columns, rows()).rich())


if __name__ == "__main__":
    main()
