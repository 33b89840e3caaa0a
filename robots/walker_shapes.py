"""Shapes of walking machines, and which of their links must not touch."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi

import numpy as np

from wbc.multibody import pin
from wbc.robot.recipe import segment_shape
from wbc.robots.walker_arms import BODY, WalkerArm
from wbc.robots.walker_data import TwoEndedData, WalkerData
from wbc.shapes import Convex, PlacedShape
from wbc.validation import Array


def puma_shapes(prefix: str, data: WalkerData) -> dict[str, tuple[PlacedShape, ...]]:
    """Capsules about neck (O to N), upper arm (S to E), forearm (E to W) and hand (W to H)."""
    segments = {
        f"{prefix}_link1": ((0.0, 0.0, 0.0), (0.0, 0.0, data.neck_length), data.neck_radius),
        f"{prefix}_link2": (
            (0.0, 0.0, data.shoulder_offset),
            (data.upper_arm_length, 0.0, data.shoulder_offset),
            data.upper_arm_radius,
        ),
        f"{prefix}_link4": ((0.0, 0.0, 0.0), (0.0, 0.0, data.forearm_length), data.forearm_radius),
        f"{prefix}_link6": ((0.0, 0.0, 0.0), (0.0, 0.0, data.hand_length), data.hand_radius),
    }
    return {k: (segment_shape(np.array(a), np.array(b), r, 0.0),) for k, (a, b, r) in segments.items()}


def body_shapes(corners: Sequence[Array], data: WalkerData, kind: str) -> dict[str, tuple[PlacedShape, ...]]:
    """The body: a prism over the polygon of the arm bases."""
    half, count = data.body_half_thickness, len(corners)
    if kind == "none":
        return {}
    if kind == "prism" and count > 2:
        points = np.array([corner + [0.0, 0.0, side * half] for corner in corners for side in (-1.0, 1.0)])
        return {BODY: (PlacedShape(Convex(points), pin.SE3.Identity()),)}
    edges = [(corners[i], corners[(i + 1) % count]) for i in range(count if count > 2 else 1)]
    if count > 2:
        # A ball in the middle, if no link then fits between it and the edges; else a capsule to every arm
        half_angle = cos(pi / count)
        gap = data.shoulder_radius * half_angle / (1 + half_angle) - half
        centre = np.zeros(3)
        edges += [(centre, centre)] if gap < data.hand_radius else [(centre, corner) for corner in corners]
    return {BODY: tuple(segment_shape(a, b, half, 0.0) for a, b in edges)}


def link_pairs(arms: Sequence[WalkerArm], body: bool, data: WalkerData) -> list[tuple[str, str]]:
    """Links that must not touch: all but those next to each other, the necks, which no joint moves apart, and upper
    arms that are too short to come down to the body.
    """
    out = []
    lowest = data.neck_length - data.upper_arm_length - data.upper_arm_radius
    apart = lowest > data.body_half_thickness + data.clearance
    for i, arm in enumerate(arms):
        neck, upper, forearm, hand = arm.links
        out += [(neck, forearm), (neck, hand), (upper, hand)]
        if body:
            out += [(BODY, link) for link in ((forearm, hand) if apart else (upper, forearm, hand))]
        for other in arms[i + 1 :]:
            out += [(a, b) for a in arm.links for b in other.links if (a, b) != (neck, other.links[0])]
    return out


def two_ended_shapes(data: TwoEndedData) -> dict[str, tuple[PlacedShape, ...]]:
    """Capsules about the two booms and the two rolling tips."""
    zero, tip = np.zeros(3), np.array([0.0, 0.0, data.roll_offset])
    elbow, along = np.array([0.0, 0.0, data.elbow_offset]), np.array([data.boom_length, 0.0, 0.0])
    return {
        BODY: (segment_shape(-along, zero, data.boom_radius, 0.0),),
        "arm1_link1": (segment_shape(zero, -tip, data.wrist_radius, 0.0),),
        "arm2_link4": (segment_shape(elbow, elbow + along, data.boom_radius, 0.0),),
        "arm2_link7": (segment_shape(zero, tip, data.wrist_radius, 0.0),),
    }
