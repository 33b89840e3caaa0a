"""The machine as pictures show it: capsules that links carry, and where they are at a configuration."""

from __future__ import annotations

import pinocchio as pin

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.report.joining_pieces import Part, joining_pieces
from wbc.walking.report.surroundings import BODY, Colour, arm_colour, mixed

#: Part of white in the colour of an arm, and of its hand
PALE_ARM, PALE_HAND = 0.6, 0.05


def link_colours(walker: Walker) -> dict[str, Colour]:
    """Link -> colour: arms in their own, hands darker."""
    out = dict[str, Colour]()
    for k, arm in enumerate(walker.arms):
        out |= dict.fromkeys(arm.links, mixed(arm_colour(k), PALE_ARM))
        out[arm.links[-1]] = mixed(arm_colour(k), PALE_HAND)
    return out


def parts_of(walker: Walker) -> list[Part]:
    """All shapes of the machine."""
    colours = link_colours(walker)
    out = [
        Part(link, placed.shape, placed.placement, colours.get(link, BODY))
        for link, shapes in walker.robot.shapes.items()
        for placed in shapes
    ]
    return out + joining_pieces(walker, colours)


def part_poses(walker: Walker, parts: list[Part], q: Array) -> list[pin.SE3]:
    """Where shapes are at a configuration, in the frame of its base."""
    model = walker.robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return [data.oMf[model.getFrameId(part.link)] * part.placement for part in parts]
