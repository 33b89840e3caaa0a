"""The machine as pictures show it: colours of its links, and the pieces that join their shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.shapes import Capsule, Solid
from wbc.validation import Array
from wbc.walking.report.surroundings import BODY, Colour, arm_colour, mixed

#: Radius of a piece between wrist joints, over that of the thinnest shape of the machine
THIN = 0.7
#: Joints nearer to a shape than this need no piece [m]
NEAR = 1e-3
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
    """What joins necks and upper arms, or the joints of the two-ended arm; ``colours``: of the links with shapes."""
    if not walker.two_ended:
        data = walker.arm_data
        neck, across = data.neck_length, data.shoulder_offset
        place = pin.SE3(pin.utils.rotate("x", -np.pi / 2), np.array([0.0, -across / 2, neck]))
        piece = Capsule(data.upper_arm_radius, across)
        return [Part(arm.links[0], piece, place, colours[arm.links[0]]) for arm in walker.arms]
    arm = walker.two_ended_data
    radius = THIN * min(arm.boom_radius, arm.wrist_radius)
    out = []
    for link, start, end in _gaps(walker):
        away = end - start
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), away).toRotationMatrix()
        place = pin.SE3(turn, (start + end) / 2)
        out.append(Part(link, Capsule(radius, float(np.linalg.norm(away))), place, _colour(walker, link, colours)))
    return out


def _gaps(walker: Walker) -> list[tuple[str, Array, Array]]:
    """(link, from, to in its frame): between its shape, or its own joint, and the joints that it carries."""
    model = walker.robot.model
    links = {model.getFrameId("body"): "body"} | {
        k: frame.name for k, frame in enumerate(model.frames) if "_link" in frame.name
    }
    out = []
    for index, link in links.items():
        joint = model.frames[index].parentJoint
        carried = [np.array(model.jointPlacements[k].translation) for k in range(1, model.njoints)]
        ends = [place for k, place in enumerate(carried, 1) if model.parents[k] == joint]
        for end in [np.zeros(3), *ends] if link != "body" else ends:
            start = _nearest(walker, link, end)
            if np.linalg.norm(end - start) > NEAR:
                out.append((link, start, end))
    return out


def _nearest(walker: Walker, link: str, place: Array) -> Array:
    """The point nearest to a place on the cores of a link's capsules; its own joint where it has none."""
    cores = [
        (shape.placement, shape.shape.length / 2)
        for shape in walker.robot.shapes.get(link, ())
        if isinstance(shape.shape, Capsule)
    ]
    points = [core.act(np.array([0.0, 0.0, np.clip(core.actInv(place)[2], -half, half)])) for core, half in cores]
    return min(points, key=lambda point: float(np.linalg.norm(place - point)), default=np.zeros(3))


def _colour(walker: Walker, link: str, colours: Mapping[str, Colour]) -> Colour:
    """The link's; else that of the last link of its arm."""
    arms = [arm for arm in walker.arms if link.startswith(arm.name)]
    return colours.get(link, colours[arms[0].links[0]] if arms else BODY)


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
