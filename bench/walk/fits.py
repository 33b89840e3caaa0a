"""``python -m bench.walk.fits``: where the numbers come from that the planner guesses with.

Swings between grips along the published courses are computed as the search computes them. From them: the parts of the
estimate of a swing's duration (``swings.ESTIMATE``), the usual duration (``search.USUAL``) and half of it
(``swings.HALFWAY``), and how often each alternative curve is the first that is possible (``curve.ALTERNATIVES``). Over
a wide trench, for several places in which a hand may wait (``puma.WAITING_*``), and how it comes to them and leaves
them (``waiting.HALFWAY``, ``SLOWLY``): how many of the swings that wait are possible and clear of the structure.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from unittest.mock import patch

import numpy as np

import wbc
from bench.walk.machine import INCH
from wbc.interrupts import obey_kill
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking import Structure, cylinder, remove_rows
from wbc.walking.arms.puma import ArmKinematics, limb_of
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.planner.grips.table import Grips, find_grips
from wbc.walking.planner.stances.search import USUAL
from wbc.walking.planner.swings import waiting as swings_that_wait
from wbc.walking.planner.swings.curve import ALTERNATIVES
from wbc.walking.planner.swings.move import Swing
from wbc.walking.planner.swings.swings import ESTIMATE, HALFWAY, Swings

#: Courses: (T, A) and heading where they begin and end; swings of each, and speeds [in/s]
COURSES = (((13, 6), (13, 18)), ((8, 12), (18, 12)), ((9, 8), (17, 16)), ((13, 8), (13, 14, np.pi / 3)))
COUNT, SPEEDS = 60, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
#: Distances from the axis of joint 1 and heights below the neck of a hand that waits, in upper arm and forearm
RADII, BEYOND = (16.0 / 34.0, 20.0 / 34.0, 24.0 / 34.0), (6.0 / 34.0, 10.0 / 34.0, 14.0 / 34.0)

#: Parts of the guided joints' change while a hand waits, and how many times slower than it could it comes down
HALVES, SLOWER = (0.5, 0.65, 0.8), (1.0, 1.5, 2.0)


@dataclass(frozen=True)
class Swung:
    """A swing of a plan: its duration, latches included [s], the time that its slowest joint needs for its change [s],
    the distance of its holds [m], and which curve it takes.
    """

    duration: float
    turning: float
    distance: float
    which: int


def swings_of(walker: Walker, structure: Structure, path: BodyPath) -> Iterator[Swung]:
    """Swings drawn from all grips along a path that the search may ask for, by their least times; those that wait for
    their next hold are left out, and other arms.
    """
    grips = find_grips(walker, structure, path)
    swings, rates = Swings(walker, structure, path, grips), np.array(limb_of(walker).joint_rates)[:-1]
    rng = np.random.default_rng(0)
    source, target = rng.integers(0, len(grips), (2, 300 * COUNT))
    lift = rng.integers(0, len(path) - 60, len(source))
    fits = (grips.arm[source] == grips.arm[target]) & (grips.hold[source] != grips.hold[target])
    fits &= (grips.first[source] <= lift) & (lift <= grips.last[source])
    fits &= (grips.first[target] <= lift + 20) & (grips.last[target] >= lift + 60)
    rows = np.nonzero(fits)[0][:COUNT]
    asked = [
        Swing(int(grips.arm[source[k]]), int(source[k]), int(target[k]), int(lift[k]), len(path) - 1, (), 0)
        for k in rows
    ]
    swings.prepare(asked)
    for swing in asked:
        found = swings.choose(swing)
        if found is not None:
            ends = grips.posture_at(swing.source, swing.lift), grips.posture_at(swing.target, swing.lift + 42)
            places = structure.positions[grips.hold[[swing.source, swing.target]]]
            turning = float((np.abs(ends[1] - ends[0])[:-1] / rates).max())
            yield Swung(found.duration, turning, float(np.linalg.norm(places[1] - places[0])), found.curve)


def fitted(swings: list[Swung]) -> tuple[Array, Array]:
    """Parts of the estimate by least squares, and what it misses by: estimated less computed [s]."""
    rows = np.array([(1.0, one.turning, one.distance) for one in swings])
    durations = np.array([one.duration for one in swings])
    parts = np.linalg.lstsq(rows, durations, rcond=None)[0]
    return parts, rows @ parts - durations


def missed(swings: list[Swung], parts: tuple[float, ...]) -> Array:
    """By how much an estimate with these parts is off [s]."""
    return np.array([parts[0] + parts[1] * s.turning + parts[2] * s.distance - s.duration for s in swings])


def long_swings(walker: Walker, structure: Structure, path: BodyPath) -> tuple[Grips, list[Swing]]:
    """Grips along a path, and swings to holds that come into reach 2 s or more after the last one has left it."""
    grips = find_grips(walker, structure, path)
    rng = np.random.default_rng(0)
    pairs = [
        (source, target)
        for source, target in rng.integers(0, len(grips), (4000, 2)).tolist()
        if grips.arm[source] == grips.arm[target] and grips.first[target] - grips.last[source] > 40
    ][:200]
    swings = [
        Swing(int(grips.arm[a]), a, b, int(grips.last[a]), len(path) - 1, (), int(grips.first[b]) + 1) for a, b in pairs
    ]
    return grips, swings


def waiting(walker: Walker, structure: Structure, path: BodyPath) -> Iterator[str]:
    """One line a choice: of long swings over a trench, how many that wait so are possible and clear."""
    grips, asked = long_swings(walker, structure, path)

    def count(one: Walker) -> str:
        swings = Swings(one, structure, path, grips)
        return f"{sum(swings.clear(swing, len(ALTERNATIVES)) for swing in asked)} of {len(asked)}"

    for radius, beyond in product(RADII, BEYOND):
        limb = _Waits(walker.arm_data, (0.0, radius, beyond))
        where = f"{34 * radius:4.0f} in from the axis, {34 * beyond:4.0f} in beyond the neck"
        yield f"  {where}: {count(replace(walker, limb=limb))}"
    for halfway, slowly in product(HALVES, SLOWER):
        with patch.multiple(swings_that_wait, HALFWAY=halfway, SLOWLY=slowly):
            yield f"  {halfway:g} of the change, {slowly:g} times slower: {count(walker)}"


@dataclass(frozen=True)
class _Waits(ArmKinematics):
    """The arm with one other place in which hands wait: angle [rad], and distance and height in parts of its reach."""

    place: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def waiting(self) -> tuple[tuple[float, float, float], ...]:
        """The place."""
        angle, radius, beyond = self.place
        reach = self.data.upper_arm_length + self.data.forearm_length
        return ((angle, radius * reach, self.data.neck_length + beyond * reach),)


def main() -> None:
    """Plan, fit and print."""
    walker, structure = wbc.robots.walker(), cylinder()
    found = list[Swung]()
    for course, speed in product(COURSES, SPEEDS):
        found += swings_of(walker, structure, grid_path(course, speed * INCH))
    usual = [one for one in found if one.which < len(ALTERNATIVES)]
    parts, off = fitted(usual)
    now = missed(usual, ESTIMATE)
    print(f"{len(usual)} swings along {len(COURSES) * len(SPEEDS)} courses")
    for name, values, gaps in (("fitted here", parts, off), ("ESTIMATE", np.array(ESTIMATE), now)):
        low, high = np.percentile(gaps, (10, 90))
        print(f"  {name:12} {np.round(values, 3).tolist()}: eight of ten from {low:+.2f} to {high:+.2f} s")
    durations = np.array([one.duration for one in usual])
    middle = np.median(durations)
    print(f"duration: median {middle:.2f} s, mean {durations.mean():.2f} s; USUAL is {USUAL} s")
    print(f"half of it: {middle / 2 / 0.05:.0f} samples; HALFWAY is {HALFWAY}")
    for which, (more, part) in enumerate(ALTERNATIVES):
        count = sum(one.which == which for one in usual)
        print(f"  curve {which}: {more:g} higher, {part:g} of the arc: {count} swings")
    trench, path = remove_rows(structure, "12-17"), grid_path([(13, 6), (13, 20)], 1.5 * INCH, height=44 * INCH)
    print("hands that wait; one place alone, then those of the limb:", *waiting(walker, trench, path), sep="\n")


if __name__ == "__main__":
    obey_kill()
    main()
