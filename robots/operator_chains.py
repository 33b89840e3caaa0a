"""Chains of the arms that operators command: axes and offsets of their joints.

Each chain is a row of joints; after joint i has turned by q_i about its axis, or has moved along it, a translation
leads to the next one:

    T = A_1(q_1) Tr(o_1) A_2(q_2) Tr(o_2) ...        A(q) = turn about, or shift along, the axis

Source: E. Dupuis, PhD thesis, McGill University, 2001: section 2.1 (RP), figures 3.1 (3R), 4.1 (4R), 4.7 (SSRMS), 4.10
(SPDM).
"""

from __future__ import annotations

from dataclasses import dataclass

Triple = tuple[float, float, float]

X = (1.0, 0.0, 0.0)
Y = (0.0, 1.0, 0.0)
Z = (0.0, 0.0, 1.0)
MINUS_Z = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class ChainJoint:
    """A joint of a chain.

    Attributes:
        axis: unit vector in the joint's frame.
        after: translation to the next frame, in the frame that has turned [m].
        sliding: whether q is a displacement along the axis.
    """

    axis: Triple
    after: Triple
    sliding: bool = False


def planar_rp(link: float) -> tuple[ChainJoint, ...]:
    """A turn about z, and an extension of the link beyond its length."""
    return (ChainJoint(Z, (link, 0.0, 0.0)), ChainJoint(X, (0.0, 0.0, 0.0), sliding=True))


def planar_3r(lengths: tuple[float, ...]) -> tuple[ChainJoint, ...]:
    """Three turns about z."""
    return tuple(ChainJoint(Z, (length, 0.0, 0.0)) for length in lengths)


def spherical_4r(upper_arm: float, forearm: float) -> tuple[ChainJoint, ...]:
    """Roll, yaw, pitch in one point, elbow pitch: Rx(q1) Rz(-q2) Ry(q3) Tr(L3) Ry(q4) Tr(L4)."""
    nowhere = (0.0, 0.0, 0.0)
    return (
        ChainJoint(X, nowhere),
        ChainJoint(MINUS_Z, nowhere),
        ChainJoint(Y, (upper_arm, 0.0, 0.0)),
        ChainJoint(Y, (forearm, 0.0, 0.0)),
    )


def ssrms(
    boom: float,
    z_shoulder: float = 0.0,
    z_wrist: float = 0.0,
    y_boom: float = 0.0,
    y_wrist: float = 0.0,
    x_tip: float = 0.0,
) -> tuple[ChainJoint, ...]:
    """Roll, yaw, pitch, elbow pitch, pitch, yaw, roll; yaws about -z, pitches about y, booms along x."""
    return (
        ChainJoint(X, (0.0, 0.0, 0.0)),
        ChainJoint(MINUS_Z, (0.0, 0.0, z_shoulder)),
        ChainJoint(Y, (boom, y_boom, 0.0)),
        ChainJoint(Y, (boom, 0.0, 0.0)),
        ChainJoint(Y, (0.0, y_wrist, 0.0)),
        ChainJoint(MINUS_Z, (0.0, 0.0, z_wrist)),
        ChainJoint(X, (x_tip, 0.0, 0.0)),
    )


def spdm_arm(
    *,
    boom: float,
    y_shoulder: float,
    z_shoulder: float,
    x_wrist: float,
    z_wrist: float,
    y_yaw: float,
    z_yaw: float,
    x_tip: float,
) -> tuple[ChainJoint, ...]:
    """The same order of joints; yaws about y, pitches about z. Of the printed x-offsets only the wrist's, between F5
    and F6, is in the printed formulas, and in this chain.
    """
    return (
        ChainJoint(X, (0.0, 0.0, 0.0)),
        ChainJoint(Y, (0.0, y_shoulder, z_shoulder)),
        ChainJoint(Z, (boom, 0.0, 0.0)),
        ChainJoint(Z, (boom, 0.0, 0.0)),
        ChainJoint(Z, (x_wrist, 0.0, z_wrist)),
        ChainJoint(Y, (0.0, y_yaw, z_yaw)),
        ChainJoint(X, (x_tip, 0.0, 0.0)),
    )
