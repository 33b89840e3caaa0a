"""Symbolic Jacobians of declared rows, in the axes in which they cost least."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.analysis.algebra.ring import Matrix, Poly, TrigRing
from wbc.analysis.algebra.transforms import cross, dot
from wbc.analysis.jacobians.model import ExactModel, checked_model
from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows, Rows, checked
from wbc.errors import RangeError
from wbc.validation import Array


@dataclass(frozen=True, order=True)
class Cost:
    """What it takes to evaluate expanded polynomials once: additions, multiplications, trigonometric functions."""

    additions: int
    multiplications: int
    functions: int

    @property
    def total(self) -> int:
        """All of them together, which is what the choice of axes makes small."""
        return self.additions + self.multiplications + self.functions

    def __str__(self) -> str:
        return f"{self.additions} add, {self.multiplications} mult, {self.functions} trig"


@dataclass(frozen=True, eq=False)
class SymbolicJacobian:
    """Rows of a Jacobian as polynomials.

    Attributes:
        ring: where the entries live. matrix: rows x dof. names: of the rows. axes: frame in whose axes each
            declaration is expressed, "-" for joint rates.
    """

    ring: TrigRing
    matrix: Matrix
    names: tuple[str, ...]
    axes: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and joints."""
        return len(self.matrix), len(self.matrix[0])

    @property
    def cost(self) -> Cost:
        """Of one evaluation of all entries."""
        return cost(self.ring, [p for row in self.matrix for p in row])

    def value(self, q: Any) -> Array:
        """The numbers at a configuration, one a joint [rows, dof]."""
        values = validation.real_array("q", q, (len(self.ring.coordinates),))
        return np.array([[self.ring.value(p, list(values)) for p in row] for row in self.matrix])


def cost(ring: TrigRing, polynomials: Sequence[Poly]) -> Cost:
    """Additions, multiplications and trigonometric functions of expanded polynomials.

    A term of m factors costs m - 1 multiplications, its number counting as a factor unless it is 1 or -1; every
    cosine and sine that appears is evaluated once.
    """
    additions = multiplications = 0
    functions: set[int] = set()
    sliding = set(ring.slides.values())
    angular = {place for pair in ring.circles.values() for place in pair[:2]}
    for p in polynomials:
        additions += max(len(p) - 1, 0)
        for powers, number in p.terms():
            factors = sum(powers) + (number != 1 and number != -1)
            multiplications += max(factors - 1, 0)
            functions |= {i for i, e in enumerate(powers) if e and i in angular and i not in sliding}
    return Cost(additions, multiplications, len(functions))


def symbolic_jacobian(model: ExactModel, rows: Sequence[Rows], *, axes: str | None = None) -> SymbolicJacobian:
    """The Jacobian of declarations, stacked in order.

    Args:
        axes: a frame in which to express what leaves it open. None: for each declaration by itself the cheapest of
            one frame a joint and the world; a rotation of the rows, so ranks stay.

    Raises:
        ShapeError: no declarations. UnknownNameError: no such frame or joint.
    """
    checked_model(model)
    if axes is not None:
        model.robot.check_frame("axes", axes)
    matrix: Matrix = []
    names: list[str] = []
    chosen: list[str] = []
    for declared in checked("rows", rows):
        key = declared, axes
        block, frame = model.blocks[key] if key in model.blocks else model.blocks.setdefault(key, _block(model, *key))
        matrix += [[*row] for row in block]
        chosen.append(frame)
        names += [str(declared) if len(block) == 1 else f"{declared}.{_label(declared, i)}" for i in range(len(block))]
    return SymbolicJacobian(model.ring, matrix, tuple(names), tuple(chosen))


def augmented_jacobian(
    model: ExactModel, task: Sequence[Rows], rows: Sequence[Rows]
) -> tuple[Matrix, SymbolicJacobian]:
    """J_T, of no rows where there is no task, and the Jacobian of task and constraints.

    Raises:
        RangeError: fewer rows than joints, or more task rows than joints.
    """
    own, every, joints = (
        symbolic_jacobian(model, task).matrix if task else [],
        symbolic_jacobian(model, rows),
        model.robot.nv,
    )
    if len(own) > joints or every.shape[0] < joints:
        text = f"expected at least {joints} in all and at most {joints} in the task"
        raise RangeError("rows", every.shape[0], text)
    return own, every


def _label(declared: Rows, i: int) -> str:
    assert isinstance(declared, BodyRows)
    labels = [f"v{'xyz'[k]}" for k in declared.translation] + [f"w{'xyz'[k]}" for k in declared.rotation]
    return labels[i]


def _block(model: ExactModel, declared: Rows, axes: str | None) -> tuple[Matrix, str]:
    """Rows of one declaration, and the frame whose axes were taken."""
    if isinstance(declared, JointRows):
        dof = model.robot.dofs(declared.joint).start
        unit = [model.ring.one if k == dof else model.ring.zero for k in range(model.robot.nv)]
        return [unit], "-"
    if isinstance(declared, BodyRows) and declared.expressed is not None:
        return body_rows(model, declared, declared.expressed), declared.expressed
    if axes is not None:
        return _expressed(model, declared, axes), axes
    found = [(_expressed(model, declared, frame), frame) for frame in model.distinct_frames()]
    return min(found, key=lambda item: cost(model.ring, [p for row in item[0] for p in row]).total)


def _expressed(model: ExactModel, declared: BodyRows | PitchPlaneRows, axes: str) -> Matrix:
    return body_rows(model, declared, axes) if isinstance(declared, BodyRows) else _pitch_plane(model, declared, axes)


def body_rows(model: ExactModel, declared: BodyRows, axes: str, at: str | None = None) -> Matrix:
    """Chosen components of v and omega: columns a x (p - o) and a of the joints between base and frame.

    v is that of the body's point at the origin p of another frame, ``at``, where one is given.
    """
    ring = model.ring
    joint, _ = model.frame(declared.frame)
    reference, _ = model.frame(declared.base)
    moving, carrying = set(model.support(joint)), set(model.support(reference))
    point = model.frame_in(axes, at or declared.frame).position
    height = len(declared.translation) + len(declared.rotation)
    matrix = [[ring.zero] * model.robot.nv for _ in range(height)]
    for j in moving ^ carrying:
        axis = model.axis_in(axes, j)
        if j in carrying:
            axis = [-x for x in axis]
        if ring.coordinates[j - 1].slides:
            linear, angular = axis, [ring.zero] * 3
        else:
            origin = model.joint_in(axes, j).position
            linear = cross(axis, [a - b for a, b in zip(point, origin, strict=True)], ring)
            angular = axis
        column = [linear[i] for i in declared.translation] + [angular[i] for i in declared.rotation]
        for row, entry in zip(matrix, column, strict=True):
            row[j - 1] = entry
    return matrix


def _pitch_plane(model: ExactModel, declared: PitchPlaneRows, axes: str) -> Matrix:
    """r.omega of the body that carries the shoulder."""
    ring = model.ring
    shoulder, _ = model.frame(declared.shoulder)
    y = model.axis_in(axes, shoulder)
    ends = [model.frame_in(axes, name).position for name in (declared.shoulder, declared.wrist)]
    span = [w - s for s, w in zip(*ends, strict=True)]
    along = dot(y, span, ring)
    r = [ring.normal(a - b * along) for a, b in zip(span, y, strict=True)]
    row = [ring.zero] * model.robot.nv
    for j in model.support(shoulder):
        if not ring.coordinates[j - 1].slides:
            row[j - 1] = dot(r, model.axis_in(axes, j), ring)
    return [row]
