"""Where the links, joints and frames of an SDF model are, and of the models in it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc.multibody import own
from wbc.robot.sources.urdf_checks import meant
from wbc.validation import Array

WORLD = "world"
#: The frame of the model itself, as the format calls it
MODEL = "__model__"
#: Between the name of a model and of what is in it
_IN = "::"
#: Largest difference of a quaternion's length from 1
UNIT = 1e-3
#: What has a place, in the order in which a name is looked for: before SDF 1.7 a joint may be called as its link
_PLACED = ("link", "frame", "joint", "model")

#: Makes the error of a reason
Refused = Callable[[str], Exception]


@dataclass(frozen=True, eq=False)
class SdfPart:
    """A link, joint, frame or model of the file.

    Attributes:
        element: what the file says. name: with the names of the models that it is in, ``arm::hand``.
        scope: the name of its model, ``""`` for the outermost.
    """

    element: ElementTree.Element
    name: str
    scope: str


class SdfFrames:
    """All that is placed in a model. Names are looked for from within a scope, as the format does.

    Raises:
        RobotFileError: made by ``refused``: a name twice or missing, a name that nothing has, poses that rest on
            themselves, numbers that are none.
    """

    def __init__(self, model: ElementTree.Element, refused: Refused) -> None:
        self._refused = refused
        self._models, self._kinds = {"": model}, {kind: dict[str, SdfPart]() for kind in _PLACED}
        self._gather("", model)

    def of_kind(self, kind: str) -> dict[str, SdfPart]:
        """Links, frames, joints or models by name."""
        return self._kinds[kind]

    def _gather(self, scope: str, model: ElementTree.Element) -> None:
        for element in model:
            if element.tag not in _PLACED:
                continue
            if not element.get("name"):
                raise self._refused(f"a <{element.tag}> has no name")
            name = f"{scope}{_IN if scope else ''}{element.get('name')}"
            if name in self._kinds[element.tag]:
                raise self._refused(f"two elements <{element.tag}> are called {name!r}")
            self._kinds[element.tag][name] = SdfPart(element, name, scope)
            if element.tag == "model":
                self._models[name] = element
                self._gather(name, element)

    def find(self, name: str, scope: str, asked: str) -> SdfPart:
        """What a name means in a scope, for what asked for it."""
        whole = f"{scope}{_IN if scope else ''}{name}"
        for kind in self._kinds.values():
            if whole in kind:
                return kind[whole]
        near = meant(whole, [one for kind in self._kinds.values() for one in kind])
        raise self._refused(f"{asked!r} is stated in {name!r}, which is no link, joint or frame of the model{near}")

    def link_of(self, name: str, scope: str, asked: str, way: tuple[str, ...] = ()) -> str:
        """The link to which a name in a scope is fixed: a link itself, what a frame is attached to, a joint's child, or
        a model's first link.
        """
        if name == MODEL:
            return self._first_link(scope, asked)
        found = self.find(name, scope, asked)
        if (key := f"{found.element.tag} {found.name}") in way:
            raise self._refused(f"{found.name!r} is attached to itself, by {', '.join(way)}")
        if found.element.tag == "link":
            return found.name
        if found.element.tag == "model":
            return self._first_link(found.name, asked)
        on = found.element.get("attached_to") or (found.element.findtext("child") or "").strip() or MODEL
        return self.link_of(on, found.scope, found.name, (*way, key))

    def _first_link(self, scope: str, asked: str) -> str:
        if chosen := self._models[scope].get("canonical_link"):
            return self.link_of(chosen, scope, asked)
        inside = [name for name in self._kinds["link"] if name.startswith(f"{scope}{_IN}" if scope else "")]
        own_links = [name for name in inside if self._kinds["link"][name].scope == scope]
        if not inside:
            raise self._refused(f"{asked!r} is attached to the model {scope!r}, which has no link")
        return (own_links or inside)[0]

    def pose(self, placed: SdfPart) -> own.SE3:
        """Of something in the outermost model."""
        here, scope = self._placed(placed, ()), placed.scope
        while scope:
            above = self._kinds["model"][scope]
            here, scope = self._placed(above, ()) * here, above.scope
        return here

    def model_pose(self) -> own.SE3:
        """Of the outermost model in the world."""
        if (pose := self._models[""].find("pose")) is not None and pose.get("relative_to", WORLD) not in ("", WORLD):
            raise self._refused(f"the model is placed in {pose.get('relative_to')!r}, which is no part of it")
        return self._of_model("", self._models[""], own.SE3.Identity(), ())

    def axes(self, name: str, scope: str, asked: str) -> Array:
        """Rotation, in the model of a scope, of a frame that is named in it."""
        return np.asarray(self._named(name, scope, asked, ()).rotation)

    def turned(self, placed: SdfPart) -> Array:
        """Rotation of something in its own model."""
        return np.asarray(self._placed(placed, ()).rotation)

    def _placed(self, placed: SdfPart, way: tuple[str, ...]) -> own.SE3:
        """Of something in its own model."""
        element, pose = placed.element, placed.element.find("pose")
        if (key := f"{element.tag} {placed.name}") in way:
            raise self._refused(f"the pose of {placed.name!r} is relative to itself, by {', '.join(way)}")
        above = pose.get("relative_to", "") if pose is not None else ""
        if not above and element.tag == "joint":
            above = (element.findtext("child") or "").strip()
        if not above and element.tag == "frame":
            above = element.get("attached_to", "")
        start = self._named(above or MODEL, placed.scope, placed.name, (*way, key))
        if element.tag == "model":
            return self._of_model(placed.name, element, start, (*way, key))
        return start * self.stated(element)

    def _of_model(self, scope: str, model: ElementTree.Element, start: own.SE3, way: tuple[str, ...]) -> own.SE3:
        """Of a model: its pose says where the frame in it is that it is placed by."""
        placed = start * self.stated(model)
        frame = model.get("placement_frame", "")
        return placed * self._named(frame, scope, scope, way).inverse() if frame else placed

    def _named(self, name: str, scope: str, asked: str, way: tuple[str, ...]) -> own.SE3:
        """Of what a name means in the model of a scope, there."""
        if name in (MODEL, WORLD):
            return own.SE3.Identity()
        found = self.find(name, scope, asked)
        here, inside = self._placed(found, way), found.scope
        while inside != scope:
            above = self._kinds["model"][inside]
            here, inside = self._placed(above, way) * here, above.scope
        return here

    def stated(self, element: ElementTree.Element) -> own.SE3:
        """What the ``<pose>`` of an element says by itself; the identity where it has none."""
        pose = element.find("pose")
        if pose is None:
            return own.SE3.Identity()
        what = f"pose of {element.get('name') or element.tag}"
        form = pose.get("rotation_format", "euler_rpy")
        if form == "quat_xyzw":
            values = self.numbers(pose.text or "0 0 0 0 0 0 1", 7, what)
            length = float(np.linalg.norm(values[3:]))
            if abs(length - 1.0) > UNIT:
                raise self._refused(f"the {what} has no unit quaternion")
            return own.XYZQUATToSE3(np.append(values[:3], values[3:] / length))
        if form != "euler_rpy":
            raise self._refused(f"the {what} is in {form!r}, which is none of euler_rpy, quat_xyzw")
        values = self.numbers(pose.text or "0 0 0 0 0 0", 6, what)
        turn = np.radians(values[3:]) if pose.get("degrees", "false") in ("true", "1") else values[3:]
        return own.SE3(own.rpy.rpyToMatrix(*turn), values[:3])

    def numbers(self, text: str, count: int, what: str) -> Array:
        """So many numbers of a text; infinite ones are some."""
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            values = np.zeros(0)
        if len(values) != count or np.isnan(values).any():
            raise self._refused(f"{what} is {text.strip()!r}, expected {count} numbers")
        return values
