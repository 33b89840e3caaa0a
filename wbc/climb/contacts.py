"""How a limb holds: which rows of its contact frame's pose are fixed, and which wrenches it can bear."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.validation import Array

#: Rows that a contact fixes: the position; position and the axis z (free about it); the whole pose
Fixed = Literal["position", "axis", "pose"]
#: Faces of the pyramid inside of Coulomb's cone: 8 leave out at most 8 % of a tangential force
FACES = 8


@dataclass(frozen=True)
class ContactKind(ABC):
    """A way to hold. The contact frame's z axis is the surface's outward normal, from the surface to the robot; its
    wrench w = (f; m) [N; N m] is what the surface exerts on the robot, in the axes and about the origin of the contact
    frame, and keeps

        A w <= b        A (rows, 6), b (rows)

    A component that the kind cannot bear at all (moments of a point) is two rows of opposite signs with b = 0.
    """

    #: Rows of the pose that are fixed while the contact is closed
    fixed: ClassVar[Fixed] = "pose"
    #: Whether the contact can pull the robot towards the surface
    pulls: ClassVar[bool] = False

    def lower(self, friction: float, share: float = 1.0, soles: float | None = None) -> Self:
        """The kind on a surface of a friction, with a share of the lower one of both and of the sole.

            PointFoot(0.6).lower(0.5, 0.8)          # PointFoot(0.4)

        Args:
            friction: of the surface [1]. share: of friction [1]. soles: of the lengths by which a sole bears moments
                [1]; None: the same.
        """
        own: float | None = getattr(self, "friction", None)
        soles = share if soles is None else soles
        if own is None or (share == soles == 1.0 and friction >= own):
            return self
        return replace(self, friction=share * min(own, friction), **self._soles(soles))  # type: ignore[call-arg]  # kinds that have it

    def _soles(self, share: float) -> dict[str, Any]:
        """Fields of a shorter sole."""
        return {}

    @property
    def height(self) -> float:
        """How far the contact frame is over a foothold that it holds, along the normal [m]."""
        return 0.0

    def held_at(self, foothold: pin.SE3) -> pin.SE3:
        """Pose of the contact frame at a foothold: ``height`` over it."""
        return foothold * pin.SE3(np.eye(3), np.array([0.0, 0.0, self.height])) if self.height else foothold

    @abstractmethod
    def cone(self) -> tuple[Array, Array]:
        """A ``(rows, 6)`` and b ``(rows)`` of the class's inequality."""


@dataclass(frozen=True)
class PointFoot(ContactKind):
    """A point on a surface with friction: |(f_x, f_y)| <= friction f_z within a pyramid of 8 faces, no moment there; or
    a ball, about whose centre the moment is (r f_y, -r f_x, 0).

    Attributes:
        friction: Coulomb's coefficient [1].
        radius: r of the ball whose centre is the contact frame's origin [m]; 0: that is the point itself.
    """

    fixed: ClassVar[Fixed] = "position"

    friction: float = 0.5
    radius: float = 0.0

    def __post_init__(self) -> None:
        validation.own_scalars(self, "friction", "radius", low=0.0, infinite=True)

    @property
    def height(self) -> float:
        """The radius."""
        return self.radius

    def cone(self) -> tuple[Array, Array]:
        """Rows: friction, normal, then no moments where it touches."""
        ties = _MOMENTS.copy()
        ties[0, 1], ties[1, 0] = -self.radius, self.radius
        return _pressing(self.friction, np.vstack([ties, -ties]))


@dataclass(frozen=True)
class FlatFoot(ContactKind):
    """A rectangle on a surface with friction: as ``PointFoot``, with its centre of pressure in the rectangle
    (|m_x| <= Y f_z, |m_y| <= X f_z), |m_z| <= friction (X + Y) / 2 f_z, and less where it is pressed near an edge,
    about which it turns, or pushed along (Caron, Pham and Nakamura, ICRA 2015), with c = friction / sqrt(2):

        |Y f_x +- c m_x| + |X f_y +- c m_y| +- m_z <= c (X + Y) f_z

    Attributes:
        half_lengths: X and Y, half of its sides along x and y [m].
        friction: Coulomb's coefficient [1].
    """

    half_lengths: tuple[float, float] = (0.1, 0.05)
    friction: float = 0.5

    def __post_init__(self) -> None:
        validation.own_scalars(self, "friction", low=0.0, infinite=True)
        lengths = validation.real_array("FlatFoot.half_lengths", self.half_lengths, (2,))
        for value in lengths:
            validation.scalar("FlatFoot.half_lengths", value, low=0.0, unit="m")
        object.__setattr__(self, "half_lengths", (float(lengths[0]), float(lengths[1])))

    def _soles(self, share: float) -> dict[str, Any]:
        return {"half_lengths": (share * self.half_lengths[0], share * self.half_lengths[1])}

    def cone(self) -> tuple[Array, Array]:
        """Rows: friction, normal, then pressure and yaw."""
        x, y = self.half_lengths
        arms = np.array([y, x, 0.5 * self.friction * (x + y)])
        sides = np.vstack([_MOMENTS, -_MOMENTS])
        sides[:, 2] = -np.tile(arms, 2)
        # Friction at each corner within a square inside of the circle
        corner, (a, b, turn) = self.friction / np.sqrt(2.0), _SIGNS.T
        yaw = np.zeros((len(_SIGNS), 6))
        yaw[:, 0], yaw[:, 1], yaw[:, 2] = a * y, b * x, -corner * (x + y)
        yaw[:, 3], yaw[:, 4], yaw[:, 5] = turn * a * corner, turn * b * corner, turn
        return _pressing(self.friction, np.vstack([sides, yaw]) if self.friction < np.inf else sides)


@dataclass(frozen=True)
class GripHand(ContactKind):
    """A closed gripper: it bears any force up to ``force`` and any moment up to ``torque``, each component by itself.

    Attributes:
        force: largest size of each component of the force [N].
        torque: largest size of each component of the moment [N m].
        rolls: whether the hand is free to turn about z; then it bears no m_z.
        swivels: whether the hand is free to turn about all axes, as on a ball or hook; then it bears no moment.
    """

    pulls: ClassVar[bool] = True

    force: float = 500.0
    torque: float = 50.0
    rolls: bool = False
    swivels: bool = False

    def __post_init__(self) -> None:
        validation.own_scalars(self, "force", "torque", low=0.0, infinite=True)
        validation.flag("GripHand.rolls", self.rolls)
        validation.flag("GripHand.swivels", self.swivels)

    @property
    def fixed(self) -> Fixed:  # type: ignore[override]
        """``"position"`` where the hand swivels, ``"axis"`` where it rolls, else ``"pose"``."""
        return "position" if self.swivels else "axis" if self.rolls else "pose"

    def cone(self) -> tuple[Array, Array]:
        """A box: one row for each component and sign."""
        sizes = np.array([self.force] * 3 + [self.torque] * 3)
        sizes[3:5] = 0.0 if self.swivels else self.torque
        sizes[5] = 0.0 if self.rolls or self.swivels else self.torque
        return np.vstack([np.eye(6), -np.eye(6)]), np.tile(sizes, 2)


@dataclass(frozen=True)
class SuctionPad(ContactKind):
    """A pad or magnet that is drawn to the surface by ``pull``: its wrench plus that pull is one of a round flat foot.

        |(f_x, f_y)| <= friction (f_z + pull),   |m_x|, |m_y| <= radius (f_z + pull),
        |m_z| <= friction radius / 2 (f_z + pull),   -pull <= f_z

    Attributes:
        pull: force by which it is drawn to the surface [N].
        radius: of the pad [m].
        friction: Coulomb's coefficient [1].
    """

    pulls: ClassVar[bool] = True

    pull: float = 100.0
    radius: float = 0.03
    friction: float = 0.5

    def __post_init__(self) -> None:
        validation.own_scalars(self, "pull", "radius", "friction", low=0.0, infinite=True)

    def _soles(self, share: float) -> dict[str, Any]:
        return {"radius": share * self.radius}

    def cone(self) -> tuple[Array, Array]:
        """The cone of a flat foot, moved by the pull."""
        a, b = FlatFoot((self.radius, self.radius), self.friction).cone()
        return a, b - self.pull * a[:, 2]


#: Rows of the three moments in a wrench
_MOMENTS = np.eye(6)[3:]
#: Signs of the two sizes and of m_z in a flat foot's rows of yaw
_SIGNS = np.array(list(itertools.product((1.0, -1.0), repeat=3)))


def _pressing(friction: float, moments: Array) -> tuple[Array, Array]:
    """Rows of friction and of the normal force, then ``moments`` with b = 0."""
    angles = 2.0 * np.pi * np.arange(FACES) / FACES
    rows = np.zeros((FACES, 6))
    rows[:, 0], rows[:, 1] = np.cos(angles), np.sin(angles)
    rows[:, 2] = -friction * np.cos(np.pi / FACES)
    normal = np.array([[0.0, 0.0, -1.0, 0.0, 0.0, 0.0]])
    return np.vstack([rows, normal, moments]), np.zeros(FACES + 1 + len(moments))
