"""What the planner of a walk asks of an arm: a class that answers this walks, whatever its kinematics are."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wbc.robots.margins import Margins
from wbc.robots.walker_data import WalkerData
from wbc.validation import Array

Flags = NDArray[np.bool_]


class Limb(Protocol):
    """An arm of n joints: limits, and the capsules about its links. In its base frame and in SI; arrays hold any number
    of postures along their leading axes.
    """

    @property
    def position_limits(self) -> tuple[float, ...]:
        """Largest sizes of the joints' angles ``(n)`` [rad]."""

    @property
    def joint_rates(self) -> tuple[float, ...]:
        """Largest rates ``(n)`` [rad/s]."""

    @property
    def joint_accelerations(self) -> tuple[float, ...]:
        """Largest accelerations ``(n)`` [rad/s^2]."""

    @property
    def limit_names(self) -> tuple[str, ...]:
        """What the columns of :meth:`margins` are about; the first n are the joints' limits."""

    @property
    def links(self) -> tuple[tuple[int, int], ...]:
        """Rows of :meth:`points` at the two ends of each capsule, from the base outwards; the last is the hand's."""

    @property
    def radii(self) -> tuple[float, ...]:
        """Of the capsules [m]."""

    def points(self, q: Array, /) -> Array:
        """Named points of the arm at ``q`` ``[..., n]``: ``[..., points, 3]`` [m]."""

    def margins(self, q: Array, /) -> Array:
        """Angles to the limits at ``q`` ``[..., n]``: ``[..., limits]`` [rad]; negative beyond."""


class BodyLimb(Limb, Protocol):
    """An arm of a body: joint 1 turns about the z axis of its base, joint n about that of the hand.

    A posture on a hold belongs to a branch, numbered from 0 on; between neighbouring poses of the base a branch goes on
    continuously.
    """

    @property
    def still(self) -> int:
        """So many capsules, the first ones, are not moved against the body by any joint."""

    @property
    def pivot(self) -> Array:
        """The point of the base ``[3]`` from which no hand is farther than :attr:`hand_span` [m]."""

    @property
    def hand_span(self) -> float:
        """See :attr:`pivot` [m]."""

    @property
    def hand_length(self) -> float:
        """From the wrist to the hand's origin, along the hand's z axis [m]."""

    @property
    def guided(self) -> int:
        """In a swing joints from this one on (from 0) are led from posture to posture; the others follow the hand."""

    @property
    def waiting(self) -> tuple[tuple[float, float, float], ...]:
        """Where a hand may wait in the air, going with the body: angle about the base's z axis [rad], distance from it
        and height along it [m]. The first that is clear is taken.
        """

    @property
    def closed_form(self) -> WalkerData | None:
        """Numbers by which compiled loops do the work of the methods below; None: there are none, Python does it."""

    def wrist_of(self, points: Array, axes: Array, /) -> Array:
        """Where the wrist of hands at ``points`` with the z axes ``axes`` is, ``[..., 3]`` each [m]."""

    def wrist_reach(self, wrists: Array, /) -> Array:
        """How far wrists ``[..., 3]`` are within their reach [m], as near as a distance; negative outside."""

    def held(self, points: Array, axes: Array, x: Array | None = None, /) -> tuple[Array, Flags]:
        """Postures of hands at ``points`` along ``axes``, and with the x axes nearest to ``x``, ``[m, 3]`` each.

        Returns:
            (q, solved): ``[m, branches, n]`` [rad], joint n at 0 without ``x``; whether it is one, limits aside
            ``[m, branches]``. Where there is none q is finite and means nothing.
        """

    def wrist_bend(self, q: Array, /) -> Array:
        """How well joints turn the hand's axis at ``q`` ``[..., n]``, from 0 (not about one direction) to 1."""

    def elbow_bend(self, q: Array, /) -> Array:
        """How far the arm is from straight at ``q`` ``[..., n]`` [rad]."""

    def follow(self, frames: Array, places: Array, guide: Array, margins: Margins, /) -> tuple[Array, Flags]:
        """Joints of m hands on their way over k points, continuous along it.

        Args:
            frames: of the base ``[m, k, 4, 4]``, affine. places: of the hands ``[m, k, 3]`` [m].
            guide: what the guided joints are to be ``[m, k, g]`` [rad], without joint n if g is one less than they are.

        Returns:
            (q, possible): ``[m, k, guided + g]`` [rad], and whether the whole swing is within reach and limits ``[m]``.
        """
