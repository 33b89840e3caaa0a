"""Arms put together from vectors: every link in axes of its own, no Denavit-Hartenberg rows.

r_ij is the vector from joint j to the centre of mass of link i, e_ij the axis of joint j as link i has it, A_i the
rotation from the axes of link i to the base. Source: the thesis, appendix A, equations A.62 to A.68.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.validation import Array

#: Sine of the angle below which a vector counts as along an axis
COLLINEAR = 1e-9


@dataclass(frozen=True, eq=False)
class Link:
    """One link, in principal axes at its centre of mass.

    Attributes:
        mass: [kg]. inertia: principal moments [3] [kg m^2]. axis, next_axis: of its joint and of the next one [3].
        lever, next_lever: r_ii and r_i,i+1, from its joint and from the next one to its centre of mass [3] [m].
        prismatic: its joint slides.
        reference, next_reference: r*, what takes the place of a lever along its axis in saying where q = 0 is.

    Raises:
        ShapeError, NotFiniteError, RangeError: a mass that is not positive, moments that no body has, no axis.
    """

    mass: float
    inertia: Array
    axis: Array
    next_axis: Array
    lever: Array
    next_lever: Array
    prismatic: bool = False
    reference: Array | None = None
    next_reference: Array | None = None

    def __post_init__(self) -> None:
        validation.scalar("mass", self.mass, low=0.0, open_low=True, unit="kg")
        inertia = validation.ordinary_array("inertia", self.inertia, (3,))
        if inertia.min() <= 0.0 or 2.0 * inertia.max() > inertia.sum() * (1.0 + 1e-12):
            raise RangeError("inertia", self.inertia, "expected positive moments, none above the sum of the others")
        object.__setattr__(self, "inertia", inertia)
        for name in ("axis", "next_axis"):
            object.__setattr__(self, name, validation.unit_vector(name, getattr(self, name)))
        for name in ("lever", "next_lever"):
            object.__setattr__(self, name, validation.ordinary_array(name, getattr(self, name), (3,)))
        for name in ("reference", "next_reference"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, validation.unit_vector(name, getattr(self, name)))


@dataclass(frozen=True, eq=False)
class SerialChain:
    """Links in series on a base.

    Attributes:
        links: from the base on. base_axis: of joint 1, in the base [3].
        base_lever: r_01, from joint 1 to the base's origin [3] [m].
        gravity: acceleration that stands for gravity, a_0, upwards [m/s^2].

    Raises:
        RangeError: a lever lies along its joint's axis and has no ``reference``.
    """

    links: tuple[Link, ...]
    base_axis: Array
    base_lever: Array
    gravity: float = 9.80621

    def __post_init__(self) -> None:
        object.__setattr__(self, "links", validation.items("links", self.links, "links"))
        object.__setattr__(self, "base_axis", validation.unit_vector("base_axis", self.base_axis))
        object.__setattr__(self, "base_lever", validation.ordinary_array("base_lever", self.base_lever, (3,)))
        validation.scalar("gravity", self.gravity)
        _ = self.assembled

    @property
    def n(self) -> int:
        """Number of links."""
        return len(self.links)

    def before(self, i: int) -> tuple[Array, Array, Array | None]:
        """Axis, lever and reference of joint i as the link before it, or the base, has them."""
        if i == 0:
            return self.base_axis, self.base_lever, None
        link = self.links[i - 1]
        return link.next_axis, link.next_lever, link.next_reference

    @cached_property
    def assembled(self) -> list[Array]:
        """A_i at q = 0, n times [3, 3]: where -r_i-1,i and r_ii agree on the plane across the axis (A.62 to A.67)."""
        out, turn = [], np.eye(3)
        for i, link in enumerate(self.links):
            axis, lever, reference = self.before(i)
            e = turn @ axis
            r = -(turn @ _across(f"base_lever or links[{i - 1}].next_lever", lever, axis, reference))
            own = _across(f"links[{i}].lever", link.lever, link.axis, link.reference)
            turn = _triad(e, r) @ _triad(link.axis, own).T
            out.append(turn)
        return out

    def place(self, q: Array) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
        """A_i [3, 3], e_i, r_ii and r_i-1,i [3] in the base, n of each, at joint positions q [n] (A.68)."""
        rotations: list[Array] = []
        axes, levers, before = [], [], []
        turned = np.eye(3)
        for i, link in enumerate(self.links):
            axis, lever, _ = self.before(i)
            last = rotations[-1] if i else turned
            e = last @ axis
            if not link.prismatic:
                turned = pin.exp3(e * q[i]) @ turned
            rotation = turned @ self.assembled[i]
            rotations.append(rotation)
            axes.append(e)
            levers.append(rotation @ link.lever + (q[i] * e if link.prismatic else 0.0))
            before.append(last @ lever)
        return rotations, axes, levers, before

    def positions(self, q: Array) -> tuple[Array, Array]:
        """Joints [n, 3] and centres of mass [n, 3] from the base's origin [m]; a sliding joint's is on its rail."""
        _, _, levers, before = self.place(q)
        joints = -np.cumsum([before[0], *(r - own for r, own in zip(before[1:], levers[:-1], strict=True))], axis=0)
        return joints, joints + np.array(levers)

    @cached_property
    def model(self) -> pin.Model:
        """The same arm for Pinocchio, by another road: joint frames at q = 0, bodies in them."""
        model = pin.Model()
        joints, centres = self.positions(np.zeros(self.n))
        _, axes, _, _ = self.place(np.zeros(self.n))
        last, at = 0, np.zeros(3)
        for i, link in enumerate(self.links):
            kind = pin.JointModelPrismaticUnaligned if link.prismatic else pin.JointModelRevoluteUnaligned
            last = model.addJoint(last, kind(axes[i]), pin.SE3(np.eye(3), joints[i] - at), f"joint{i + 1}")
            turn, at = self.assembled[i], joints[i]
            body = pin.Inertia(link.mass, centres[i] - at, turn @ np.diag(link.inertia) @ turn.T)
            model.appendBodyToJoint(last, body, pin.SE3.Identity())
        model.gravity.linear = np.array([0.0, 0.0, -self.gravity])
        return model


def _collinear(vector: Array, axis: Array) -> bool:
    return bool(np.linalg.norm(np.cross(axis, vector)) <= COLLINEAR * np.linalg.norm(vector))


def _across(field: str, vector: Array, axis: Array, reference: Array | None) -> Array:
    """Direction of a lever, or else of what stands for it, across an axis."""
    if _collinear(vector, axis):
        if reference is None or _collinear(reference, axis):
            raise RangeError(field, vector, "lies along the joint's axis: expected a reference that does not")
        vector = reference
    out = vector - (vector @ axis) * axis
    return np.asarray(out / np.linalg.norm(out))


def _triad(e: Array, r: Array) -> Array:
    return np.column_stack([e, r, np.cross(e, r)])
