"""Joints of a tree: placements, motion axes, and the algebra of their coordinates, as Pinocchio has them.

q holds an angle, a shift, (cos, sin) of an endless turn, a quaternion x, y, z, w, (x, y, cos, sin), or x, y, z and a
quaternion; v is the twist of the child side in its own axes, in the directions that the joint leaves free.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from wbc.multibody import rotations as turns
from wbc.multibody.rotations import Array, vector
from wbc.multibody.spatial import SE3, Copied, SpatialMotion, exp6, log6, shallow

_PREFIX = "JointModel"


class JointModel(Copied):
    """A joint; ``idx_q`` and ``idx_v`` say where its numbers begin in q and v once a model has it.

    Attributes:
        nq, nv: numbers in q and v. S: motion axes, 6 x nv (linear; angular). neutral: its numbers in the neutral q.
        id: its number in the model.
    """

    nq = 0
    nv = 0

    def __init__(self, name: str = "") -> None:
        self._name = name
        self.id = self.idx_q = self.idx_v = -1
        self.S = np.zeros((6, self.nv))
        self.neutral = np.zeros(self.nq)

    def shortname(self) -> str:
        """The name of its kind, as Pinocchio has it."""
        return _PREFIX + self._name

    def copy(self) -> JointModel:
        """A joint of its own."""
        out = shallow(self)
        out.S, out.neutral = self.S.copy(), self.neutral.copy()
        return out

    def extract(self) -> JointModel:
        """The joint itself."""
        return self

    def createData(self) -> JointData:
        """What :meth:`calc` writes to."""
        return JointData(self.S.copy())

    def calc(self, data: JointData, q: Any) -> None:
        """Writes the placement at a whole q."""
        data.M = self.placement(np.asarray(q, dtype=np.float64)[self.idx_q : self.idx_q + self.nq])

    def placement(self, q: Array) -> SE3:
        """Pose of the child side in the parent side."""
        return SE3()

    def integrate(self, q: Array, v: Array) -> Array:
        """q (+) v: the coordinates after unit time at a constant velocity."""
        return np.asarray(q + v)

    def difference(self, q: Array, later: Array) -> Array:
        """The least v with q (+) v = later."""
        return np.asarray(later - q)

    def normalize(self, q: Array) -> Array:
        """The coordinates with turns of unit length; the neutral ones of a turn of length 0."""
        return q

    def unit_error(self, q: Array) -> float:
        """How far the length of a turn's numbers is from 1."""
        return 0.0


class JointData:
    """The motion axes of a joint, and its placement."""

    def __init__(self, axes: Array) -> None:
        self.S, self.M = axes, SE3()


class _OneAxis(JointModel):
    """About or along a unit vector."""

    nq = nv = 1

    def __init__(self, name: str, axis: Any) -> None:
        super().__init__(name)
        self.axis = vector(axis, 3)


class Revolute(_OneAxis):
    """A turn by q."""

    def __init__(self, name: str, axis: Any) -> None:
        super().__init__(name, axis)
        self.S[3:, 0] = self.axis

    def placement(self, q: Array) -> SE3:
        angle = float(q[0])
        return SE3(turns.turn_about(self.axis, math.cos(angle), math.sin(angle)), np.zeros(3))


class Prismatic(_OneAxis):
    """A shift by q."""

    def __init__(self, name: str, axis: Any) -> None:
        super().__init__(name, axis)
        self.S[:3, 0] = self.axis

    def placement(self, q: Array) -> SE3:
        return SE3(np.eye(3), float(q[0]) * self.axis)


def _turned(unit: Array, angle: float) -> list[float]:
    """(cos, sin) turned on, of unit length up to rounding where they were before."""
    c, s = float(unit[0]), float(unit[1])
    cosine, sine = math.cos(angle), math.sin(angle)
    out = c * cosine - s * sine, s * cosine + c * sine
    scale = 0.5 * (3.0 - out[0] * out[0] - out[1] * out[1])
    return [scale * out[0], scale * out[1]]


def _angle(unit: Array, later: Array) -> float:
    """The turn from one (cos, sin) to another, at most a half turn."""
    return math.atan2(unit[0] * later[1] - unit[1] * later[0], unit[0] * later[0] + unit[1] * later[1])


def _unit(numbers: Array, neutral: Array) -> Array:
    length = float(np.linalg.norm(numbers))
    return np.asarray(numbers / length) if length > 0.0 else neutral.copy()


class Unbounded(Revolute):
    """A turn with coordinates (cos, sin)."""

    nq = 2

    def __init__(self, name: str, axis: Any) -> None:
        super().__init__(name, axis)
        self.neutral = np.array([1.0, 0.0])

    def placement(self, q: Array) -> SE3:
        return SE3(turns.turn_about(self.axis, float(q[0]), float(q[1])), np.zeros(3))

    def integrate(self, q: Array, v: Array) -> Array:
        return np.array(_turned(q, float(v[0])))

    def difference(self, q: Array, later: Array) -> Array:
        return np.array([_angle(q, later)])

    def normalize(self, q: Array) -> Array:
        return _unit(q, self.neutral)

    def unit_error(self, q: Array) -> float:
        return abs(math.sqrt(float(q @ q)) - 1.0)


class Spherical(JointModel):
    """A free turn: a quaternion."""

    nq, nv = 4, 3

    def __init__(self) -> None:
        super().__init__("Spherical")
        self.S[3:] = np.eye(3)
        self.neutral = np.array([0.0, 0.0, 0.0, 1.0])

    def placement(self, q: Array) -> SE3:
        return SE3(turns.quaternion_matrix(q), np.zeros(3))

    def integrate(self, q: Array, v: Array) -> Array:
        return _near(turns.product(q, turns.quaternion_exp(v)), q)

    def difference(self, q: Array, later: Array) -> Array:
        return turns.quaternion_log(turns.product(q * [-1.0, -1.0, -1.0, 1.0], later))

    def normalize(self, q: Array) -> Array:
        return _unit(q, self.neutral)

    def unit_error(self, q: Array) -> float:
        return abs(math.sqrt(float(q @ q)) - 1.0)


def _near(q: Array, before: Array) -> Array:
    """Of both quaternions of a turn the one near another, of unit length up to rounding where that one was."""
    scale = 0.5 * (3.0 - float(q @ q))
    return np.asarray(q * (scale if float(q @ before) >= 0.0 else -scale))


class FreeFlyer(JointModel):
    """A body that nothing holds: x, y, z and a quaternion."""

    nq, nv = 7, 6

    def __init__(self) -> None:
        super().__init__("FreeFlyer")
        self.S = np.eye(6)
        self.neutral = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])

    def placement(self, q: Array) -> SE3:
        return SE3(turns.quaternion_matrix(q[3:]), q[:3])

    def integrate(self, q: Array, v: Array) -> Array:
        moved = q[:3] + turns.quaternion_matrix(q[3:]) @ (turns.left_jacobian(v[3:]) @ v[:3])
        return np.concatenate([moved, _near(turns.product(q[3:], turns.quaternion_exp(v[3:])), q[3:])])

    def difference(self, q: Array, later: Array) -> Array:
        turn = turns.quaternion_log(turns.product(q[3:] * [-1.0, -1.0, -1.0, 1.0], later[3:]))
        local = turns.quaternion_matrix(q[3:]).T @ (later[:3] - q[:3])
        return np.concatenate([turns.left_jacobian_inverse(turn) @ local, turn])

    def normalize(self, q: Array) -> Array:
        return np.concatenate([q[:3], _unit(q[3:], self.neutral[3:])])

    def unit_error(self, q: Array) -> float:
        return abs(math.sqrt(float(q[3:] @ q[3:])) - 1.0)


class Planar(JointModel):
    """A body on a plane across z: (x, y, cos, sin), v = (vx, vy, turn)."""

    nq, nv = 4, 3

    def __init__(self) -> None:
        super().__init__("Planar")
        self.S[0, 0] = self.S[1, 1] = self.S[5, 2] = 1.0
        self.neutral = np.array([0.0, 0.0, 1.0, 0.0])

    def placement(self, q: Array) -> SE3:
        rotation = turns.turn_about(np.array([0.0, 0.0, 1.0]), float(q[2]), float(q[3]))
        return SE3(rotation, np.array([q[0], q[1], 0.0]))

    def integrate(self, q: Array, v: Array) -> Array:
        local = exp6(SpatialMotion([v[0], v[1], 0.0, 0.0, 0.0, v[2]])).translation
        c, s = float(q[2]), float(q[3])
        shift = [c * local[0] - s * local[1], s * local[0] + c * local[1]]
        return np.array([q[0] + shift[0], q[1] + shift[1], *_turned(q[2:], float(v[2]))])

    def difference(self, q: Array, later: Array) -> Array:
        return log6(self.placement(q).actInv(self.placement(later))).vector[[0, 1, 5]]

    def normalize(self, q: Array) -> Array:
        return np.concatenate([q[:2], _unit(q[2:], self.neutral[2:])])

    def unit_error(self, q: Array) -> float:
        return abs(math.sqrt(float(q[2:] @ q[2:])) - 1.0)


def _of_axes(kind: type[_OneAxis], prefix: str) -> tuple[Any, ...]:
    return tuple(partial(kind, f"{prefix}{name}", axis) for name, axis in zip("XYZ", np.eye(3), strict=True))


def _of_any_axis(kind: type[_OneAxis], name: str, *axis: Any) -> _OneAxis:
    """About or along a direction, in an array or as three numbers."""
    direction = vector(axis[0] if len(axis) == 1 else axis, 3)
    return kind(name, direction / np.linalg.norm(direction))


JointModelRX, JointModelRY, JointModelRZ = _of_axes(Revolute, "R")
JointModelPX, JointModelPY, JointModelPZ = _of_axes(Prismatic, "P")
JointModelRUBX, JointModelRUBY, JointModelRUBZ = _of_axes(Unbounded, "RUB")
JointModelRevoluteUnaligned = partial(_of_any_axis, Revolute, "RevoluteUnaligned")
JointModelPrismaticUnaligned = partial(_of_any_axis, Prismatic, "PrismaticUnaligned")
JointModelRevoluteUnboundedUnaligned = partial(_of_any_axis, Unbounded, "RevoluteUnboundedUnaligned")
JointModelSpherical, JointModelFreeFlyer, JointModelPlanar = Spherical, FreeFlyer, Planar
