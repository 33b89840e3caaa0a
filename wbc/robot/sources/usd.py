"""Physics of USD stages: rigid bodies and joints, as an SDF file."""

from __future__ import annotations

import itertools
import logging
import math
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import extras
from wbc.errors import RobotFileError
from wbc.multibody import own
from wbc.multibody.model import GRAVITY
from wbc.robot.sources.made import kept
from wbc.validation import Array

log = logging.getLogger("wbc")

#: Schemas of joints -> types of an SDF file
KINDS = {
    "PhysicsRevoluteJoint": "revolute",
    "PhysicsPrismaticJoint": "prismatic",
    "PhysicsSphericalJoint": "ball",
    "PhysicsFixedJoint": "fixed",
}
#: Schemas that say how bodies move, of the format and of simulators, by their first words
_OF_MOTION = ("Physics", "Physx", "Newton", "Mjc")
#: Those that say nothing of it, or are read
_QUIET = (
    *("PhysicsRigidBody", "PhysicsMass", "PhysicsArticulationRoot", "PhysicsCollision", "PhysicsMeshCollision"),
    *("PhysicsDrive", "PhysxJoint", "PhysicsJointState", "PhysicsScene"),
)
WORLD = "world"
#: What a scene's gravity may differ by from that of models without a word [m/s^2]
NEAR_GRAVITY = 0.02


@dataclass(frozen=True, eq=False)
class UsdJoint:
    """A joint of a stage: between bodies, with its pose in each at its zero, and the prim that says more."""

    name: str
    kind: str
    ends: tuple[str, str]
    poses: tuple[own.SE3, own.SE3]
    prim: Any


def converted(path: pathlib.Path) -> pathlib.Path:
    """The SDF file of a stage, in the cache. Bodies stand where its joints at zero put them, from the root's pose on; z
    is upwards: against the gravity of the stage's scene, or else along its up axis, which is y unless it says so.

    What is said of gravity, joints' limits, forces of drives, masses and inertias is there, in SI units. What else
    applies to a body or joint, and joints that are off, are named in the log.

    Raises:
        MissingPackageError: usd-core is not installed.
        RobotFileError: it cannot be opened, has no bodies, joints of another kind, or bodies without mass.
    """
    extras.require("usd", "a USD stage")
    from pxr import Tf, Usd

    try:
        stage = Usd.Stage.Open(str(path))
        # USD may remember what the file was
        stage.Reload()
    except Tf.ErrorException as error:
        raise RobotFileError("robot", str(path), f"cannot be opened: {str(error).strip().splitlines()[0]}") from error
    text = ElementTree.tostring(_Stage(path, stage).element(), encoding="unicode")
    return kept(text, f"{path.stem}.sdf")


class _Stage:
    def __init__(self, path: pathlib.Path, stage: Any) -> None:
        from pxr import Usd, UsdGeom, UsdPhysics

        self._path, self._stage, self._physics = path, stage, UsdPhysics
        self._length = float(UsdGeom.GetStageMetersPerUnit(stage))
        self._mass = float(UsdPhysics.GetStageKilogramsPerUnit(stage))
        self._places = UsdGeom.XformCache()
        prims = [prim for prim in stage.Traverse(Usd.TraverseInstanceProxies()) if prim.IsActive()]
        bodies = [prim for prim in prims if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
        if not bodies:
            raise self._error("the stage has no rigid bodies")
        names = _unique([prim.GetName() for prim in bodies], [str(prim.GetPath()) for prim in bodies])
        self._bodies = dict(zip((str(prim.GetPath()) for prim in bodies), bodies, strict=True))
        self._names = dict(zip(self._bodies, names, strict=True))
        self.lost = list[str]()
        #: Of the stage's scene, where it is another one than that of models without a word [m/s^2]
        self._gravity: float | None = None
        for prim in prims:
            # Those that this installation of USD does not know are in the metadata alone
            applied = prim.GetMetadata("apiSchemas")
            named = [] if applied is None else list(map(str, applied.GetAddedOrExplicitItems()))
            if (typed := str(prim.GetTypeName())) not in KINDS:
                named.append(typed)
            if others := [one for one in named if one.startswith(_OF_MOTION) and not one.startswith(_QUIET)]:
                self.lost.append(f"{', '.join(others)} of {prim.GetName()}")
        up = np.eye(3)["XYZ".index(str(UsdGeom.GetStageUpAxis(stage)))]
        for scene in (UsdPhysics.Scene(prim) for prim in prims if prim.IsA(UsdPhysics.Scene)):
            down, most = (
                np.array(scene.GetGravityDirectionAttr().Get()),
                scene.GetGravityMagnitudeAttr().Get() * self._length,
            )
            up = -down / np.linalg.norm(down) if down.any() else up
            if 0.0 <= most < math.inf and abs(most + GRAVITY) > NEAR_GRAVITY:
                self._gravity = most
        self._upright = own.SE3(own.Quaternion.FromTwoVectors(up, np.eye(3)[2]).toRotationMatrix(), np.zeros(3))
        joints = [prim for prim in prims if prim.IsA(UsdPhysics.Joint)]
        self._joints = [joint for prim in joints if (joint := self._joint(prim)) is not None]

    def element(self) -> ElementTree.Element:
        """The stage as an SDF document."""
        sdf = ElementTree.Element("sdf", version="1.9")
        world = ElementTree.SubElement(sdf, "world", name="scene")
        if self._gravity is not None:
            ElementTree.SubElement(world, "gravity").text = f"0 0 {-self._gravity!r}"
        model = ElementTree.SubElement(world, "model", name=self._path.stem)
        for path, pose in self._standing().items():
            link = ElementTree.SubElement(model, "link", name=self._names[path])
            ElementTree.SubElement(link, "pose").text = _text(pose)
            self._inertial(link, self._bodies[path])
        for joint in self._joints:
            self._written(model, joint)
        if self.lost:
            log.warning("%s: not represented: %s", self._path, "; ".join(self.lost))
        return sdf

    def _standing(self) -> dict[str, own.SE3]:
        """Poses of the bodies at the zeros of the joints, in a tree of these; its root is where it is."""
        out: dict[str, own.SE3] = {}
        roots = [joint.ends[1] for joint in self._joints if not joint.ends[0]]
        children = {joint.ends[1] for joint in self._joints}
        for path in (*roots, *(path for path in self._bodies if path not in children), *self._bodies):
            if path in out:
                continue
            out[path] = self._pose(self._bodies[path])
            for joint in self._joints:
                if not joint.ends[0] and joint.ends[1] == path:
                    out[path] = joint.poses[0] * joint.poses[1].inverse()
            reached = [path]
            for here in reached:
                for joint, side in itertools.product(self._joints, (0, 1)):
                    other = joint.ends[1 - side]
                    if joint.ends[side] == here and other and other not in out:
                        out[other] = out[here] * joint.poses[side] * joint.poses[1 - side].inverse()
                        reached.append(other)
        return {path: self._upright * pose for path, pose in out.items()}

    def _joint(self, prim: Any) -> UsdJoint | None:
        joint, name = self._physics.Joint(prim), str(prim.GetName())
        if not joint.GetJointEnabledAttr().Get():
            self.lost.append(f"the joint {name}, which is off")
            return None
        kind = KINDS.get(str(prim.GetTypeName()))
        if kind is None:
            reason = f"joint {name!r} is a {prim.GetTypeName()}, which is none of {', '.join(KINDS)}"
            raise self._error(reason)
        ends = [self._body_of(joint.GetBody0Rel(), name), self._body_of(joint.GetBody1Rel(), name)]
        poses = []
        for (path, prefix), position, rotation in (
            (ends[0], joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
            (ends[1], joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
        ):
            place = np.array(position.Get() or (0.0, 0.0, 0.0), dtype=float)
            scale = self._scale(path) if path else np.ones(3)
            poses.append(prefix * own.SE3(_rotation(rotation.Get()), self._length * scale * place))
        if not ends[1][0]:
            # The world is always the parent
            ends, poses = ends[::-1], poses[::-1]
        if not ends[1][0]:
            raise self._error(f"joint {name!r} has no body")
        names = (ends[0][0], ends[1][0])
        return UsdJoint(name, kind, names, (poses[0], poses[1]), prim)

    def _body_of(self, relation: Any, joint: str) -> tuple[str, own.SE3]:
        """(path of the rigid body, pose in it of what a joint names); "" for the world."""
        targets = relation.GetTargets()
        if not targets:
            return "", own.SE3.Identity()
        prim = named = self._stage.GetPrimAtPath(targets[0])
        while prim and str(prim.GetPath()) not in self._bodies and not prim.IsPseudoRoot():
            prim = prim.GetParent()
        if not named:
            raise self._error(f"joint {joint!r} is of {targets[0]}, which is not there")
        if str(prim.GetPath()) not in self._bodies:
            return "", self._pose(named)
        return str(prim.GetPath()), self._pose(prim).inverse() * self._pose(named)

    def _pose(self, prim: Any) -> own.SE3:
        matrix = np.array(self._places.GetLocalToWorldTransform(prim)).T
        turn = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
        return own.SE3(turn, self._length * matrix[:3, 3])

    def _scale(self, path: str) -> Array:
        matrix = np.array(self._places.GetLocalToWorldTransform(self._stage.GetPrimAtPath(path))).T
        return np.asarray(np.linalg.norm(matrix[:3, :3], axis=0))

    def _inertial(self, link: ElementTree.Element, prim: Any) -> None:
        api = self._physics.MassAPI(prim)
        mass = float(api.GetMassAttr().Get() or 0.0) * self._mass if prim.HasAPI(self._physics.MassAPI) else 0.0
        moments = np.array(api.GetDiagonalInertiaAttr().Get() or (0.0, 0.0, 0.0), dtype=float)
        if mass <= 0.0 or not moments.any():
            what = "mass" if mass <= 0.0 else "inertia"
            reason = f"body {prim.GetName()!r} states no {what}; what its shapes would give is not worked out"
            raise self._error(reason)
        center = np.array(api.GetCenterOfMassAttr().Get(), dtype=float)
        center = np.where(np.isfinite(center), center, 0.0) * self._scale(str(prim.GetPath())) * self._length
        turn = api.GetPrincipalAxesAttr().Get()
        turned = np.eye(3) if turn is None or turn.GetLength() == 0.0 else _rotation(turn)
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "pose").text = _text(own.SE3(turned, center))
        ElementTree.SubElement(inertial, "mass").text = repr(mass)
        inertia = ElementTree.SubElement(inertial, "inertia")
        for key, moment in zip(("ixx", "iyy", "izz"), moments * self._mass * self._length**2, strict=True):
            ElementTree.SubElement(inertia, key).text = repr(float(moment))

    def _written(self, model: ElementTree.Element, joint: UsdJoint) -> None:
        prim, turns = joint.prim, joint.kind == "revolute"
        out = ElementTree.SubElement(model, "joint", name=joint.name, type=joint.kind)
        parent, child = joint.ends
        ElementTree.SubElement(out, "parent").text = self._names[parent] if parent else WORLD
        ElementTree.SubElement(out, "child").text = self._names[child]
        ElementTree.SubElement(out, "pose").text = _text(joint.poses[1])
        if joint.kind not in ("revolute", "prismatic"):
            return
        unit = math.radians(1.0) if turns else self._length
        kind = self._physics.RevoluteJoint if turns else self._physics.PrismaticJoint
        one = kind(prim)
        axis = ElementTree.SubElement(out, "axis")
        if (letter := str(one.GetAxisAttr().Get() or "X")) not in ("X", "Y", "Z"):
            raise self._error(f"joint {joint.name!r} has the axis {letter!r}, which is none of X, Y, Z")
        number = "XYZ".index(letter)
        ElementTree.SubElement(axis, "xyz").text = " ".join(str(int(k == number)) for k in range(3))
        limit = ElementTree.SubElement(axis, "limit")
        ends = {"lower": one.GetLowerLimitAttr().Get(), "upper": one.GetUpperLimitAttr().Get()}
        rate = prim.GetAttribute("physxJoint:maxJointVelocity")
        ends["velocity"] = rate.Get() if rate else None
        for key, value in ends.items():
            if value is not None and math.isfinite(value):
                ElementTree.SubElement(limit, key).text = repr(float(value) * unit)
        drive = self._physics.DriveAPI.Get(prim, "angular" if turns else "linear")
        force = drive.GetMaxForceAttr().Get() if drive else None
        if force is not None and math.isfinite(force):
            # kg m^2/s^2 of an angular drive, kg m/s^2 of a linear one
            ElementTree.SubElement(limit, "effort").text = repr(
                float(force) * self._mass * self._length ** (2 if turns else 1)
            )

    def _error(self, reason: str) -> RobotFileError:
        return RobotFileError("robot", str(self._path), reason)


def _unique(names: list[str], paths: list[str]) -> Iterator[str]:
    """Names of prims, with their paths where several have one name."""
    for name, path in zip(names, paths, strict=True):
        yield name if names.count(name) == 1 else path.strip("/").replace("/", "_")


def _rotation(quaternion: Any) -> Array:
    if quaternion is None:
        return np.eye(3)
    numbers = np.array([*quaternion.GetImaginary(), quaternion.GetReal()], dtype=float)
    return np.asarray(own.Quaternion(numbers / np.linalg.norm(numbers)).toRotationMatrix())


def _text(pose: own.SE3) -> str:
    numbers = [*pose.translation.tolist(), *own.rpy.matrixToRpy(pose.rotation).tolist()]
    return " ".join(map(repr, numbers))
