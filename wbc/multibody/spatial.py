"""Poses, twists, inertias and quaternions with the attributes of Pinocchio's that this package and its users read."""

from __future__ import annotations

import math
from typing import Any, TypeVar, overload

import numpy as np

from wbc.multibody import rotations as turns
from wbc.multibody.rotations import Array, skew, vector

#: Relative difference of what is approximately equal
ALIKE = 1e-12

T = TypeVar("T")

_drawn: list[np.random.Generator] = []


def seed(number: int) -> None:
    """Random poses and twists are the same again after the same number."""
    _drawn[:] = [np.random.default_rng(number)]


def _generator() -> np.random.Generator:
    """Made when it is first asked for: its module takes as long to import as some of this package's rooms."""
    if not _drawn:
        _drawn.append(np.random.default_rng())
    return _drawn[0]


class LikePinocchio:
    """A value with some of the attributes of Pinocchio's of the same name; one that is asked for another says so."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        reason = f"{name} of a {type(self).__name__} is Pinocchio's and needs this package: pip install pin"
        raise AttributeError(reason, name=name, obj=self)


class Copied(LikePinocchio):
    """A value of numbers and arrays, whose copy by ``copy.deepcopy`` is that of its own ``copy``."""

    __slots__ = ()

    def __deepcopy__(self, memo: Any) -> Any:
        return self.copy()


def shallow(thing: T) -> T:
    """A copy of an object that shares what it has; ``copy.copy`` takes five times as long."""
    out: T = object.__new__(type(thing))
    vars(out).update(vars(thing))
    return out


class SE3(Copied):
    """A pose (R, p), which takes x to R x + p.

    ``SE3(rotation, translation)`` of a matrix or a :class:`Quaternion`, ``SE3(homogeneous)``, or a copy of a pose.

    Raises:
        ValueError: numbers that are no pose by their count.
    """

    __slots__ = ("_rotation", "_translation")
    _rotation: Array
    _translation: Array

    def __init__(self, first: Any = None, translation: Any = None) -> None:
        if first is None:
            # A state has one for each joint and frame
            self._rotation, self._translation = np.eye(3), np.zeros(3)
            return
        if isinstance(first, SE3):
            first, translation = first._rotation, first._translation
        elif isinstance(first, Quaternion):
            first = first.matrix()
        elif translation is None:
            whole = vector(getattr(first, "homogeneous", first), 16).reshape(4, 4)
            first, translation = whole[:3, :3], whole[:3, 3]
        self._rotation = vector(first, 9).reshape(3, 3)
        self._translation = vector(translation, 3)

    @staticmethod
    def Identity() -> SE3:
        """No turn and no shift."""
        return SE3()

    @staticmethod
    def Random() -> SE3:
        """A random turn, and a shift of at most 1 m along each axis; see :func:`seed`."""
        q = _generator().normal(size=4)
        return SE3(turns.quaternion_matrix(q / np.linalg.norm(q)), _generator().uniform(-1.0, 1.0, 3))

    @staticmethod
    def Interpolate(first: SE3, last: SE3, share: float) -> SE3:
        """exp6(share log6(first^-1 last)) from the first pose."""
        step: SE3 = first * exp6(log6(first.actInv(last)) * share)
        return step

    @property
    def rotation(self) -> Array:
        """R; what is written into it changes the pose."""
        return self._rotation

    @rotation.setter
    def rotation(self, value: Any) -> None:
        self._rotation[:] = value

    @property
    def translation(self) -> Array:
        """p [m]; what is written into it changes the pose."""
        return self._translation

    @translation.setter
    def translation(self, value: Any) -> None:
        self._translation[:] = value

    @property
    def homogeneous(self) -> Array:
        """The 4 x 4 matrix."""
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = self._rotation, self._translation
        return out

    @property
    def action(self) -> Array:
        """The 6 x 6 matrix that takes a twist (linear; angular) stated in the pose's frame to where the pose is."""
        out = np.zeros((6, 6))
        out[:3, :3] = out[3:, 3:] = self._rotation
        out[:3, 3:] = skew(self._translation) @ self._rotation
        return out

    def inverse(self) -> SE3:
        """The pose that takes R x + p to x."""
        return _pose(self._rotation.T.copy(), -(self._translation @ self._rotation))

    def assign(self, other: SE3) -> None:
        """Become equal to another pose, in place."""
        self._rotation[:], self._translation[:] = other._rotation, other._translation

    def copy(self) -> SE3:
        """A pose of its own."""
        return _pose(self._rotation.copy(), self._translation.copy())

    def act(self, other: Any) -> Any:
        """A pose, twist, inertia or point that is stated in this pose's frame, where this pose is.

        Raises:
            ValueError: something else.
        """
        if isinstance(other, SE3):
            return self * other
        if isinstance(other, SpatialMotion):
            angular = self._rotation @ other.angular
            return SpatialMotion(self._rotation @ other.linear + np.cross(self._translation, angular), angular)
        if isinstance(other, Inertia):
            turned = self._rotation @ other.inertia @ self._rotation.T
            return Inertia(other.mass, self._rotation @ other.lever + self._translation, turned)
        if hasattr(other, "homogeneous"):
            # Pinocchio's
            return self * SE3(other)
        return self._rotation @ vector(other, 3) + self._translation

    def actInv(self, other: Any) -> Any:
        """As :meth:`act` of :meth:`inverse`."""
        if isinstance(other, SE3):
            back = self._rotation.T
            return _pose(back @ other._rotation, back @ (other._translation - self._translation))
        return self.inverse().act(other)

    @overload
    def __mul__(self, other: SE3) -> SE3: ...

    @overload
    def __mul__(self, other: Any) -> Any: ...

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, SE3):
            place = self._rotation @ other._translation + self._translation
            return _pose(self._rotation @ other._rotation, place)
        return self.act(other)

    def isApprox(self, other: SE3, prec: float = ALIKE) -> bool:
        """Whether both are the same up to rounding."""
        return _alike(self._rotation, other._rotation, prec) and _alike(self._translation, other._translation, prec)

    def isIdentity(self, prec: float = ALIKE) -> bool:
        """Whether it neither turns nor shifts."""
        return self.isApprox(SE3(), prec)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SE3) and np.array_equal(self.homogeneous, other.homogeneous)

    __hash__ = None  # type: ignore[assignment]  # as it can be written into

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.asarray(self.homogeneous, dtype=dtype)

    def __repr__(self) -> str:
        return f"SE3(\n{self.homogeneous}\n)"

    def __reduce__(self) -> Any:
        return SE3, (self._rotation, self._translation)


def _pose(rotation: Array, translation: Array) -> SE3:
    """Of arrays that nobody else has."""
    out = SE3.__new__(SE3)
    out._rotation, out._translation = rotation, translation
    return out


def _alike(a: Array, b: Array, prec: float) -> bool:
    return bool(np.linalg.norm(a - b) <= prec * max(1.0, min(float(np.linalg.norm(a)), float(np.linalg.norm(b)))))


class SpatialMotion(Copied):
    """A twist (linear; angular) [m/s, rad/s], or its rate, of two vectors or of six numbers."""

    __slots__ = ("vector",)
    vector: Array

    def __init__(self, first: Any = None, angular: Any = None) -> None:
        if isinstance(first, SpatialMotion):
            first = first.vector
        elif angular is not None:
            first = np.concatenate([vector(first, 3), vector(angular, 3)])
        self.vector = np.zeros(6) if first is None else vector(first, 6)

    @staticmethod
    def Zero() -> SpatialMotion:
        """No motion."""
        return SpatialMotion()

    @staticmethod
    def Random() -> SpatialMotion:
        """Numbers of at most 1; see :func:`seed`."""
        return SpatialMotion(_generator().uniform(-1.0, 1.0, 6))

    @property
    def linear(self) -> Array:
        """Its first three numbers; what is written into them changes it."""
        return self.vector[:3]

    @linear.setter
    def linear(self, value: Any) -> None:
        self.vector[:3] = value

    @property
    def angular(self) -> Array:
        """Its last three numbers; what is written into them changes it."""
        return self.vector[3:]

    @angular.setter
    def angular(self, value: Any) -> None:
        self.vector[3:] = value

    @property
    def np(self) -> Array:
        """As :attr:`vector`."""
        return self.vector

    def copy(self) -> SpatialMotion:
        """A twist of its own."""
        return SpatialMotion(self.vector)

    def cross(self, other: SpatialMotion) -> SpatialMotion:
        """(w x v' + v x w'; w x w')."""
        linear = np.cross(self.angular, other.linear) + np.cross(self.linear, other.angular)
        return SpatialMotion(linear, np.cross(self.angular, other.angular))

    def __add__(self, other: SpatialMotion) -> SpatialMotion:
        return SpatialMotion(self.vector + other.vector)

    def __sub__(self, other: SpatialMotion) -> SpatialMotion:
        return SpatialMotion(self.vector - other.vector)

    def __neg__(self) -> SpatialMotion:
        return SpatialMotion(-self.vector)

    def __mul__(self, factor: float) -> SpatialMotion:
        return SpatialMotion(self.vector * factor)

    __rmul__ = __mul__

    def __truediv__(self, factor: float) -> SpatialMotion:
        return SpatialMotion(self.vector / factor)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SpatialMotion) and np.array_equal(self.vector, other.vector)

    __hash__ = None  # type: ignore[assignment]  # as it can be written into

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.vector, dtype=dtype)

    def __repr__(self) -> str:
        return f"Motion(linear={self.linear}, angular={self.angular})"

    def __reduce__(self) -> Any:
        return SpatialMotion, (self.vector,)


class Inertia(Copied):
    """A body's mass [kg], centre of mass [m] and moments about that [kg m^2]; ``Inertia(mass, lever, inertia)``.

    Raises:
        ValueError: numbers that are no inertia by their count.
    """

    __slots__ = ("inertia", "lever", "mass")
    mass: float
    lever: Array
    inertia: Array

    def __init__(self, mass: Any = 0.0, lever: Any = (0.0, 0.0, 0.0), inertia: Any = None) -> None:
        if isinstance(mass, Inertia):
            mass, lever, inertia = mass.mass, mass.lever, mass.inertia
        self.mass = float(mass)
        self.lever = vector(lever, 3)
        self.inertia = np.zeros((3, 3)) if inertia is None else vector(inertia, 9).reshape(3, 3)

    @staticmethod
    def Zero() -> Inertia:
        """Of no body."""
        return Inertia()

    @staticmethod
    def Random() -> Inertia:
        """Of an ellipsoid somewhere; see :func:`seed`."""
        mass, *axes = _generator().uniform(0.1, 1.0, 4)
        moved: Inertia = SE3.Random().act(Inertia.FromEllipsoid(mass, *axes))
        return moved

    @staticmethod
    def FromBox(mass: float, x: float, y: float, z: float) -> Inertia:
        """Of a box: m (y^2 + z^2) / 12 about x."""
        return _of_moments(mass, *(mass * (a * a + b * b) / 12.0 for a, b in ((y, z), (x, z), (x, y))))

    @staticmethod
    def FromSphere(mass: float, radius: float) -> Inertia:
        """Of a ball: 2/5 m r^2."""
        return Inertia.FromEllipsoid(mass, radius, radius, radius)

    @staticmethod
    def FromEllipsoid(mass: float, x: float, y: float, z: float) -> Inertia:
        """Of an ellipsoid of these semi-axes: m (y^2 + z^2) / 5 about x."""
        return _of_moments(mass, *(mass * (a * a + b * b) / 5.0 for a, b in ((y, z), (x, z), (x, y))))

    @staticmethod
    def FromCylinder(mass: float, radius: float, length: float) -> Inertia:
        """Of a cylinder about z: m r^2 / 2 about it, m (3 r^2 + l^2) / 12 across."""
        across = mass * (3.0 * radius * radius + length * length) / 12.0
        return _of_moments(mass, across, across, 0.5 * mass * radius * radius)

    @staticmethod
    def FromCapsule(mass: float, radius: float, height: float) -> Inertia:
        """Of a cylinder about z with half a ball at each end, of one density."""
        share = 3.0 * height / (3.0 * height + 4.0 * radius)
        middle, balls, square = mass * share, mass * (1.0 - share), radius * radius
        # Half a ball: its centre of mass is 3/8 r from the flat face
        across = middle * (3.0 * square + height * height) / 12.0
        across += balls * (0.4 * square + 0.25 * height * height + 0.375 * radius * height)
        return _of_moments(mass, across, across, 0.5 * middle * square + 0.4 * balls * square)

    @staticmethod
    def FromDynamicParameters(numbers: Any) -> Inertia:
        """Of m, m c and the moments xx, xy, yy, xz, yz, zz about the origin."""
        phi = vector(numbers, 10)
        xx, xy, yy, xz, yz, zz = phi[4:]
        mass, lever = float(phi[0]), phi[1:4] / phi[0]
        return Inertia(mass, lever, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - _steiner(mass, lever))

    def toDynamicParameters(self) -> Array:
        """As of :meth:`FromDynamicParameters`."""
        about = self.inertia + _steiner(self.mass, self.lever)
        moments = about[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
        return np.concatenate([[self.mass], self.mass * self.lever, moments])

    def matrix(self) -> Array:
        """The 6 x 6 matrix that takes a twist at the origin to the momentum there."""
        out, lever = np.zeros((6, 6)), self.mass * skew(self.lever)
        out[:3, :3] = self.mass * np.eye(3)
        out[:3, 3:], out[3:, :3] = -lever, lever
        out[3:, 3:] = self.inertia + _steiner(self.mass, self.lever)
        return out

    def copy(self) -> Inertia:
        """An inertia of its own."""
        out = Inertia.__new__(Inertia)
        out.mass, out.lever, out.inertia = self.mass, self.lever.copy(), self.inertia.copy()
        return out

    def isZero(self) -> bool:
        """Whether it is that of no body, wherever its centre is."""
        return self.mass == 0.0 and not self.inertia.any()

    def __add__(self, other: Inertia) -> Inertia:
        mass = self.mass + other.mass
        # As Pinocchio does where there is no mass
        weight = 1.0 / max(mass, float(np.finfo(np.float64).eps))
        if other.isZero():
            return Inertia(mass, (self.mass * self.lever + 0.0) * weight, self.inertia + 0.0)
        gap = self.lever - other.lever
        inertia = self.inertia + other.inertia + _steiner(self.mass * other.mass * weight, gap)
        return Inertia(mass, (self.mass * self.lever + other.mass * other.lever) * weight, inertia)

    def isApprox(self, other: Inertia, prec: float = ALIKE) -> bool:
        """Whether both are the same up to rounding."""
        pairs = ((np.array([self.mass]), np.array([other.mass])), (self.lever, other.lever))
        return all(_alike(a, b, prec) for a, b in (*pairs, (self.inertia, other.inertia)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Inertia):
            return False
        same = self.mass == other.mass and np.array_equal(self.lever, other.lever)
        return same and np.array_equal(self.inertia, other.inertia)

    __hash__ = None  # type: ignore[assignment]  # as it can be written into

    def __repr__(self) -> str:
        return f"Inertia(mass={self.mass}, lever={self.lever}, inertia=\n{self.inertia}\n)"

    def __reduce__(self) -> Any:
        return Inertia, (self.mass, self.lever, self.inertia)


def _steiner(mass: float, lever: Array) -> Array:
    """m (c'c 1 - c c'): what moments are more by about a point that is c away."""
    return np.asarray(mass * (float(lever @ lever) * np.eye(3) - np.outer(lever, lever)))


def _of_moments(mass: float, x: float, y: float, z: float) -> Inertia:
    return Inertia(mass, np.zeros(3), np.diag([x, y, z]))


class Quaternion(LikePinocchio):
    """Of ``Quaternion(w, x, y, z)``, of four numbers x, y, z, w in an array, or of a rotation matrix.

    Raises:
        ValueError: numbers that are none of these by their count.
    """

    __slots__ = ("_numbers",)

    def __init__(self, *numbers: Any) -> None:
        if len(numbers) == 4:
            self._numbers = vector([*numbers[1:], numbers[0]], 4)
        elif np.size(numbers[0]) == 9:
            self._numbers = turns.matrix_quaternion(numbers[0])
        else:
            self._numbers = vector(numbers[0], 4)

    @staticmethod
    def FromTwoVectors(a: Any, b: Any) -> Quaternion:
        """The least turn that takes the direction of a to that of b."""
        return Quaternion(turns.least_turn(a, b))

    @property
    def x(self) -> float:
        """Its first number."""
        return float(self._numbers[0])

    @property
    def y(self) -> float:
        """Its second number."""
        return float(self._numbers[1])

    @property
    def z(self) -> float:
        """Its third number."""
        return float(self._numbers[2])

    @property
    def w(self) -> float:
        """Its real part."""
        return float(self._numbers[3])

    def coeffs(self) -> Array:
        """x, y, z, w."""
        return self._numbers.copy()

    def matrix(self) -> Array:
        """The rotation matrix."""
        return turns.quaternion_matrix(self._numbers)

    toRotationMatrix = matrix

    def normalized(self) -> Quaternion:
        """The one of length 1."""
        return Quaternion(self._numbers / np.linalg.norm(self._numbers))

    def normalize(self) -> None:
        """Make its length 1."""
        self._numbers /= np.linalg.norm(self._numbers)

    def inverse(self) -> Quaternion:
        """The one that turns back."""
        return Quaternion(self._numbers * [-1.0, -1.0, -1.0, 1.0] / float(self._numbers @ self._numbers))

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Quaternion):
            return Quaternion(turns.product(self._numbers, other._numbers))
        return self.matrix() @ vector(other, 3)


class AngleAxis:
    """A turn by an angle [rad] about a unit vector."""

    def __init__(self, angle: float, axis: Any) -> None:
        self.angle, self.axis = float(angle), vector(axis, 3)

    def matrix(self) -> Array:
        """The rotation matrix."""
        return turns.turn_about(self.axis, math.cos(self.angle), math.sin(self.angle))

    toRotationMatrix = matrix


def exp6(twist: Any) -> SE3:
    """The pose after unit time at a constant twist in its own frame."""
    numbers = twist.vector if isinstance(twist, SpatialMotion) else vector(twist, 6)
    return _pose(turns.exp3(numbers[3:]), turns.left_jacobian(numbers[3:]) @ numbers[:3])


def log6(pose: Any) -> SpatialMotion:
    """The twist that leads to a pose in unit time, at most a half turn."""
    placed = pose if isinstance(pose, SE3) else SE3(pose)
    turn = turns.log3(placed.rotation)
    return SpatialMotion(turns.left_jacobian_inverse(turn) @ placed.translation, turn)


def Jexp6(twist: Any) -> Array:
    """J with exp6(x + d) = exp6(x) exp6(J(x) d), to first order in d: the integral of Ad(exp6(-s x)), s in 0 to 1."""
    numbers = -(twist.vector if isinstance(twist, SpatialMotion) else vector(twist, 6))
    v, w = skew(numbers[:3]), skew(numbers[3:])
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = turns.left_jacobian(numbers[3:])
    angle = float(np.linalg.norm(numbers[3:]))
    a, b, c = _third_shares(angle)
    wv, vw, wvw = w @ v, v @ w, w @ v @ w
    mixed = 0.5 * v + a * (wv + vw + wvw) + b * (w @ wv + vw @ w - 3.0 * wvw) + c * (wvw @ w + w @ wvw)
    out[:3, 3:] = mixed
    return out


def _third_shares(angle: float) -> tuple[float, float, float]:
    """Factors of the mixed block (Barfoot, State Estimation for Robotics, 2017, eq. 7.86)."""
    t = angle * angle
    if angle < 0.05:
        return (
            1.0 / 6.0 - t / 120.0 + t * t / 5040.0,
            1.0 / 24.0 - t / 720.0 + t * t / 40320.0,
            1.0 / 120.0 - t / 2520.0 + t * t / 120960.0,
        )
    sine, cosine = math.sin(angle), math.cos(angle)
    return (
        (angle - sine) / angle**3,
        (t + 2.0 * cosine - 2.0) / (2.0 * t * t),
        (2.0 * angle - 3.0 * sine + angle * cosine) / (2.0 * angle**5),
    )


def XYZQUATToSE3(numbers: Any) -> SE3:
    """The pose of x, y, z [m] and a quaternion x, y, z, w."""
    seven = vector(numbers, 7)
    return SE3(turns.quaternion_matrix(seven[3:]), seven[:3])


def SE3ToXYZQUAT(pose: SE3) -> Array:
    """x, y, z [m] and a quaternion x, y, z, w of a pose."""
    return np.concatenate([pose.translation, turns.matrix_quaternion(pose.rotation)])
