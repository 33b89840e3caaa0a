"""Reading SDF files: a tree of links, and the joints that close loops in it."""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from wbc.errors import RobotFileError
from wbc.multibody import own, single_joint
from wbc.robot.loops import Kind, Loop
from wbc.robot.sources.description import ROOT, Description, Mimic, own_base, with_base
from wbc.robot.sources.urdf_checks import Remarks, has_direction, shown
from wbc.validation import Array

#: Joints of the format that a tree can have -> the loop that they are where both of their links hang on others already
KINDS: Mapping[str, Kind] = {
    "revolute": "hinge",
    "continuous": "hinge",
    "prismatic": "slide",
    "ball": "connect",
    "fixed": "weld",
}
WORLD = "world"
#: Limits at or beyond this are none [rad, m]
NONE = 1e15
#: Largest difference of a quaternion's length from 1
UNIT = 1e-3
#: What a model may have that moves nothing: nothing is said of it
_MUTE = ("link", "joint", "pose", "static", "self_collide", "frame", "enable_wind", "allow_auto_disable")


@dataclass(frozen=True, eq=False)
class _Joint:
    """A joint of the file.

    Attributes:
        element: what the file says. name, kind, parent, child: as there.
        pose: in the model. axis: in the joint, (0, 0, 0) where it has none.
    """

    element: ElementTree.Element
    name: str
    kind: str
    parent: str
    child: str
    pose: own.SE3
    axis: Array

    def other(self, link: str) -> str:
        """The link at the other end."""
        return self.parent if link == self.child else self.child

    @property
    def along_z(self) -> own.SE3:
        """The joint's pose, turned so that its axis is z, where it has one."""
        if not self.axis.any():
            return self.pose
        turn = own.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), self.axis).toRotationMatrix()
        return self.pose * own.SE3(turn, np.zeros(3))


def read_sdf(path: pathlib.Path, tree: ElementTree.Element, base: str | None = None) -> Description:
    """The description in an SDF file of one model. A link hangs on the first joint of which it is the child; what no
    such joint leads to hangs on another one, as its parent. All other joints close loops.

    A model that no joint ties to the world has a floating base by itself, at the pose of its root link.

    Raises:
        RobotFileError: no or several models, models in models, joints of a kind, frames or links that are not there,
            numbers that are none, links that nothing ties to the others; what they are and where.
    """
    return _Reader(path, tree).read(base)


class _Reader:
    def __init__(self, path: pathlib.Path, tree: ElementTree.Element) -> None:
        self._path, self._remarks = path, Remarks(path)
        models = [*tree.findall("model"), *tree.findall("world/model")]
        if len(models) != 1:
            raise self._error(f"{len(models)} models, expected one")
        self._model = models[0]
        for inside in ("model", "include"):
            if self._model.find(inside) is not None:
                raise self._error(f"<{inside}> within a model is not read")
        self._links = {str(link.get("name")): link for link in self._model.findall("link")}
        self._frames = {str(e.get("name")): e for e in self._model if e.tag in ("link", "joint", "frame")}
        version = [int(x) for x in tree.get("version", "1.6").split(".")[:2] if x.isdigit()]
        self._axes_in_model = version < [1, 5]
        self._joints = [self._joint(joint) for joint in self._model.findall("joint")]

    def read(self, base: str | None) -> Description:
        hangs = self._tree()
        tied = any(joint.parent == WORLD for joint in self._joints)
        roots = [link for link in self._links if link not in hangs]
        start = self._pose(self._links[roots[0]], ()) if roots and not tied else own.SE3.Identity()
        out, fixed = own.Model(), dict[str, tuple[int, own.SE3]]()
        out.name = self._model.get("name", "")
        # Where each link is on the joint that carries it: (joint, pose of the model in it)
        fixed[WORLD] = 0, start.inverse()
        mimics, damping, friction = list[Mimic](), list[float](), list[float]()

        def add(link: str) -> None:
            if link in hangs:
                joint = hangs[link]
                index, back = fixed[joint.other(link)]
                if joint.kind != "fixed":
                    index, back = self._move(out, joint, link, index, back), joint.pose.inverse()
                    count = int(out.nvs[index])
                    damping.extend([self._number(joint.element, "axis/dynamics/damping", 0.0)] * count)
                    friction.extend([self._number(joint.element, "axis/dynamics/friction", 0.0)] * count)
                    mimics.extend(self._mimic(joint))
                fixed[link] = index, back
            else:
                fixed[link] = fixed[WORLD]
            index, back = fixed[link]
            placed = back * self._pose(self._links[link], ())
            out.appendBodyToJoint(index, self._inertia(link), placed)
            out.addBodyFrame(link, index, placed, 0)
            for below in self._links:
                if below in hangs and hangs[below].other(below) == link:
                    add(below)

        for link in self._links:
            if link not in hangs or hangs[link].other(link) == WORLD:
                add(link)
        loops = tuple(self._loop(out, joint, fixed) for joint in self._joints if joint not in hangs.values())
        out.damping, loss = np.array(damping), np.array(friction)
        out.upperDryFrictionLimit, out.lowerDryFrictionLimit = loss, -loss
        self._say()
        whole, kind = with_base(out, base if base or tied else "floating")
        states = {}
        if kind == "floating" and own_base(out) == "fixed":
            states["home"] = {ROOT: np.array(own.SE3ToXYZQUAT(start))}
        return Description(
            whole, kind, tuple(mimics), states, notes=self._remarks.said(), source=str(self._path), loops=loops
        )

    def _tree(self) -> dict[str, _Joint]:
        """Link -> the joint that it hangs on; the root has none."""
        hangs = dict[str, _Joint]()
        for joint in self._joints:
            hangs.setdefault(joint.child, joint)
        tied = any(joint.parent == WORLD for joint in self._joints)
        root = WORLD if tied else next((link for link in self._links if link not in hangs), WORLD)
        reached = {root}

        def grow(ends: Callable[[_Joint], bool]) -> bool:
            joint = next((joint for joint in self._joints if ends(joint)), None)
            if joint is None:
                return False
            link = joint.child if joint.parent in reached else joint.parent
            hangs[link] = joint
            reached.add(link)
            return True

        while grow(lambda j: hangs[j.child] is j and j.parent in reached and j.child not in reached) or grow(
            lambda j: (j.parent in reached) != (j.child in reached)
        ):
            pass
        if lost := [link for link in self._links if link not in reached]:
            raise self._error(f"no joint ties these links to {root}: {', '.join(lost)}")
        return hangs

    def _move(self, out: own.Model, joint: _Joint, link: str, above: int, back: own.SE3) -> int:
        """Adds a joint that moves; where the link is the joint's parent it moves the other way."""
        sign = 1.0 if link == joint.child else -1.0
        made: own.JointModel = own.JointModelSpherical()
        if joint.kind != "ball":
            made = single_joint(sign * joint.axis, slides=joint.kind == "prismatic")
        index = int(out.addJoint(above, made, back * joint.pose, joint.name))
        out.addJointFrame(index)
        if joint.kind == "ball":
            return index
        number, at, v = partial(self._number, joint.element), int(out.idx_qs[index]), int(out.idx_vs[index])
        ends = number("axis/limit/lower", -np.inf), number("axis/limit/upper", np.inf)
        none = joint.kind == "continuous" or ends[0] > ends[1]
        if ends[0] > ends[1]:
            self._remarks.add(
                "position", f"lower {ends[0]:g} of {joint.name} is above its upper {ends[1]:g}: unlimited"
            )
        for name, value, place in (
            ("lowerPositionLimit", -np.inf if none or ends[0] <= -NONE else ends[0], at),
            ("upperPositionLimit", np.inf if none or ends[1] >= NONE else ends[1], at),
            ("upperVelocityLimit", number("axis/limit/velocity", np.inf), v),
            ("upperEffortLimit", number("axis/limit/effort", np.inf), v),
        ):
            values = np.array(getattr(out, name))
            values[place] = np.inf if value < 0.0 and name in ("upperVelocityLimit", "upperEffortLimit") else value
            setattr(out, name, values)
        return index

    def _loop(self, out: own.Model, joint: _Joint, fixed: dict[str, tuple[int, own.SE3]]) -> Loop:
        """A joint that closes a loop, between frames that are added to both links."""
        names = []
        for side, link in zip("ab", (joint.parent, joint.child), strict=True):
            index, back = fixed[link]
            names.append(f"{joint.name}:{side}")
            out.addFrame(own.Frame(names[-1], index, 0, back * joint.along_z, own.FrameType.OP_FRAME))
        ends = (
            self._number(joint.element, "axis/limit/lower", -np.inf),
            self._number(joint.element, "axis/limit/upper", np.inf),
        )
        if joint.kind in ("revolute", "prismatic") and max(-ends[0], ends[1]) < NONE:
            self._remarks.add("loops", f"{joint.name} closes a loop: its range {ends[0]:g} to {ends[1]:g} is not kept")
        return Loop(joint.name, names[0], names[1], KINDS[joint.kind])

    def _joint(self, element: ElementTree.Element) -> _Joint:
        name, kind = str(element.get("name")), str(element.get("type"))
        if kind not in KINDS:
            raise self._error(f"joint {name!r} is of type {kind!r}, which is none of {', '.join(KINDS)}")
        ends = [(element.findtext(key) or "").strip() for key in ("parent", "child")]
        for end in ends:
            if end not in self._links and (end != WORLD or end == ends[1]):
                raise self._error(f"joint {name!r} is between links of which there is no {end!r}")
        pose, axis = self._pose(element, ()), np.zeros(3)
        if kind not in ("ball", "fixed"):
            axis = self._numbers(element.findtext("axis/xyz") or "0 0 1", 3, f"axis of {name}")
            if not has_direction(axis):
                raise self._error(f"joint {name!r} has no direction: its axis is {shown(axis)}")
            xyz, flag = element.find("axis/xyz"), (element.findtext("axis/use_parent_model_frame") or "").strip()
            seen_from = xyz.get("expressed_in", "") if xyz is not None else ""
            in_model = self._axes_in_model if not flag else flag in ("1", "true")
            if seen_from or in_model:
                frame = self._named(seen_from or "__model__", name, ())
                axis = pose.rotation.T @ frame.rotation @ axis
            axis = axis / np.linalg.norm(axis)
        if (self._number(element, "axis/dynamics/spring_stiffness", 0.0)) != 0.0:
            self._remarks.add("forces", f"the spring of {name} is not held: torques do not know of it")
        return _Joint(element, name, kind, ends[0], ends[1], pose, axis)

    def _mimic(self, joint: _Joint) -> tuple[Mimic, ...]:
        mimic = joint.element.find("axis/mimic")
        if mimic is None:
            return ()
        number = partial(self._number, mimic)
        ratio = number("multiplier", 1.0)
        offset = number("offset", 0.0) - ratio * number("reference", 0.0)
        return (Mimic(joint.name, str(mimic.get("joint")), ratio, offset),)

    def _inertia(self, link: str) -> own.Inertia:
        """Of a link at its own frame; what the file leaves out is 1 kg and 1 kg m^2, as the format says."""
        element = self._links[link]
        if (inertial := element.find("inertial")) is None:
            self._remarks.add("inertia", f"link {link!r} has no <inertial>: it weighs 1 kg, as the format says")
            inertial = ElementTree.Element("inertial")
        number = partial(self._number, inertial)
        mass = number("mass", 1.0)
        if mass < 0.0:
            raise self._error(f"link {link!r} has a mass of {mass:g} kg")
        xx, yy, zz = (number(f"inertia/{key}", 1.0) for key in ("ixx", "iyy", "izz"))
        xy, xz, yz = (number(f"inertia/{key}", 0.0) for key in ("ixy", "ixz", "iyz"))
        pose = self._own_pose(inertial)
        moved: own.Inertia = pose.act(
            own.Inertia(mass, np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        )
        return moved

    def _pose(self, element: ElementTree.Element, way: tuple[str, ...]) -> own.SE3:
        """Of a link, joint or frame in the model."""
        name, pose = str(element.get("name")), element.find("pose")
        if name in way:
            raise self._error(f"the pose of {name!r} is relative to itself, by {', '.join(way)}")
        above = pose.get("relative_to", "") if pose is not None else ""
        if not above and element.tag == "joint":
            above = (element.findtext("child") or "").strip()
        if not above and element.tag == "frame":
            above = element.get("attached_to", "")
        return self._named(above or "__model__", name, (*way, name)) * self._own_pose(element)

    def _named(self, frame: str, asked: str, way: tuple[str, ...]) -> own.SE3:
        if frame in ("__model__", WORLD):
            return own.SE3.Identity()
        if frame not in self._frames:
            raise self._error(f"{asked!r} is stated in {frame!r}, which is no link, joint or frame of the model")
        return self._pose(self._frames[frame], way)

    def _own_pose(self, element: ElementTree.Element) -> own.SE3:
        pose = element.find("pose")
        if pose is None:
            return own.SE3.Identity()
        what = f"pose of {element.get('name') or element.tag}"
        form = pose.get("rotation_format", "euler_rpy")
        if form == "quat_xyzw":
            values = self._numbers(pose.text or "0 0 0 0 0 0 1", 7, what)
            length = float(np.linalg.norm(values[3:]))
            if abs(length - 1.0) > UNIT:
                raise self._error(f"the {what} has no unit quaternion")
            return own.XYZQUATToSE3(np.append(values[:3], values[3:] / length))
        if form != "euler_rpy":
            raise self._error(f"the {what} is in {form!r}, which is none of euler_rpy, quat_xyzw")
        values = self._numbers(pose.text or "0 0 0 0 0 0", 6, what)
        turn = np.radians(values[3:]) if pose.get("degrees", "false") in ("true", "1") else values[3:]
        return own.SE3(own.rpy.rpyToMatrix(*turn), values[:3])

    def _number(self, element: ElementTree.Element, key: str, default: float) -> float:
        text = element.findtext(key)
        return default if text is None else float(self._numbers(text, 1, f"{key} of {element.get('name')}")[0])

    def _numbers(self, text: str, count: int, what: str) -> Array:
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            values = np.zeros(0)
        if len(values) != count or np.isnan(values).any():
            raise self._error(f"{what} is {text.strip()!r}, expected {count} numbers")
        return values

    def _say(self) -> None:
        shapes = [name for name, link in self._links.items() if link.find("collision") is not None]
        if shapes:
            self._remarks.add("shapes", "shapes of an SDF file are not read; with_shapes gives them")
        others = sorted({element.tag for element in self._model} - set(_MUTE))
        if others:
            self._remarks.add("sdf", f"not read: {', '.join(f'<{tag}>' for tag in others)}")

    def _error(self, reason: str) -> RobotFileError:
        return RobotFileError("robot", str(self._path), reason)
