"""Keeping links of the robot clear of each other."""

from __future__ import annotations

import itertools
import logging
import weakref
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import DuplicateNameError, MissingShapeError, RangeError, ShapeError
from wbc.proximity import Body, PairSensor
from wbc.robot import Robot
from wbc.robot.pairs.link_pairs import link_pairs as every_link_pair, neighbours, shaped_links
from wbc.symbolic.kinematics import joint_of
from wbc.symbolic.tracer import Tracer
from wbc.tasks import _bodies as bodies, _gap as gap
from wbc.tasks.base import Constraint, Input, Numbers, Row, SacrificeOrder, Sensor, Values
from wbc.validation import Array

log = logging.getLogger("wbc")

METHODS = ("auto", "symbolic", "sensed")

#: More pairs of shapes than this get no rows of their own: each is some 200 operations in every tick.
SYMBOLIC_PAIRS = 200

#: Pairs of shapes that no posture brings this far apart [m] are left out: they overlap whatever the robot does.
APART = 1e-3

#: A pair keeps at most this share of the most that a posture brings its shapes apart: all of it would hold its joints.
SHARE = 0.5

#: That is known of pairs which no posture brings farther apart than this, in parts of the characteristic length, or
#: than the margin of the declaration over SHARE.
SEARCHED = 0.05

#: A shape of each of two links
ShapePair = tuple[bodies.LinkShape, bodies.LinkShape]

#: What was found of a robot's pairs, for pairs of links and the distance that was enough
_FOUND: weakref.WeakKeyDictionary[Robot, dict[Any, dict[tuple[str, str], float]]] = weakref.WeakKeyDictionary()


@dataclass(frozen=True)
class SelfCollision(Constraint):
    """Links of the robot keep clear of each other:

        h = (signed distance between a shape of one link and a shape of another) - margin >= 0     [m]

    Which pairs have rows of their own and which are sensed is as for an ``Obstacle``. A row moves only the joints
    between its two links, and is called ``link[i] other[k]``, or ``closest[k]``; ``controller.pairs(name)`` says which
    pairs those were about.

    The ``closest`` rows are for the pairs that push, then for the nearest. Every sensed pair without a row is checked
    at the command; where it closes too fast it gets a row, and the command is found again. Where more than ``closest``
    pairs push at once (up to 11 on a humanoid with shapes on all links) the tick brakes (``braked``) and the log says
    so.

    A pair of shapes that no posture brings as far apart as twice the margin keeps half of the most that one does;
    pairs that overlap in all postures are left out. Both are searched when the item is added, and logged with their
    distances. From an overlap the rows push apart at -rate h at least.

    Attributes:
        pairs: pairs of links; None: ``robot.self_pairs``, and where that is None all pairs of links with shapes that
            are neither welded together nor neighbours across one joint.
        method: ``"auto"``: expressions where the shapes have one, if these are at most :data:`SYMBOLIC_PAIRS` pairs of
            shapes, else all are sensed; ``"symbolic"``: expressions or an error; ``"sensed"``: all are sensed.
        others: as in :class:`wbc.tasks.Obstacle`.

    Inputs:
        margin: what is kept between the shapes [m].

    What it cannot do: see what the link shapes do not cover. With fewer rows than sensed pairs that push at once the
    tick brakes, or pairs within their margins open too slowly. A ``margin`` raised while running is kept only by pairs
    that postures bring farther apart than twice the declared one.

    Example:
        >>> import wbc
        >>> panda = wbc.robots.load("panda")
        >>> stack = wbc.Stack(panda, dt=0.005)
        >>> pairs = [("panda_link2", "panda_hand"), ("panda_link0", "panda_hand")]
        >>> stack.add(wbc.tasks.SelfCollision(pairs, margin=0.01), name="fold")

    Raises:
        ShapeError, RangeError, NotFiniteError, UnknownNameError, DuplicateNameError: on construction.
        UnknownNameError, MissingShapeError, RangeError, ShapeError: in :meth:`validate`.
    """

    stands_in_world: ClassVar[bool] = False

    order: ClassVar[SacrificeOrder] = SacrificeOrder.MARGIN

    pairs: tuple[tuple[str, str], ...] | None = None
    margin: float = 0.0
    closest: int = 16
    corners: int = 4
    method: Literal["auto", "symbolic", "sensed"] = "auto"

    def __post_init__(self) -> None:
        if self.pairs is not None:
            object.__setattr__(self, "pairs", _checked_pairs(self.pairs))
        validation.own_scalars(self, "margin", low=0.0, unit="m")
        object.__setattr__(self, "closest", bodies.checked_count("SelfCollision.closest", self.closest))
        object.__setattr__(self, "corners", bodies.checked_count("SelfCollision.corners", self.corners, least=0))
        validation.one_of("SelfCollision.method", self.method, METHODS)

    def validate(self, robot: Robot) -> None:
        """Check the pairs.

        Raises:
            UnknownNameError: no such frame.
            MissingShapeError: a link without shapes, or no pair at all.
            RangeError: links that no joint moves against each other; too many pairs for the method.
            ShapeError: ``method="symbolic"`` and shapes without an expression.
        """
        available = shaped_links(robot)
        for a, b in self.pairs or ():
            for link in (a, b):
                bodies.check_shaped(robot, "SelfCollision.pairs", link, available)
            if joint_of(robot.tree, a) == joint_of(robot.tree, b):
                raise RangeError("SelfCollision.pairs", (a, b), "no joint moves these links against each other")
        every = ((a[2].shape, b[2].shape) for a, b in self._every_shape_pair(robot))
        bodies.check_distances("SelfCollision.pairs", every)
        pairs = self._shape_pairs(robot)
        if not pairs:
            none = (
                "no posture brings the shapes of any pair apart"
                if self._most_apart(robot)
                else "no pair of links with shapes to keep apart"
            )
            raise MissingShapeError("SelfCollision.pairs", self.pairs, none + bodies.meshes_instead(robot))
        if self.method == "symbolic":
            self._check_symbolic(pairs)
        self._say_kept(robot)
        bodies.check_sensed("SelfCollision.pairs", len(pairs))

    def _say_kept(self, robot: Robot) -> None:
        """Name the pairs that no posture brings as far apart as the margin, with the most that one does."""
        most = {pair: d for pair, d in self._most_apart(robot).items() if d < max(self.margin, APART)}
        gone = {pair: d for pair, d in most.items() if d <= APART}
        if gone:
            log.warning("SelfCollision: no posture brings these apart, nothing keeps them clear: %s", _listed(gone))
        if near := {pair: d for pair, d in most.items() if d > APART}:
            what = "SelfCollision: no posture brings these %.3g mm apart, they keep half of the most that one does: %s"
            log.warning(what, 1e3 * self.margin, _listed(near))

    def _check_symbolic(self, pairs: list[ShapePair]) -> None:
        advice = "use method='sensed', or name fewer pairs"
        for first, second in pairs:
            if _is_sensed(first, second):
                names = (bodies.label(*first[:2]), bodies.label(*second[:2]))
                kinds = " and ".join(type(s[2].shape).__name__ for s in (first, second))
                raise ShapeError("SelfCollision.pairs", names, f"{kinds} have no expression; {advice}")
        if len(pairs) > SYMBOLIC_PAIRS:
            reason = f"more than {SYMBOLIC_PAIRS} pairs of shapes for method='symbolic'; {advice}"
            raise RangeError("SelfCollision.pairs", len(pairs), reason)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (Input("margin", unit="m", default=self.margin, low=0.0),)

    def link_pairs(self, robot: Robot) -> tuple[tuple[str, str], ...]:
        """The pairs of links that keep clear of each other."""
        if self.pairs is not None:
            return self.pairs
        if robot.self_pairs is not None:
            joint = {name: joint_of(robot.tree, name) for name in shaped_links(robot)}
            return tuple((a, b) for a, b in robot.self_pairs if a in joint and b in joint and joint[a] != joint[b])
        known = neighbours(robot)
        return tuple(pair for pair in every_link_pair(robot) if pair not in known)

    def sensed_pairs(self, robot: Robot) -> tuple[tuple[Body, Body], ...]:
        """Pairs of shapes that a sensor measures."""
        known: dict[str, Body] = {}

        def body(shape: bodies.LinkShape) -> Body:
            return known.setdefault(bodies.label(*shape[:2]), bodies.body(*shape))

        return tuple((body(a), body(b)) for a, b in self._split(robot)[1])

    def sensed_rows(self, robot: Robot) -> int:
        return self._nearest(robot) * (1 + self.corners)

    def sensor(self, robot: Robot, numbers: Numbers) -> Sensor:
        most = self._kept(robot, self._split(robot)[1])
        pairs, count = self.sensed_pairs(robot), self._nearest(robot)
        return PairSensor(robot, pairs, count, numbers, corners=self.corners, most=most)

    def _nearest(self, robot: Robot) -> int:
        return min(self.closest, len(self._split(robot)[1]))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """``link[i] link[k]`` for shapes i and k of two links, with suffixes where they are more; ``closest[k]``,
        then ``closest[k].corner[i]``.
        """
        own = [
            Row(f"{bodies.label(*first[:2])} {bodies.label(*second[:2])}{suffix}", "m")
            for first, second in self._split(robot)[0]
            for suffix in gap.pair_rows(first[2].shape, second[2].shape)
        ]
        return (*own, *bodies.sensed_labels(self.sensed_rows(robot), self.corners))

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        rows, kept, pairs = [], [], self._split(robot)[0]
        for ((a, _, first), (b, _, second)), most in zip(pairs, self._kept(robot, pairs), strict=True):
            more = gap.gaps(gap.on_link(kin, a, first), gap.on_link(kin, b, second))
            rows += more
            kept += [inputs["margin"] if np.isinf(most) else ca.fmin(inputs["margin"], most)] * len(more)
        own = kin.gaps(rows) - ca.vertcat(*kept) if rows else ca.SX(0, 1)
        return ca.vertcat(own, bodies.sensed_margins(inputs, self.sensed_rows(robot)))

    def _every_shape_pair(self, robot: Robot) -> list[ShapePair]:
        return [
            pair
            for a, b in self.link_pairs(robot)
            for pair in itertools.product(bodies.shapes_of(robot, (a,)), bodies.shapes_of(robot, (b,)))
        ]

    def _shape_pairs(self, robot: Robot) -> list[ShapePair]:
        """Those that some posture brings apart."""
        most = self._most_apart(robot)
        return [p for p in self._every_shape_pair(robot) if most.get(_names(p), np.inf) > APART]

    def _most_apart(self, robot: Robot) -> dict[tuple[str, str], float]:
        """What no posture brings as far apart as counts here, and how far apart some posture brings it [m]."""
        from wbc.robot.pairs.apart import most_apart

        enough = max(self.margin / SHARE, SEARCHED * robot.characteristic_length)
        known, key = _FOUND.setdefault(robot, {}), (self.link_pairs(robot), enough)
        if key not in known:
            pairs = self._every_shape_pair(robot)
            shapes = {bodies.label(*s[:2]): (s[0], s[2]) for pair in pairs for s in pair}
            known[key] = most_apart(robot, shapes, [_names(pair) for pair in pairs], enough)
        return known[key]

    def kept_pairs(self, robot: Robot) -> list[tuple[ShapePair, float]]:
        """Pairs of shapes that keep apart, and the most of the margin that each keeps [m]; infinite: all of it."""
        pairs = self._shape_pairs(robot)
        return list(zip(pairs, map(float, self._kept(robot, pairs)), strict=True))

    def _kept(self, robot: Robot, pairs: list[ShapePair]) -> Array:
        """The margin that each pair keeps at most [m]; infinite where postures leave room for any."""
        most = self._most_apart(robot)
        return SHARE * np.array([most.get(_names(pair), np.inf) for pair in pairs])

    def _split(self, robot: Robot) -> tuple[list[ShapePair], list[ShapePair]]:
        """Pairs with rows of their own, and sensed ones; a pair may be both."""
        pairs = self._shape_pairs(robot)
        own = [pair for pair in pairs if gap.pair_rows(pair[0][2].shape, pair[1][2].shape)]
        if self.method == "sensed" or (self.method == "auto" and len(own) > SYMBOLIC_PAIRS):
            return [], pairs
        return own, [pair for pair in pairs if _is_sensed(*pair)]


def _names(pair: ShapePair) -> tuple[str, str]:
    return bodies.label(*pair[0][:2]), bodies.label(*pair[1][:2])


def _listed(found: dict[tuple[str, str], float]) -> str:
    return ", ".join(f"{a} and {b} ({1e3 * most:.1f} mm)" for (a, b), most in found.items())


def _is_sensed(first: bodies.LinkShape, second: bodies.LinkShape) -> bool:
    return gap.is_sensed(first[2].shape, second[2].shape)


def _checked_pairs(pairs: Any) -> tuple[tuple[str, str], ...]:
    """Pairs of names as tuples."""
    if isinstance(pairs, str) or not isinstance(pairs, Iterable):
        raise ShapeError("SelfCollision.pairs", pairs, "expected pairs of link names")
    out: list[tuple[str, str]] = []
    for pair in pairs:
        names = tuple(pair) if isinstance(pair, (list, tuple)) else ()
        if len(names) != 2 or not all(isinstance(name, str) for name in names) or names[0] == names[1]:
            raise ShapeError("SelfCollision.pairs", pair, "expected pairs of two different link names")
        if names in out or names[::-1] in out:
            raise DuplicateNameError("SelfCollision.pairs", names, "named twice")
        out.append((names[0], names[1]))
    if not out:
        raise ShapeError("SelfCollision.pairs", pairs, "expected at least one pair")
    return tuple(out)
