"""Arms of walking machines: the PUMA 600 arm by Table II, and the two halves of the two-ended arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from wbc.multibody import pin
from wbc.robot import DHRow
from wbc.robots.link_tree import TreeLink
from wbc.robots.walker_data import TwoEndedData, WalkerData

#: Link and frame of the body
BODY = "body"


@dataclass(frozen=True, eq=False)
class WalkerArm:
    """One arm of a walking machine.

    Attributes:
        name: "arm1", ...
        base: pose of the arm's base frame in the body's frame.
        joints: names, from the body outwards.
        q, v: where the arm's coordinates and velocities stand, in the order of ``joints``.
        base_frame, hand: names of frames; z of the hand is its approach direction.
        links: names of its links with shapes, from the body outwards.
    """

    name: str
    base: pin.SE3
    joints: tuple[str, ...]
    q: slice
    v: slice
    base_frame: str
    hand: str
    links: tuple[str, ...]


def puma_rows(data: WalkerData, artificial_limits: bool = False) -> tuple[DHRow, ...]:
    """Table II with the limits of Table I: T = Rz(theta_i + offset) Tz(s) Tx(a) Rx(alpha), SI.

    With ``artificial_limits`` theta3 ends at ``data.elbow_limit``, so that the elbow stays bent.
    """
    upper = list(data.position_limits)
    if artificial_limits:
        upper[2] = data.elbow_limit
    lengths = (data.neck_length, data.shoulder_offset, 0.0, data.forearm_length, 0.0, data.hand_length)
    along = (0.0, data.upper_arm_length, 0.0, 0.0, 0.0, 0.0)
    twists = (pi / 2, 0.0, pi / 2, pi / 2, pi / 2, 0.0)
    offsets = (pi, pi / 2, pi / 2, pi, pi, 0.0)
    return tuple(
        DHRow(
            a=along[i],
            alpha=twists[i],
            d=lengths[i],
            theta=offsets[i],
            lower=-data.position_limits[i],
            upper=upper[i],
            velocity=data.joint_rates[i],
            acceleration=data.joint_accelerations[i],
        )
        for i in range(6)
    )


def chain(prefix: str, base: str, rows: Sequence[DHRow], hand: str, first: int = 1) -> list[TreeLink]:
    """Links ``prefix_link1`` ... on joints ``prefix_joint1`` ..., counted from ``first``; ``hand``: last frame."""
    links, parent, tail = [], base, pin.SE3.Identity()
    for number, row in enumerate(rows, start=first):
        link = f"{prefix}_link{number}"
        limits = (row.lower, row.upper, row.velocity, row.acceleration)
        links.append(TreeLink(link, parent, tail * row.before(), f"{prefix}_joint{number}", *limits))
        parent, tail = link, row.after()
    links.append(TreeLink(hand, parent, tail))
    return links


def two_ended_rows(data: TwoEndedData) -> tuple[DHRow, ...]:
    """Roll, yaw, pitch, pitch, pitch, yaw, roll of the two-ended arm, from tip to tip."""
    quarter = pi / 2
    numbers = (
        (0.0, quarter, data.roll_offset, quarter),
        (0.0, quarter, data.yaw_offset, quarter),
        (data.boom_length, 0.0, data.pitch_offset, 0.0),
        (data.boom_length, 0.0, data.elbow_offset, 0.0),
        (0.0, quarter, data.pitch_offset, quarter),
        (0.0, -quarter, data.yaw_offset, -quarter),
        (0.0, 0.0, data.roll_offset, 0.0),
    )
    limit, rate = data.position_limit, data.joint_rate
    acceleration = rate / data.acceleration_time
    return tuple(
        DHRow(a, alpha, d, theta, lower=-limit, upper=limit, velocity=rate, acceleration=acceleration)
        for a, alpha, d, theta in numbers
    )


def reversed_chain(prefix: str, base: str, rows: Sequence[DHRow], hand: str, first: int) -> list[TreeLink]:
    """The same chain seen from the frame of its last row: joints numbered downwards to ``first``, coordinates alike.

    T^-1 = after^-1 Rz(-q) before^-1, and Rz(-q) = Rx(pi) Rz(q) Rx(-pi). ``hand`` is the frame before the first row,
    turned about x such that its z axis points away from the chain.
    """
    flip = pin.SE3(pin.utils.rotate("x", pi), np.zeros(3))
    links, parent, tail = [], base, pin.SE3.Identity()
    for number, row in reversed(list(enumerate(rows, start=first))):
        link = f"{prefix}_link{number}"
        limits = (row.lower, row.upper, row.velocity, row.acceleration)
        placement = tail * row.after().inverse() * flip
        links.append(TreeLink(link, parent, placement, f"{prefix}_joint{number}", *limits))
        parent, tail = link, flip.inverse() * row.before().inverse()
    links.append(TreeLink(hand, parent, tail * flip))
    return links
