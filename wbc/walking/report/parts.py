"""The machine as pictures show it: colours of its links, and the pieces that join their shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.shapes import Capsule, Solid
from wbc.validation import Array
from wbc.walking.report.surroundings import Colour, arm_colour, mixed

#: Part of white in the colour of an arm, and of its hand
PALE_ARM, PALE_HAND = 0.6, 0.05


@dataclass(frozen=True, eq=False)
class Part:
    """A shape that a link carries; only the machine's own shapes are checked for clearance, not what joins them.

    Attributes:
        link: frame of the robot. shape, placement: in it. colour: of the picture.
    """

    link: str
    shape: Solid
    placement: pin.SE3
    colour: Colour


def joining_pieces(walker: Walker, colours: Mapping[str, Colour]) -> list[Part]:
    """What joins necks and upper arms; ``colours``: of the links with shapes."""
    data = walker.arm_data
    neck, across = data.neck_length, data.shoulder_offset
    place = pin.SE3(pin.utils.rotate("x", -np.pi / 2), np.array([0.0, -across / 2, neck]))
    piece = Capsule(data.upper_arm_radius, across)
    return [Part(arm.links[0], piece, place, colours[arm.links[0]]) for arm in walker.arms]


def link_colours(walker: Walker) -> dict[str, Colour]:
    """Link -> colour: arms in their own, hands darker."""
    out = dict[str, Colour]()
    for k, arm in enumerate(walker.arms):
        out |= dict.fromkeys(arm.links, mixed(arm_colour(k), PALE_ARM))
        out[arm.links[-1]] = mixed(arm_colour(k), PALE_HAND)
    return out


def part_poses(walker: Walker, parts: list[Part], q: Array) -> list[pin.SE3]:
    """Where shapes are at a configuration, in the frame of its base."""
    model = walker.robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return [data.oMf[model.getFrameId(part.link)] * part.placement for part in parts]
