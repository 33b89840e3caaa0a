"""Loci that are known in closed form: joints at which a square pair loses rank, whatever the others do.

The determinant of a square pair is factored exactly, see :mod:`wbc.analysis`; each factor that is linear in
tan(q_i / 2) puts one joint at one angle, and the distance to it is |q_i - angle|, up to whole turns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TypeAlias

from wbc import validation
from wbc.analysis import (
    BodyRows,
    Exact,
    ExactModel,
    JointBlock,
    JointRows,
    LocusBranch,
    Notation,
    PitchPlaneRows,
    Relation,
    Value,
    factored_determinant,
    joint_blocks,
    symbolic_jacobian,
)
from wbc.analysis.algebra.points import univariate_roots
from wbc.analysis.blocks import block_model
from wbc.coordinates.pair import CoordinatePair
from wbc.errors import RangeError, ShapeError, WbcError
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.validation import Array

#: Joints of an arm, at most, for the determinant of parts of a position to be short enough to be of use
SMALL = 4
#: Joints of an arm, at most, for any determinant to be short enough to be of use
LARGE = 7
#: Terms of a relation in half angles beyond which it is not written out: nobody reads it, and sorting it takes seconds
LONG = 100
#: What rank analysis knows
_Known: TypeAlias = BodyRows | JointRows | PitchPlaneRows


@dataclass(frozen=True)
class Place:
    """A joint at an angle [rad], or a displacement [m], where a pair is singular.

    Attributes:
        dof: index into v. joint: its name. value: the angle. turning: whether whole turns are the same.
    """

    dof: int
    joint: str
    value: float
    turning: bool

    def distance(self, q: Array) -> float:
        """How far the joint is to go, with its sign; every joint has one coordinate."""
        off = self.value - float(q[self.dof])
        return math.remainder(off, 2.0 * math.pi) if self.turning else off

    def __str__(self) -> str:
        return f"{self.joint} = {self.value:.4g}"


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Where the determinant of a square pair vanishes.

    Attributes:
        places: joints at angles. always: the determinant is identically zero.
        branches, exact: all conditions, and the arithmetic that they are of.
    """

    places: tuple[Place, ...]
    always: bool = False
    branches: tuple[LocusBranch, ...] = ()
    exact: Exact | None = None

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """All conditions as rank analysis writes them, joints by their number; of longer ones only that they are."""
        if self.always:
            return ("everywhere",)
        if self.exact is None:
            return ()
        long = [b for b in self.branches if any(len(r.poly) > LONG for r in b.relations)]
        short = [b for b in self.branches if b not in long]
        counted = [sum(len(r.poly) for r in b.relations) for b in long]
        return (*Notation(self.exact.half).branches(short), *(f"a relation of {n} terms = 0" for n in counted))

    def nearest(self, q: Array) -> tuple[Place, float] | None:
        """The nearest place and the distance to it, or None where there is none."""
        if self.places:
            q = validation.ordinary_array("q", q)
            least = 1 + max(place.dof for place in self.places)
            if q.ndim != 1 or len(q) < least:
                raise ShapeError("q", q, f"expected {least} numbers or more, one a joint")
        found = [(place, place.distance(q)) for place in self.places]
        return min(found, key=lambda item: abs(item[1]), default=None)


def closed_form(robot: Robot, pair: CoordinatePair) -> ClosedForm | None:
    """The factors of a pair's determinant, once a robot and pair.

    None where the pair is not square, where it has rows that rank analysis does not know, or where that refuses the
    robot (floating bases, placements that are not by right angles). A part of a position in an arm of more than
    :data:`SMALL` joints, or more than :data:`LARGE` joints, has a determinant too long to be of use. Of a tree it is
    the determinant of the one arm that is not locked, whose joints count from 1.
    """
    pair = validation.instance("pair", pair, CoordinatePair, "a CoordinatePair")
    checked_robot(robot)
    rows = [one for one in pair.rows if isinstance(one, (BodyRows, JointRows, PitchPlaneRows))]
    parted = any(isinstance(one, BodyRows) and len(one.translation) in (1, 2) for one in rows)
    if len(rows) < len(pair.rows) or sum(pair.counts(robot)) != robot.nv or robot.nq != robot.nv:
        return None
    if parted and robot.nv > SMALL:
        return None
    block = JointBlock(tuple(robot.dof_names), tuple(rows)) if robot.nv <= LARGE else _arm(robot, rows)
    return None if block is None else _factored(robot, block)


def _arm(robot: Robot, rows: Sequence[_Known]) -> JointBlock | None:
    """The one block of a tree that is not the lock of a joint; None where there are none or several, or a large one."""
    try:
        blocks = joint_blocks(robot, rows)
    except RangeError:
        return None
    moving = [one for one in blocks if not isinstance(one.rows[0], JointRows) or len(one.joints) > 1]
    return moving[0] if len(moving) == 1 and len(moving[0].joints) <= LARGE else None


@cache
def _factored(robot: Robot, block: JointBlock) -> ClosedForm | None:
    exact = _exact(robot, block.joints)
    if exact is None:
        return None
    model, rings = exact
    try:
        factors = factored_determinant(rings, symbolic_jacobian(model, block.rows)).factors
    except WbcError:
        # A frame of the rows is not placed by right angles, though the joints are
        return None
    if factors.zero:
        return ClosedForm((), always=True)
    values = [f for f, _ in factors.conditions if isinstance(f, Value)]
    relations = [f for f, _ in factors.conditions if isinstance(f, Relation) and _vanishes(rings, f)]
    branches = [LocusBranch(values=(v,)) for v in values] + [LocusBranch(relations=(r,)) for r in relations]
    return ClosedForm(tuple(_place(robot, model, v) for v in values), branches=tuple(branches), exact=rings)


def _vanishes(rings: Exact, relation: Relation) -> bool:
    """Whether a factor can be zero; of those in one joint it is known."""
    return len(relation.joints) > 1 or bool(univariate_roots(rings.half, relation))


@cache
def _exact(robot: Robot, joints: tuple[str, ...]) -> tuple[ExactModel, Exact] | None:
    """The exact model of some joints of a robot, the others at zero; None for one that rank analysis refuses."""
    try:
        model = block_model(ExactModel(robot), JointBlock(joints, ()))
    except WbcError:
        return None
    return model, Exact(model.ring)


def _place(robot: Robot, model: ExactModel, value: Value) -> Place:
    joint = model.ring.coordinates[value.joint]
    name = model.robot.dof_names[joint.dof]
    angle = math.pi if value.value is None else 2.0 * math.atan(float(value.value))
    place = float(value.value or 0) if joint.slides else angle
    return Place(robot.dof_names.index(name), name, place, not joint.slides)
