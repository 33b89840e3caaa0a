"""Searching the joint range for configurations in which two links touch, and for such in which they do not."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from wbc import validation
from wbc.robot.pairs.descent import Descent
from wbc.robot.pairs.distances import Links, Scenes
from wbc.robot.sampling import draw
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot.robot import Robot

#: Configurations whose links are placed at once.
CHUNK = 2500

#: A pair that no sample brings into touch is moved together from this many of its closest samples.
STARTS = 3

Progress = Callable[[int, int], None]


@dataclass
class PairFinding:
    """What the search knows of a pair of links.

    Attributes:
        distance: least signed distance found [m]; the search ends where the links touch, so of two links that do it
            says that they do, and not how deep they may overlap.
        steps: steps from the neutral configuration to the closest samples, closest first.
        apart: whether some sample is farther apart than the clearance.
        sampled: least signed distance of the samples alone [m].
    """

    distance: float = np.inf
    steps: list[tuple[float, Array]] = field(default_factory=list)
    apart: bool = False
    sampled: float = np.inf


def search(
    robot: Robot,
    links: Links,
    pairs: Sequence[tuple[str, str]],
    samples: int,
    seed: int,
    clearance: float,
    *,
    progress: Progress,
    settled: Container[tuple[str, str]] = (),
) -> dict[tuple[str, str], PairFinding]:
    """Least distances of pairs over samples of the joint range, then over descents from the closest of them; no
    descents for pairs that are ``settled`` whatever the answer.

    Descents find touching configurations that random samples miss, see :class:`~wbc.robot.pairs.descent.Descent`.
    """
    rng = np.random.default_rng(seed)
    descent, found = Descent(robot, links, clearance), {pair: PairFinding() for pair in pairs}
    chunks = [CHUNK] * (samples // CHUNK) + [samples % CHUNK] * (samples % CHUNK > 0)
    total, done = len(pairs) * (len(chunks) + 1), 0
    for count in chunks:
        steps = draw(robot, count, rng)
        scenes = links.place(steps)
        for pair, finding in found.items():
            _scan(finding, scenes, pair, steps, clearance)
            done += 1
            validation.called("progress", progress, done, total)
    for pair, finding in found.items():
        finding.distance = finding.sampled
        if finding.sampled > clearance and pair not in settled:
            for _, start in finding.steps:
                finding.distance = min(finding.distance, descent.run(*pair, start))
                if finding.distance <= clearance:
                    break
        done += 1
        validation.called("progress", progress, done, total)
    return found


def _scan(finding: PairFinding, scenes: Scenes, pair: tuple[str, str], steps: Array, clearance: float) -> None:
    """Adds a chunk of samples to what is known of a pair."""
    bounds = scenes.bounds(*pair)
    exact = scenes.links.is_exact(*pair)
    for n in np.argsort(bounds, kind="stable"):
        known = len(finding.steps) >= STARTS and bounds[n] >= finding.steps[-1][0]
        if known or finding.sampled <= clearance:
            break
        distance = float(bounds[n]) if exact else scenes.distance(*pair, int(n))
        finding.steps = sorted([*finding.steps, (distance, steps[n])], key=lambda item: item[0])[:STARTS]
        finding.sampled = finding.steps[0][0]
    if finding.apart:
        return
    for n in np.argsort(-bounds, kind="stable"):
        if bounds[n] > clearance or (not exact and scenes.distance(*pair, int(n)) > clearance):
            finding.apart = True
        if finding.apart or exact:
            break
