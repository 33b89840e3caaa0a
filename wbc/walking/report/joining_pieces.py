"""Pieces of a picture that join the shapes of a machine where its model has none: shoulders, wrists."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.robots import Walker, WalkerData
from wbc.shapes import Capsule, Solid
from wbc.validation import Array
from wbc.walking.report.surroundings import BODY, Colour

#: Radius of a piece between wrist joints, over that of the thinnest shape of the machine
THIN = 0.7
#: Joints nearer to a shape than this need no piece [m]
NEAR = 1e-3


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
    if isinstance(walker.data, WalkerData):
        neck, across = walker.data.neck_length, walker.data.shoulder_offset
        place = pin.SE3(pin.utils.rotate("x", -np.pi / 2), np.array([0.0, -across / 2, neck]))
        piece = Capsule(walker.data.upper_arm_radius, across)
        return [Part(arm.links[0], piece, place, colours[arm.links[0]]) for arm in walker.arms]
    radius = THIN * min(walker.data.boom_radius, walker.data.wrist_radius)
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
