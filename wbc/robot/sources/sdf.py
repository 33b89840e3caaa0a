"""Reading SDF files: a tree of links, and the joints that close loops in it."""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from wbc.errors import RobotFileError
from wbc.multibody import own, single_joint
from wbc.robot.loops import Kind, Loop
from wbc.robot.sources.description import ROOT, Description, Mimic, own_base, with_base
from wbc.robot.sources.sdf_frames import MODEL, WORLD, SdfFrames, SdfPart
from wbc.robot.sources.sdf_includes import axes_in_model, found, included, with_includes
from wbc.robot.sources.urdf_checks import Remarks, check_inertias, has_direction, meant, shown
from wbc.validation import Array

#: Joints of the format that a tree can have -> the loop that they are where both of their links hang on others already
KINDS: Mapping[str, Kind] = {
    "revolute": "hinge",
    "continuous": "hinge",
    "prismatic": "slide",
    "ball": "connect",
    "fixed": "weld",
}
#: Limits at or beyond this are none [rad, m]
NONE = 1e15
#: What is read of each element, and of its attributes
_SDF_READ = {
    "model": ("link", "joint", "frame", "model", "pose", "static"),
    "link": ("pose", "inertial"),
    "inertial": ("pose", "mass", "inertia"),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "frame": ("pose",),
    "joint": ("parent", "child", "pose", "axis"),
    "axis": ("xyz", "limit", "dynamics", "mimic", "use_parent_model_frame"),
    "limit": ("lower", "upper", "velocity", "effort"),
    "dynamics": ("damping", "friction", "spring_stiffness"),
    "mimic": ("multiplier", "offset", "reference"),
}
_SDF_ATTRIBUTES = {
    "model": ("name", "canonical_link", "placement_frame"),
    "pose": ("relative_to", "rotation_format", "degrees"),
    "xyz": ("expressed_in",),
    "frame": ("name", "attached_to"),
    "mimic": ("joint", "axis"),
}
#: Elements of which an element may have several
_MANY = ("link", "joint", "frame", "model")
#: What moves nothing: nothing is said of it
_MUTE = (
    *("self_collide", "enable_wind", "allow_auto_disable", "visual", "collision", "sensor", "light"),
    *("physics", "stiffness", "dissipation", "spring_reference"),
)
#: What says only what holds anyhow
_USUAL = {"gravity": ("true", "1"), "kinematic": ("false", "0")}


@dataclass(frozen=True, eq=False)
class _Joint:
    """A joint of the file.

    Attributes:
        element: what the file says. name, kind: as there. parent, child: its links, or the world.
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
    """The description in an SDF file of one model, with the models in it, or that it includes, whose names lead:
    ``arm::hand``. A link hangs on the first joint of which it is the child; what no such joint leads to hangs on
    another one, as its parent. All other joints close loops.

    A model that no joint ties to the world, and that is not static, has a floating base by itself, at the pose of its
    root link.

    Raises:
        RobotFileError: no or several models, included files that are not there, joints of a kind, frames or links
            that are not there or there twice, numbers that are none, inertias that shapes give, links that nothing ties
            to the others; what they are and where.
    """
    return _Reader(path, tree).read(base)


class _Reader:
    def __init__(self, path: pathlib.Path, tree: ElementTree.Element) -> None:
        self._path, self._remarks, self._tensors = path, Remarks(path), dict[str, Array]()
        self._model = self._outermost(tree)
        if tree.find("world/joint") is not None:
            raise self._error("a <joint> of the world is not read: put it into the model")
        with_includes(self._model, path, self._error)
        self._gravity = tree.findtext("world/gravity")
        self._frames = SdfFrames(self._model, self._error)
        self._links = self._frames.of_kind("link")
        self._axes_in_model = axes_in_model(tree.get("version", ""))
        self._joints = [self._joint(joint) for joint in self._frames.of_kind("joint").values()]
        self._static = (self._model.findtext("static") or "").strip() in ("true", "1")
        self._held = any(joint.parent == WORLD for joint in self._joints)

    def _outermost(self, tree: ElementTree.Element) -> ElementTree.Element:
        """The one model; of a world that has none itself the one that it includes and that is there."""
        models = [*tree.findall("model"), *tree.findall("world/model")]
        includes = {(one.findtext("uri") or "").strip(): one for one in tree.findall("world/include")}
        there = [one for uri, one in includes.items() if not models and found(uri, self._path)]
        beside = [repr(uri) for uri, one in includes.items() if one not in there]
        if (count := len(models) + len(there)) != 1:
            lost = f"; no file beside it or above is the <include> of {', '.join(beside)}" * bool(beside and not models)
            raise self._error(f"{count} models, expected one{lost}")
        for uri in beside:
            self._remarks.add("sdf", f"no part of the robot is the <include> of {uri}")
        return models[0] if models else included(there[0], self._path, self._error)

    def read(self, base: str | None) -> Description:
        hangs = self._tree()
        placed = self._frames.model_pose()
        start = placed.inverse()
        if not (self._held or self._static):
            root = next(link for link in self._links if link not in hangs)
            start = self._frames.pose(self._links[root])
        out, fixed = own.Model(), dict[str, tuple[int, own.SE3]]()
        out.name = self._model.get("name", "")
        if self._gravity is not None:
            out.gravity = own.Motion(self._frames.numbers(self._gravity, 3, "gravity of the world"), np.zeros(3))
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
            there = back * self._frames.pose(self._links[link])
            out.appendBodyToJoint(index, self._inertia(link), there)
            out.addBodyFrame(link, index, there, 0)
            for below in self._links:
                if below in hangs and hangs[below].other(below) == link:
                    add(below)

        for link in self._links:
            if link not in hangs or hangs[link].other(link) == WORLD:
                add(link)
        for frame in self._frames.of_kind("frame").values():
            index, back = fixed[self._frames.link_of(str(frame.element.get("name")), frame.scope, frame.name)]
            there = back * self._frames.pose(frame)
            out.addFrame(own.Frame(frame.name, index, 0, there, own.FrameType.OP_FRAME))
        loops = tuple(self._loop(out, joint, fixed) for joint in self._joints if joint not in hangs.values())
        out.damping, loss = np.array(damping), np.array(friction)
        out.upperDryFrictionLimit, out.lowerDryFrictionLimit = loss, -loss
        self._say()
        whole, kind = with_base(out, base if base or self._held or self._static else "floating")
        states = {}
        if kind == "floating" and own_base(out) == "fixed":
            states["home"] = {ROOT: np.array(own.SE3ToXYZQUAT(placed * start))}
        return Description(
            whole, kind, tuple(mimics), states, notes=self._remarks.said(), source=str(self._path), loops=loops
        )

    def _tree(self) -> dict[str, _Joint]:
        """Link -> the joint that it hangs on; the root has none."""
        hangs = dict[str, _Joint]()
        for joint in self._joints:
            hangs.setdefault(joint.child, joint)
        root = next((link for link in self._links if link not in hangs), next(iter(self._links)))
        if self._held:
            root = WORLD
        hangs.pop(root, None)
        reached = {root}

        def grow(ends: Callable[[_Joint], bool]) -> bool:
            joint = next((joint for joint in self._joints if ends(joint)), None)
            if joint is None:
                return False
            link = joint.child if joint.parent in reached else joint.parent
            hangs[link] = joint
            reached.add(link)
            return True

        while grow(lambda j: hangs.get(j.child) is j and j.parent in reached and j.child not in reached) or grow(
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

    def _joint(self, placed: SdfPart) -> _Joint:
        element, name, kind = placed.element, placed.name, str(placed.element.get("type"))
        if kind not in KINDS:
            raise self._error(f"joint {name!r} is of type {kind!r}, which is none of {', '.join(KINDS)}")
        ends = [(element.findtext(key) or "").strip() for key in ("parent", "child")]
        if WORLD not in ends[:1]:
            ends[0] = self._frames.link_of(ends[0], placed.scope, name)
        ends[1] = self._frames.link_of(ends[1], placed.scope, name)
        if ends[0] == ends[1]:
            raise self._error(f"joint {name!r} is between the link {ends[0]!r} and itself")
        pose, axis = self._frames.pose(placed), np.zeros(3)
        if kind not in ("ball", "fixed"):
            axis = self._frames.numbers(element.findtext("axis/xyz") or "0 0 1", 3, f"axis of {name}")
            if not has_direction(axis):
                raise self._error(f"joint {name!r} has no direction: its axis is {shown(axis)}")
            xyz, flag = element.find("axis/xyz"), (element.findtext("axis/use_parent_model_frame") or "").strip()
            seen_from = xyz.get("expressed_in", "") if xyz is not None else ""
            in_model = self._axes_in_model if not flag else flag in ("1", "true")
            if seen_from or in_model:
                axes = self._frames.axes(seen_from or MODEL, placed.scope, name)
                axis = self._frames.turned(placed).T @ axes @ axis
            axis = axis / np.linalg.norm(axis)
        if self._number(element, "axis/dynamics/spring_stiffness", 0.0) != 0.0:
            self._remarks.add("forces", f"the spring of {name} is not held: torques do not know of it")
        return _Joint(element, name, kind, ends[0], ends[1], pose, axis)

    def _mimic(self, joint: _Joint) -> tuple[Mimic, ...]:
        mimic = joint.element.find("axis/mimic")
        if mimic is None:
            return ()
        leader = joint.name.removesuffix(str(joint.element.get("name"))) + str(mimic.get("joint"))
        if leader not in self._frames.of_kind("joint"):
            self._remarks.add("mimic", f"{joint.name} stays free: there is no {leader}, which it would follow")
            return ()
        number = partial(self._number, mimic)
        ratio = number("multiplier", 1.0)
        offset = number("offset", 0.0) - ratio * number("reference", 0.0)
        return (Mimic(joint.name, leader, ratio, offset),)

    def _inertia(self, link: str) -> own.Inertia:
        """Of a link at its own frame; what the file leaves out is 1 kg and 1 kg m^2, as the format says."""
        element = self._links[link].element
        if (inertial := element.find("inertial")) is None:
            self._remarks.add("inertia", f"link {link!r} has no <inertial>: it weighs 1 kg, as the format says")
            inertial = ElementTree.Element("inertial")
        if inertial.get("auto", "false") in ("true", "1"):
            raise self._error(f"link {link!r} states no inertia (auto); what its shapes would give is not worked out")
        number = partial(self._number, inertial)
        mass = number("mass", 1.0)
        if mass < 0.0:
            raise self._error(f"link {link!r} has a mass of {mass:g} kg")
        xx, yy, zz = (number(f"inertia/{key}", 1.0) for key in ("ixx", "iyy", "izz"))
        xy, xz, yz = (number(f"inertia/{key}", 0.0) for key in ("ixy", "ixz", "iyz"))
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        self._tensors[link] = tensor
        moved: own.Inertia = self._frames.stated(inertial).act(own.Inertia(mass, np.zeros(3), tensor))
        return moved

    def _number(self, element: ElementTree.Element, key: str, default: float) -> float:
        text = element.findtext(key)
        what = f"{key} of {element.get('name') or element.tag}"
        return default if text is None else float(self._frames.numbers(text, 1, what)[0])

    def _say(self) -> None:
        shapes = [name for name, link in self._links.items() if link.element.find("collision") is not None]
        if shapes:
            self._remarks.add("shapes", "shapes of an SDF file are not read; with_shapes gives them")
        if self._static:
            self._remarks.add("sdf", "the model is static: its base is fixed, its joints move here")
        check_inertias(self._tensors, self._remarks)
        if unread := list(dict.fromkeys(self._unread(self._model, ""))):
            self._remarks.add("sdf", f"not read: {', '.join(unread)}")

    def _unread(self, element: ElementTree.Element, whose: str) -> Iterator[str]:
        """What an element says, and what is in it, that means nothing here; ``whose``: words for the element."""
        known = _SDF_ATTRIBUTES.get(element.tag, tuple(element.attrib))
        yield from (
            f"{key} in <{element.tag}>{whose}{meant(key, known)}"
            for key in element.attrib
            if key not in known and element.get(key)
        )
        times = Counter(part.tag for part in element)
        for part in element:
            read = _SDF_READ.get(element.tag, ())
            owner = f" of {part.tag} {part.get('name')!r}" if part.get("name") else whose
            if part.tag in read:
                if times[part.tag] > 1 and part.tag not in _MANY:
                    yield f"<{part.tag}>{whose} after the first"
                yield from self._unread(part, owner)
            elif part.tag not in _MUTE and (part.text or "").strip() not in _USUAL.get(part.tag, ()):
                yield f"<{part.tag}>{whose}{meant(part.tag, read)}"

    def _error(self, reason: str) -> RobotFileError:
        return RobotFileError("robot", str(self._path), reason)
