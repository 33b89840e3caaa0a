"""Random structures of scarce holds from seeds: what the generator of the walker's trials does not draw."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import cos, pi, radians, sin

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.shapes import Box, Capsule
from wbc.validation import Array
from wbc.walking import Hold, Obstacle, PlaneSurface, Structure
from wbc.walking.holds.hold import FREE, frame_of

#: Tilt that the holds allow [rad]
TILT = 0.05
#: Down, along which hands come to holds of level ground
DOWN = np.array([0.0, 0.0, -1.0])
#: First axis, to which holds are turned
AHEAD = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class Trial:
    """A structure, and the holds over which a body begins and ends on it."""

    structure: Structure
    start: str
    goal: str


def drawn(family: str, seed: int) -> Trial:
    """The structure of a seed.

    Raises:
        UnknownNameError: no such family.
    """
    make = FAMILIES[validation.one_of("family", family, tuple(FAMILIES))]
    return make(np.random.default_rng([77, list(FAMILIES).index(family), seed]), f"{family}-{seed}")


def _hold(name: str, at: Array, axis: Array = DOWN) -> Hold:
    return Hold(name, frame_of(name, at, axis, AHEAD), FREE, TILT)


def _nearest(structure: Structure, point: Array) -> str:
    return structure.ids[int(np.linalg.norm(structure.positions - point, axis=1).argmin())]


def _between(structure: Structure, begin: Array, end: Array) -> Trial:
    """From the hold nearest to one point to that nearest to another."""
    return Trial(structure, _nearest(structure, begin), _nearest(structure, end))


def _scattered(rng: np.random.Generator, low: Array, high: Array, apart: float, count: int) -> Iterator[Array]:
    """Points of a rectangle that are no nearer to each other than so much [m]."""
    known = np.zeros((0, 2))
    for point in rng.uniform(low, high, (count, 2)):
        if not len(known) or np.linalg.norm(known - point, axis=1).min() >= apart:
            known = np.vstack([known, point])
            yield point


def _rungs(rng: np.random.Generator, name: str) -> Trial:
    """A wide ladder of round rungs at random distances, some of them askew."""
    holds, rungs, x, k = list[Hold](), list[Obstacle](), 0.0, 0
    while x < 4.6:
        skew, radius = float(rng.uniform(-0.15, 0.15)), 0.03
        along = np.array([sin(skew), cos(skew), 0.0])
        middle = np.array([x, 0.0, -radius])
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
        rungs.append(Obstacle(f"rung {k}", Capsule(radius, 3.0), pin.SE3(turn, middle)))
        for j, far in enumerate(np.arange(-1.4, 1.41, 0.28)):
            holds.append(_hold(f"{k},{j}", middle + far * along + [0.0, 0.0, radius]))
        x, k = x + float(rng.uniform(0.22, 0.5)), k + 1
    structure = Structure(name, tuple(holds), tuple(rungs))
    return _between(structure, np.array([1.2, 0.0, 0.0]), np.array([rng.uniform(2.6, 3.2), 0.0, 0.0]))


def _spiral(rng: np.random.Generator, name: str) -> Trial:
    """Holds along a spiral on a plane, turn beside turn."""
    pitch, step, angle = float(rng.uniform(0.3, 0.42)), float(rng.uniform(0.2, 0.28)), pi
    points = list[Array]()
    while angle < 2.0 * pi * 2.6 / pitch:
        radius = pitch * angle / (2.0 * pi)
        points.append(np.array([radius * cos(angle), radius * sin(angle), 0.0]))
        angle += step / radius
    holds = tuple(_hold(str(k), point) for k, point in enumerate(points))
    structure = Structure(name, holds, (), PlaneSurface(pin.SE3.Identity()))
    about = rng.uniform(0.0, 2.0 * pi)
    end = 1.1 * np.array([cos(about), sin(about), 0.0])
    return _between(structure, -end, end)


def _roof(rng: np.random.Generator, name: str) -> Trial:
    """Scattered holds on two slabs that meet in a ridge."""
    fall, holds, slabs = float(rng.uniform(radians(10), radians(25))), list[Hold](), list[Obstacle]()
    for side in (-1, 1):
        rotation = pin.utils.rotate("y", side * fall)
        for k, (x, y) in enumerate(_scattered(rng, np.array([0.12, -1.5]), np.array([2.4, 1.5]), 0.2, 220)):
            at = rotation @ np.array([side * x, y, 0.0])
            holds.append(_hold(f"{'ab'[side > 0]}{k}", at, rotation @ DOWN))
        middle = rotation @ np.array([side * 1.25, 0.0, -0.05])
        slabs.append(Obstacle(f"slab {'ab'[side > 0]}", Box((2.5, 3.4, 0.1)), pin.SE3(rotation, middle)))
    structure = Structure(name, tuple(holds), tuple(slabs))
    ends = [pin.utils.rotate("y", side * fall) @ np.array([side * 0.9, 0.0, 0.0]) for side in (-1, 1)]
    return _between(structure, *ends)


def _leaning(rng: np.random.Generator, name: str) -> Trial:
    """Scattered holds that lean any way, but for those under the body's ends."""
    ends, most, holds = (np.array([1.2, 1.4, 0.0]), np.array([2.7, 1.4, 0.0])), radians(30), list[Hold]()
    for k, (x, y) in enumerate(_scattered(rng, np.zeros(2), np.array([4.0, 2.8]), 0.24, 400)):
        axis = np.array([*(np.tan(most) * rng.uniform(-0.7, 0.7, 2)), -1.0])
        holds.append(_hold(str(k), np.array([x, y, rng.uniform(-0.1, 0.1)]), axis / np.linalg.norm(axis)))
    holds += [_hold(f"end {k}", end) for k, end in enumerate(ends)]
    return Trial(Structure(name, tuple(holds)), "end 0", "end 1")


def _islands(rng: np.random.Generator, name: str) -> Trial:
    """Small groups of holds on a plane with nothing between them."""
    holds = list[Hold]()
    for x in np.arange(0.0, 4.3, 0.85):
        for y in np.arange(0.0, 2.7, 0.85):
            corner = np.array([x, y]) + rng.uniform(-0.08, 0.08, 2)
            for point in _scattered(rng, corner, corner + 0.35, 0.16, 12):
                holds.append(_hold(str(len(holds)), np.append(point, 0.0)))
    structure = Structure(name, tuple(holds), (), PlaneSurface(pin.SE3.Identity()))
    return _between(structure, np.array([1.1, 1.3, 0.0]), np.array([rng.uniform(2.4, 3.1), 1.3, 0.0]))


#: Family -> (generator, name) -> its trial
FAMILIES: dict[str, Callable[[np.random.Generator, str], Trial]] = {
    "rungs": _rungs,
    "spiral": _spiral,
    "roof": _roof,
    "leaning": _leaning,
    "islands": _islands,
}
