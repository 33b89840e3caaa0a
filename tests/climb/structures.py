"""Random structures of scarce holds from seeds: what the generator of the walker's trials does not draw."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import cos, pi, radians, sin

import numpy as np

from wbc import validation
from wbc.climb.places import surface_frames
from wbc.climb.scene import FLIP, ClimbScene, Foothold, SceneBody, frame_along
from wbc.climb.scenes import ClimbCourse
from wbc.multibody import pin
from wbc.shapes import Box, Capsule, HalfSpace
from wbc.validation import Array

#: The body under holds on a plane
PLANE = {"surface": SceneBody(HalfSpace())}
#: Down, along which hands come to holds of level ground
DOWN = np.array([0.0, 0.0, -1.0])
#: First axis, to which holds are turned
AHEAD = np.array([1.0, 0.0, 0.0])


def drawn(family: str, seed: int) -> ClimbCourse:
    """The course of a seed.

    Raises:
        UnknownNameError: no such family.
    """
    make = FAMILIES[validation.one_of("family", family, tuple(FAMILIES))]
    return make(np.random.default_rng([77, list(FAMILIES).index(family), seed]), f"{family}-{seed}")


def _hold(name: str, at: Array, axis: Array = DOWN, on: str = "") -> Foothold:
    return Foothold(name, frame_along(name, at, axis, AHEAD) * FLIP, on)


def _course(name: str, holds: list[Foothold], bodies: dict[str, SceneBody], begin: Array, end: Array) -> ClimbCourse:
    """From the hold nearest to one point to that nearest to another, without weight."""
    scene = ClimbScene(holds, bodies, np.zeros(3), name)
    near = [int(np.linalg.norm(scene.positions - point, axis=1).argmin()) for point in (begin, end)]
    return ClimbCourse(scene, *surface_frames(scene, [scene.footholds[row].id for row in near]))


def _scattered(rng: np.random.Generator, low: Array, high: Array, apart: float, count: int) -> Iterator[Array]:
    """Points of a rectangle that are no nearer to each other than so much [m]."""
    known = np.zeros((0, 2))
    for point in rng.uniform(low, high, (count, 2)):
        if not len(known) or np.linalg.norm(known - point, axis=1).min() >= apart:
            known = np.vstack([known, point])
            yield point


def _rungs(rng: np.random.Generator, name: str) -> ClimbCourse:
    """A wide ladder of round rungs at random distances, some of them askew."""
    holds, rungs, x, k = list[Foothold](), dict[str, SceneBody](), 0.0, 0
    while x < 4.6:
        skew, radius = float(rng.uniform(-0.15, 0.15)), 0.03
        along = np.array([sin(skew), cos(skew), 0.0])
        middle = np.array([x, 0.0, -radius])
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
        rungs[f"rung {k}"] = SceneBody(Capsule(radius, 3.0), pin.SE3(turn, middle))
        for j, far in enumerate(np.arange(-1.4, 1.41, 0.28)):
            holds.append(_hold(f"{k},{j}", middle + far * along + [0.0, 0.0, radius], on=f"rung {k}"))
        x, k = x + float(rng.uniform(0.22, 0.5)), k + 1
    return _course(name, holds, rungs, np.array([1.2, 0.0, 0.0]), np.array([rng.uniform(2.6, 3.2), 0.0, 0.0]))


def _spiral(rng: np.random.Generator, name: str) -> ClimbCourse:
    """Holds along a spiral on a plane, turn beside turn."""
    pitch, step, angle = float(rng.uniform(0.3, 0.42)), float(rng.uniform(0.2, 0.28)), pi
    points = list[Array]()
    while angle < 2.0 * pi * 2.6 / pitch:
        radius = pitch * angle / (2.0 * pi)
        points.append(np.array([radius * cos(angle), radius * sin(angle), 0.0]))
        angle += step / radius
    holds = [_hold(str(k), point, on="surface") for k, point in enumerate(points)]
    about = rng.uniform(0.0, 2.0 * pi)
    end = 1.1 * np.array([cos(about), sin(about), 0.0])
    return _course(name, holds, PLANE, -end, end)


def _roof(rng: np.random.Generator, name: str) -> ClimbCourse:
    """Scattered holds on two slabs that meet in a ridge."""
    fall, holds, slabs = float(rng.uniform(radians(10), radians(25))), list[Foothold](), dict[str, SceneBody]()
    for side in (-1, 1):
        rotation, slab = pin.utils.rotate("y", side * fall), f"slab {'ab'[side > 0]}"
        for k, (x, y) in enumerate(_scattered(rng, np.array([0.12, -1.5]), np.array([2.4, 1.5]), 0.2, 220)):
            at = rotation @ np.array([side * x, y, 0.0])
            holds.append(_hold(f"{'ab'[side > 0]}{k}", at, rotation @ DOWN, slab))
        middle = rotation @ np.array([side * 1.25, 0.0, -0.05])
        slabs[slab] = SceneBody(Box((2.5, 3.4, 0.1)), pin.SE3(rotation, middle))
    ends = [pin.utils.rotate("y", side * fall) @ np.array([side * 0.9, 0.0, 0.0]) for side in (-1, 1)]
    return _course(name, holds, slabs, *ends)


def _leaning(rng: np.random.Generator, name: str) -> ClimbCourse:
    """Scattered holds that lean any way, but for those under the body's ends."""
    ends, most, holds = (np.array([1.2, 1.4, 0.0]), np.array([2.7, 1.4, 0.0])), radians(30), list[Foothold]()
    for k, (x, y) in enumerate(_scattered(rng, np.zeros(2), np.array([4.0, 2.8]), 0.24, 400)):
        axis = np.array([*(np.tan(most) * rng.uniform(-0.7, 0.7, 2)), -1.0])
        holds.append(_hold(str(k), np.array([x, y, rng.uniform(-0.1, 0.1)]), axis / np.linalg.norm(axis)))
    holds += [_hold(f"end {k}", end) for k, end in enumerate(ends)]
    return _course(name, holds, {}, *ends)


def _islands(rng: np.random.Generator, name: str) -> ClimbCourse:
    """Small groups of holds on a plane with nothing between them."""
    holds = list[Foothold]()
    for x in np.arange(0.0, 4.3, 0.85):
        for y in np.arange(0.0, 2.7, 0.85):
            corner = np.array([x, y]) + rng.uniform(-0.08, 0.08, 2)
            for point in _scattered(rng, corner, corner + 0.35, 0.16, 12):
                holds.append(_hold(str(len(holds)), np.append(point, 0.0), on="surface"))
    return _course(name, holds, PLANE, np.array([1.1, 1.3, 0.0]), np.array([rng.uniform(2.4, 3.1), 1.3, 0.0]))


#: Family -> (generator, name) -> its course
FAMILIES: dict[str, Callable[[np.random.Generator, str], ClimbCourse]] = {
    "rungs": _rungs,
    "spiral": _spiral,
    "roof": _roof,
    "leaning": _leaning,
    "islands": _islands,
}
