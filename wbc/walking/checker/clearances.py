"""Checks of clearances: links against each other, and against the structure.

Each pair is measured at every tick, where a bound does not say that it is far enough apart. Between ticks a point moves
at most as far as the farther-moving end of its segment, so where the distance at the tick less this travel is above
both the limit and the least that was found, no sample in between can matter; all others are measured as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.checker import distances
from wbc.walking.checker.holds import HoldTable
from wbc.walking.checker.report import Tally
from wbc.walking.checker.rules import Rules
from wbc.walking.checker.samples import Samples
from wbc.walking.checker.urdf import CapsuleOfLink, Placements, Urdf
from wbc.walking.holds.structure import Structure

LINKS, STRUCTURE = "clearance of links", "clearance of the structure"

Measure = Callable[[Array, Array], Array]
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Moving:
    """A capsule's core at all samples, and how far it moves from its tick, [ticks]."""

    capsule: CapsuleOfLink
    a: Array
    b: Array
    travel: Array

    @classmethod
    def of(cls, capsule: CapsuleOfLink, a: Array, b: Array, samples: Samples) -> Moving:
        """A capsule with the ends ``a``, ``b`` [s, 3]."""
        first, anchor = samples.starts, samples.anchor
        moved = [np.linalg.norm(end - end[first[anchor]], axis=1) for end in (a, b)]
        return cls(capsule, a, b, np.maximum.reduceat(np.maximum(*moved), first))


def declare(tally: Tally, rules: Rules) -> None:
    """The checks of this module."""
    for kind in (LINKS, STRUCTURE):
        tally.declare(kind, rules.clearance - rules.clearance_slack, "m", least=True)


def check_links(urdf: Urdf, placements: Placements, samples: Samples, rules: Rules, tally: Tally) -> None:
    """Links against each other, in the body's frame; links next to each other are exempt, and such as move together."""
    exempt = urdf.neighbours()
    moving = _moving(urdf, placements, samples)
    for i, first in enumerate(moving):
        with_it = urdf.carried_with(first.capsule.link)
        for second in moving[i + 1 :]:
            one, two = first.capsule.link, second.capsule.link
            if two in with_it or frozenset((one, two)) in exempt:
                continue
            radii = first.capsule.radius + second.capsule.radius

            def measure(rows: Rows, x: Moving = first, y: Moving = second, r: float = radii) -> Array:
                return distances.between_segments(x.a[rows], x.b[rows], y.a[rows], y.b[rows]) - r

            _add(tally, LINKS, measure, first.travel + second.travel, samples, rules, f"{one} and {two}")


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What links must stay clear of: parts by name, each with a quicker bound, and the holds that stand on it."""

    parts: dict[str, Measure]
    bounds: dict[str, Measure]
    holds: dict[str, Array]

    @classmethod
    def of(cls, structure: Structure | None, table: HoldTable, rules: Rules) -> Surroundings:
        """Surface and obstacles; with neither, the planes through the holds across their axes."""
        parts, bounds = dict[str, Measure](), dict[str, Measure]()
        surface = None if structure is None else structure.surface
        if surface is not None:
            parts["surface"] = lambda a, b: distances.from_surface(surface, a, b)
        for obstacle in () if structure is None else structure.obstacles:
            parts[obstacle.id] = partial(distances.from_obstacle, obstacle)
            bounds[obstacle.id] = partial(distances.at_least, obstacle)
        if not parts:
            axes = table.rotation[:, :, 2]
            parts["plane of a hold"] = lambda a, b: distances.from_tangents(table.position, axes, a, b)
        holds = {}
        for name, measure in parts.items():
            stands = np.abs(measure(table.position, table.position)) <= rules.exempt_distance
            holds[name] = table.position[stands]
        return cls(parts, bounds, holds)


def check_structure(
    urdf: Urdf,
    placements: Placements,
    samples: Samples,
    around: Surroundings,
    hands: dict[str, Array],
    rules: Rules,
    tally: Tally,
) -> None:
    """Links against surface and obstacles; a hand that is near a hold may touch what that hold stands on.

    Args:
        placements: in the structure's frame. hands: positions [s, 3] of the hands by the link that grasps.
    """
    grasps = {link: hand for hand in hands for link in urdf.carried_with(hand)}
    for moving in _moving(urdf, placements, samples):
        link, radius = moving.capsule.link, moving.capsule.radius
        hand = hands.get(grasps.get(link, ""))
        for name, part in around.parts.items():

            def measure(rows: Rows, x: Moving = moving, of: Measure = part, r: float = radius) -> Array:
                return of(x.a[rows], x.b[rows]) - r

            bound = partial(measure, of=around.bounds.get(name, part))

            def touches(rows: Rows, at: Array | None = hand, holds: Array = around.holds[name]) -> NDArray[np.bool_]:
                return _never(rows) if at is None else distances.near_any(holds, at[rows], rules.exempt_distance)

            _add(tally, STRUCTURE, measure, moving.travel, samples, rules, f"{link} and {name}", touches, bound)


def _moving(urdf: Urdf, placements: Placements, samples: Samples) -> list[Moving]:
    return [Moving.of(c, placements.point(c.link, c.a), placements.point(c.link, c.b), samples) for c in urdf.capsules]


def _never(rows: Rows) -> NDArray[np.bool_]:
    return np.zeros(len(rows), dtype=bool)


def _add(
    tally: Tally,
    kind: str,
    measure: Callable[[Rows], Array],
    travel: Array,
    samples: Samples,
    rules: Rules,
    what: str,
    exempt: Callable[[Rows], NDArray[np.bool_]] = _never,
    at_least: Callable[[Rows], Array] | None = None,
) -> None:
    """Measures a pair at ticks, and between them where it can matter: at the limit, or at the least so far.

    Args:
        at_least: no more than ``measure`` says, and quicker.
    """
    known, ticks = tally.worst(kind), samples.starts
    bound = max(rules.clearance, np.inf if np.isnan(known) else known)
    at_ticks = (at_least or measure)(ticks)
    counts = at_ticks <= bound
    counts[counts] = ~exempt(ticks[counts])
    if at_least is not None and counts.any():
        at_ticks[counts] = measure(ticks[counts])
        counts &= at_ticks <= bound
    if counts.any():
        bound = max(rules.clearance, float(at_ticks[counts].min()))
        tally.add(kind, at_ticks[counts], samples.t[ticks[counts]], lambda _: what)
    inside = np.ones(len(samples), dtype=bool)
    inside[ticks] = False
    rows = np.flatnonzero(inside & (at_ticks - travel <= bound)[samples.anchor])
    rows = rows[~exempt(rows)]
    if at_least is not None:
        rows = rows[at_least(rows) <= bound]
    if not len(rows):
        return
    found = measure(rows)
    near = found <= bound
    tally.add(kind, found[near], samples.t[rows[near]], lambda _: what)
