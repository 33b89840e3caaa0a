"""Closed loops of a mechanism: two places on a robot that its parts keep together, and joints that follow a curve."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Literal

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import RangeError, WbcError
from wbc.multibody import pin
from wbc.quick_dataclasses import dataclass
from wbc.robot.limits import Limits
from wbc.robot.shortest_steps import CLOSED, DEPENDENT, ShortestSteps
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.validation import Array

Kind = Literal["connect", "weld", "hinge", "slide"]
#: Rows of each kind of loop: those that begin with r are rotations [rad], others lengths [m]
LABELS: Mapping[Kind, tuple[str, ...]] = {
    "connect": ("x", "y", "z"),
    "weld": ("x", "y", "z", "rx", "ry", "rz"),
    "hinge": ("x", "y", "z", "rx", "ry"),
    "slide": ("x", "y", "rx", "ry", "rz"),
}
#: Twice the squared cosine of half the angle between axes is no less, so that none between opposite ones divides by 0
OPPOSITE = 1e-12
#: Entries of Jacobians below this share of the largest are rounding: these joints move both ends of a loop alike
STILL = 1e-12


class LoopError(WbcError):
    """A loop that cannot be closed, or that contradicts another one."""


@dataclass(frozen=True)
class Loop:
    """Two frames that stay together:

        e = (R_a' (p_b - p_a); log3(R_a' R_b)) = 0,      those rows of it that ``kind`` has

    Attributes:
        name: of the loop.
        first, second: names of the frames a and b; ``"world"`` is one.
        kind: ``connect``: their origins meet, as in a ball joint, and as hinges in a plane do; ``weld``: their poses
            are equal; ``hinge``: up to a turn about their z axis, e's rotation being 2 sin(angle / 2) along the
            shortest turn from axis to axis; ``slide``: up to a shift along the z axis of a.
    """

    name: str
    first: str
    second: str
    kind: Kind = "connect"

    def __post_init__(self) -> None:
        validation.name("Loop.name", self.name)
        validation.one_of("Loop.kind", self.kind, LABELS)
        if self.first == self.second:
            raise RangeError("Loop.second", self.second, "a frame closes no loop with itself")

    @property
    def labels(self) -> tuple[str, ...]:
        """A label a row; those of rotations begin with r."""
        return LABELS[self.kind]

    def error(self, kin: Tracer, still: bool = False) -> ca.SX:
        """e of the class, a row a label [m, rad]; ``still``: positions along axes that do not turn with a, where e = 0
        keeps origins together. Along motions of the closed loop its second derivatives are those of e, and simpler.
        """
        first, second = kin.pose(self.first), kin.pose(self.second)
        axes = kin.held(first.rotation) if still and self.kind != "slide" else first.rotation
        gap = axes.T @ (second.position - first.position)
        if self.kind == "connect":
            return gap
        if self.kind == "hinge":
            axis = first.rotation.T @ second.rotation[:, 2]
            half = ca.sqrt(0.5 * ca.fmax(1.0 + axis[2], OPPOSITE))
            return ca.vertcat(gap, -axis[1] / half, axis[0] / half)
        turn = kin.rotation_error(self.second, self.first, ca.SX.eye(3))
        return ca.vertcat(gap[:2] if self.kind == "slide" else gap, turn)


@dataclass(frozen=True)
class JointCurve:
    """A joint that follows another along a polynomial, or stands still where no joint leads:

        e = (y - y0) - sum_k c_k (x - x0)^k = 0

    Attributes:
        name: of the loop.
        follower, leader: names of joints with one coordinate each, y and x; no leader: x = x0.
        coefficients: c_0, c_1, ... [of the follower's unit and powers of the leader's].
        origin: (y0, x0).
    """

    name: str
    follower: str
    leader: str | None
    coefficients: tuple[float, ...]
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        validation.name("JointCurve.name", self.name)
        if self.follower == self.leader:
            raise RangeError("JointCurve.leader", self.leader, "a joint does not follow itself")
        numbers = validation.real_array("JointCurve.coefficients", self.coefficients).reshape(-1)
        object.__setattr__(self, "coefficients", tuple(numbers.tolist()))
        object.__setattr__(
            self, "origin", tuple(validation.real_array("JointCurve.origin", self.origin, (2,)).tolist())
        )

    @property
    def labels(self) -> tuple[str, ...]:
        """That of its one row."""
        return (self.follower,)

    def error(self, kin: Tracer, still: bool = False) -> ca.SX:
        """e of the class, one row, which nothing turns.

        Raises:
            UnknownNameError: no such joint with one coordinate.
        """
        x = ca.SX(0.0) if self.leader is None else kin.joint(self.leader) - self.origin[1]
        curve = ca.SX(0.0)
        for coefficient in reversed(self.coefficients):
            curve = curve * x + coefficient
        return kin.joint(self.follower) - self.origin[0] - curve


AnyLoop = Loop | JointCurve


@dataclass(frozen=True)
class Linkage:
    """Loops that share joints.

    Attributes:
        loops: their names.
        rows: places of their rows among those of all loops.
        dofs: degrees of freedom that move them. Indices into v.
        held: how many of the rows are independent at closed configurations like any other.
    """

    loops: tuple[str, ...]
    rows: tuple[int, ...]
    dofs: tuple[int, ...]
    held: int

    @property
    def name(self) -> str:
        """Those of the loops."""
        return ", ".join(self.loops)


@dataclass(frozen=True, eq=False)
class LoopRows:
    """What keeps the loops of a robot closed.

    Attributes:
        loops: in the order of their rows.
        bases: of each loop the directions of its residual that no other row has, rows x residual.
        rows: label and unit of each row; one that mixes several is named by the largest of them that no other row has.
        moved: of each loop the degrees of freedom that move it. Indices into v.
        held: of each linkage how many of its rows are independent at closed configurations; empty: not known.
    """

    loops: tuple[AnyLoop, ...] = ()
    bases: tuple[Array, ...] = ()
    rows: tuple[tuple[str, str], ...] = ()
    moved: tuple[tuple[int, ...], ...] = ()
    held: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.loops)

    @property
    def names(self) -> str:
        """Those of the loops, for a sentence."""
        return ", ".join(loop.name for loop in self.loops)

    @cached_property
    def linkages(self) -> tuple[Linkage, ...]:
        """Loops with rows, those that share joints together."""
        ends = np.cumsum([0, *(len(basis) for basis in self.bases)]).tolist()
        out = list[Linkage]()
        for loop, (first, end), moved in zip(self.loops, itertools.pairwise(ends), self.moved, strict=True):
            if first == end:
                continue
            parts = [part for part in out if {*part.dofs} & {*moved}]
            out = [part for part in out if part not in parts]
            names = itertools.chain.from_iterable(part.loops for part in parts)
            rows = itertools.chain.from_iterable(part.rows for part in parts)
            dofs = {*moved}.union(*(part.dofs for part in parts))
            every = (*rows, *range(first, end))
            out.append(Linkage((*names, loop.name), every, tuple(sorted(dofs)), len(every)))
        return (
            tuple(replace(part, held=count) for part, count in zip(out, self.held, strict=True))
            if self.held
            else (*out,)
        )

    def moving(self, matrix: ca.SX) -> ca.SX:
        """The entries of a Jacobian of the rows that are not 0 in every configuration [rows, nv]."""
        out = ca.SX(*matrix.shape)
        for linkage in self.linkages:
            out[list(linkage.rows), list(linkage.dofs)] = matrix[list(linkage.rows), list(linkage.dofs)]
        return ca.sparsify(out)

    def error(self, kin: Tracer, still: bool = False) -> ca.SX:
        """Residuals of all rows [m, rad]; ``still``: see :meth:`Loop.error`."""
        parts = [ca.DM(basis) @ loop.error(kin, still) for loop, basis in zip(self.loops, self.bases, strict=True)]
        return ca.SX(ca.vertcat(*parts))


class Closing:
    """Newton's shortest steps towards configurations at which loops are closed.

    Args:
        model: the robot's. loops: its loops. limits: whose positions the configurations keep. index: in q of the
            coordinate of each degree of freedom, -1 for none.
    """

    def __init__(self, model: pin.Model, loops: Sequence[AnyLoop], limits: Limits, index: Array) -> None:
        self._model, self._loops = model, loops
        self._steps = ShortestSteps(
            self.look,
            lambda q, step: np.asarray(pin.normalize(model, pin.integrate(model, q, step))),
            index,
            limits.position_lower,
            limits.position_upper,
        )
        kin = Tracer(Kinematics(model))
        error = ca.SX(ca.vertcat(*[loop.error(kin) for loop in loops]))
        outputs = [ca.densify(part) for part in kin.expanded(error, ca.densify(kin.slope(error)))]
        self._function = SingleState(ca.Function("loops", [kin.q], outputs))

    def look(self, q: Array) -> tuple[Array, Array]:
        """(residual [rows], its Jacobian [rows, nv])."""
        error, jacobian = self._function(q)
        return error[:, 0], jacobian

    def close(self, q: Array) -> tuple[Array, float]:
        """As :meth:`ShortestSteps.root`: (configuration, what its loops are open by there [m, rad])."""
        return self._steps.root(q)

    def gaps(self, q: Array) -> dict[str, float]:
        """What each loop is open by [m, rad], but for what no joint moves, see :meth:`ShortestSteps.unmoved`."""
        error, jacobian = self.look(q)
        rest = np.abs(error - self._steps.unmoved(error, jacobian))
        return {loop.name: float(rest[rows].max()) for loop, rows in zip(self._loops, self.spans, strict=True)}

    def first(self, starts: Iterable[Array]) -> Array:
        """The first of the configurations that searches lead to that closes the loops.

        Raises:
            LoopError: none does; which loop is open most, and by how much, at the nearest.
        """
        nearest: tuple[Array, float] = np.zeros(0), np.inf
        for start in starts:
            found = self.close(start)
            if found[1] <= CLOSED:
                return found[0]
            nearest = min(nearest, found, key=lambda one: one[1])
        opened = self.gaps(nearest[0])
        worst = max(opened, key=lambda name: opened[name])
        reason = f"no configuration was found that closes it with the others; open by {opened[worst]:.3g} m or rad"
        reason += f" at the nearest, q = {np.array2string(nearest[0], precision=4)}"
        if beyond := self._beyond(nearest[0]):
            reason += f"; one beyond the position limits of {', '.join(beyond)} does"
        raise LoopError("loops", worst, reason)

    def _beyond(self, q: Array) -> list[str]:
        """Joints beyond their position limits where the loops are closed without any; none: they are not."""
        q, opened = replace(self._steps, lower=-self._steps.endless, upper=self._steps.endless).root(q)
        joints = {int(self._model.idx_qs[j]): str(self._model.names[j]) for j in range(1, self._model.njoints)}
        return [joints[at] for at in self._steps.outside(q)] if opened <= CLOSED else []

    @property
    def spans(self) -> list[slice]:
        """The rows of each loop."""
        ends = np.cumsum([0, *(len(loop.labels) for loop in self._loops)]).tolist()
        return [slice(first, end) for first, end in itertools.pairwise(ends)]

    def rows(self, count: int, looks: Sequence[Array], units: Mapping[str, str]) -> LoopRows:
        """The first ``count`` loops with the directions that are independent at some configurations; ``units``: of the
        joints' coordinates.
        """
        jacobians = np.array([self.look(q)[1] for q in looks])
        bases = independent(self.spans[:count], jacobians)
        sizes = np.abs(jacobians).max(axis=0)
        moved = [
            np.flatnonzero(sizes[span].max(axis=0) > STILL * sizes.max(initial=0.0)) for span in self.spans[:count]
        ]
        rows = []
        for loop, basis in zip(self._loops, bases, strict=False):
            for label in _labels(basis, loop.labels):
                turns = label.startswith("r")
                unit = units[loop.follower] if isinstance(loop, JointCurve) else "rad" if turns else "m"
                rows.append((f"{loop.name}.{label}", unit))
        made = LoopRows(tuple(self._loops[:count]), bases, tuple(rows), tuple(tuple(dofs.tolist()) for dofs in moved))
        kept = [
            np.concatenate([basis @ each[span] for basis, span in zip(bases, self.spans, strict=False)])
            for each in jacobians
        ]
        held = (max(rank(each[np.ix_(part.rows, part.dofs)]) for each in kept) for part in made.linkages)
        return replace(made, held=tuple(held))


def _labels(basis: Array, labels: Sequence[str]) -> list[str]:
    """Of each row the label of its largest entry that no row before has."""
    left = np.abs(basis)
    out = list[str]()
    for row in left:
        k = int(row.argmax())
        out.append(labels[k])
        left[:, k] = -1.0
    return out


def rank(jacobian: Array) -> int:
    """How many rows are independent by :data:`~wbc.robot.shortest_steps.DEPENDENT`."""
    sizes = np.linalg.svd(jacobian)[1]
    return int((sizes > DEPENDENT * sizes.max(initial=0.0)).sum())


def independent(parts: Sequence[slice], jacobians: Array) -> tuple[Array, ...]:
    """Orthonormal directions of each residual that are independent of those before.

    Args:
        parts: the rows of each loop. jacobians: of all residuals at several configurations [looks, rows, nv].

    A direction of a residual that moves with no joint, or as one combination of rows before it at every configuration,
    is left out: of a planar mechanism what points out of its plane.
    """
    wide = np.concatenate(list(jacobians), axis=1)
    least = DEPENDENT * max(1.0, float(np.abs(wide).max(initial=0.0))) * np.sqrt(len(jacobians))
    known, out = np.zeros((0, wide.shape[1])), list[Array]()
    for rows in parts:
        own = wide[rows]
        rest = own - own @ np.linalg.pinv(known) @ known if len(known) else own
        left, sizes, _ = np.linalg.svd(rest)
        basis = _straightened(left.T[: int((sizes > least).sum())])
        out.append(basis)
        known = np.concatenate([known, basis @ own])
    return tuple(out)


def _straightened(basis: Array) -> Array:
    """The same directions, with axes among them where they span some."""
    span = basis.T @ basis
    axes = np.eye(len(span))[np.diag(span) > 1.0 - 1e-12]
    rest = basis - basis @ axes.T @ axes
    return np.concatenate([axes, np.linalg.svd(rest)[2][: len(basis) - len(axes)]]) if len(basis) else basis
