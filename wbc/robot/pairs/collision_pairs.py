"""Which links of a robot must not touch each other, and why the others need not be watched."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from wbc import validation
from wbc.errors import MissingShapeError, ShapeError
from wbc.robot.pairs.distances import Links
from wbc.robot.pairs.link_pairs import link_pairs, neighbours
from wbc.robot.pairs.search import PairFinding, Progress, search
from wbc.robot.robot import Robot
from wbc.robot.sources.srdf import CollisionRules, read_srdf

#: Reason -> what it means; the first three are of pairs that are kept.
REASONS: Mapping[str, str] = {
    "touches": "kept: a configuration was found in which the links touch",
    "unsampled": "kept: no configurations were looked at",
    "enabled": "kept: the SRDF file says so",
    "same body": "dropped: welded to each other, or all joints between them are locked",
    "adjacent": "dropped: on the two sides of one joint",
    "srdf": "dropped: the SRDF file says so",
    "always": "dropped: they touch in every sample",
    "neutral": "dropped: they touch in the robot's neutral configuration",
    "never": "dropped: no configuration was found in which the links touch",
    "unlisted": "dropped: the file of pairs does not name them",
    "hand": "kept or dropped by whoever edited the file of pairs",
}


@dataclass(frozen=True)
class LinkPair:
    """Two links with shapes.

    Attributes:
        links: their names.
        keep: whether they must not touch each other.
        reason: one of :data:`REASONS`.
        distance: least signed distance found [m]; of links that touch, how deep the first overlap found is (not the
            deepest possible one). None: not measured.
        detail: what the SRDF file gives as its reason.
    """

    links: tuple[str, str]
    keep: bool
    reason: str
    distance: float | None = None
    detail: str = ""


@dataclass(frozen=True)
class SelfPairs:
    """Every pair of links with shapes, kept or not.

    Attributes:
        robot: its name.
        pairs: in the robot's order.
        samples, seed, clearance: what they were found with; see :func:`find_self_pairs`.
        unknown: links that the SRDF file names and that this robot does not have.
    """

    robot: str
    pairs: tuple[LinkPair, ...]
    samples: int = 0
    seed: int = 0
    clearance: float = 0.0
    unknown: tuple[str, ...] = ()

    @property
    def kept(self) -> tuple[tuple[str, str], ...]:
        """The pairs that must not touch, for ``robot.with_self_pairs``."""
        return tuple(pair.links for pair in self.pairs if pair.keep)

    def counts(self) -> dict[str, int]:
        """Reason -> number of pairs, in the order of :data:`REASONS`."""
        count = Counter(pair.reason for pair in self.pairs)
        return {reason: count[reason] for reason in REASONS if count[reason]}

    def summary(self) -> str:
        """One sentence."""
        shown = ", ".join(f"{number} {reason}" for reason, number in self.counts().items())
        return f"{len(self.kept)} of {len(self.pairs)} kept ({shown})" if self.pairs else "no two links with shapes"


def find_self_pairs(
    robot: Robot,
    *,
    srdf: Any = None,
    samples: int = 10000,
    seed: int = 0,
    clearance: float = 0.0,
    progress: Progress | None = None,
) -> SelfPairs:
    """Chooses the pairs of links that must not touch each other, among all links with shapes.

    A pair is dropped for the first of these reasons that holds: ``same body``; ``enabled`` in the SRDF file (then it
    is kept); ``adjacent``; disabled in the ``srdf`` file; ``always`` closer than ``clearance``; closer than that in
    the ``neutral`` configuration; ``never`` that close. See :data:`REASONS`.

    Never means: not in ``samples`` random configurations within the position limits, and not at the end of three
    descents of the distance that begin at the closest of them. With ``samples=0`` only the neutral configuration is
    looked at.

    Args:
        robot: its shapes decide; a shape that stands out of its link may touch where the link does not.
        srdf: path of an SRDF file, or None.
        samples: random configurations, uniform in the position limits; unlimited joints cover a turn.
        seed: of the random configurations: the same seed gives the same pairs.
        clearance: links touch where their signed distance is at most this [m].
        progress: called with (steps done, steps in all).

    Raises:
        MissingShapeError: no link of the robot has shapes.
        RangeError: samples or seed below 0; ShapeError: no whole numbers. RobotFileError: a bad SRDF file.

    Cannot do: prove that two links never touch. The descents end in local minima.
    """
    validation.instance("robot", robot, Robot, "a wbc Robot, see wbc.robots.load")
    if progress is not None and not callable(progress):
        raise ShapeError("progress", progress, "expected a function of (steps done, steps in all)")
    samples, seed = validation.integer("samples", samples), validation.integer("seed", seed)
    clearance = validation.scalar("clearance", clearance, unit="m")
    rules = (
        read_srdf(validation.file_path("srdf", srdf)).collisions()
        if srdf is not None
        else CollisionRules({}, frozenset(), frozenset())
    )
    pairs = link_pairs(robot)
    if not any(robot.shapes.values()):
        raise MissingShapeError(
            "robot.shapes", robot.name, "no link of this robot has shapes; load it with shapes='fit'"
        )
    links, near = Links(robot), neighbours(robot)
    settled = {pair: _without_measure(pair, near.get(pair), rules) for pair in pairs}
    neutral = links.at_neutral([pair for pair in pairs if samples or settled[pair] is None])
    found: dict[tuple[str, str], PairFinding] = {}
    if samples:
        moving = [pair for pair in pairs if near.get(pair) != "same body"]
        done = {pair for pair in moving if settled[pair] is not None or neutral[pair] <= clearance}
        found = search(robot, links, moving, samples, seed, clearance, progress=progress or _silent, settled=done)
    chosen = tuple(_judged(pair, settled[pair], neutral.get(pair), found.get(pair), clearance) for pair in pairs)
    unknown = tuple(sorted(rules.links - set(robot.frame_names)))
    return SelfPairs(robot.name, chosen, samples, seed, clearance, unknown)


def _without_measure(pair: tuple[str, str], near: str | None, rules: CollisionRules) -> tuple[bool, str, str] | None:
    """(keep, reason, detail) of a pair for which no distance needs to be known."""
    said = rules.of(*pair)
    if near == "same body":
        return False, near, ""
    if said is not None and said[0]:
        return True, "enabled", ""
    if near is not None:
        return False, near, ""
    return None if said is None else (False, "srdf", said[1])


def _judged(
    pair: tuple[str, str],
    settled: tuple[bool, str, str] | None,
    neutral: float | None,
    found: PairFinding | None,
    clearance: float,
) -> LinkPair:
    measured = [x for x in (neutral, None if found is None else found.distance) if x is not None]
    distance = min(measured, default=None)
    if settled is not None:
        keep, reason, detail = settled
        return LinkPair(pair, keep, reason, distance, detail)
    if neutral is not None and neutral <= clearance:
        always = found is not None and not found.apart
        return LinkPair(pair, False, "always" if always else "neutral", distance)
    if found is None:
        return LinkPair(pair, True, "unsampled")
    touches = found.distance <= clearance
    return LinkPair(pair, touches, "touches" if touches else "never", distance)


def _silent(done: int, total: int) -> None:
    """No progress shown."""
