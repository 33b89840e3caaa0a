"""What is climbed: footholds, the bodies that they are on and that are in the way, and gravity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi
from typing import Any

import numpy as np

from wbc import pickling, validation
from wbc.clearance import TriangleMesh
from wbc.clearance.scene import Shape, Unbounded
from wbc.climb.climber import Climber
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnknownNameError
from wbc.geometry.kernel import segments_from
from wbc.multibody import pin
from wbc.robot.recipe import segment_shape
from wbc.shapes import PlacedShape, Solid
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

#: From a frame whose z axis is the way to a surface to the one with its outward normal
FLIP = pin.SE3(pin.utils.rotate("x", pi), np.zeros(3))
#: An axis and a reference closer to each other than this [rad] leave the turn about the axis undetermined
LEAST_ANGLE = 1e-6
#: A scene whose footholds are all within this share of a robot's span is of another scale [1]
LEAST_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Foothold:
    """A place at which a limb can hold: a frame in the world.

    Attributes:
        id: unique in a scene.
        pose: origin at the point of contact [m], z the outward normal of the surface, x the roll reference.
        on: id of the body that it is on, which a limb at it may touch; "" where it is on none.
        friction: Coulomb's coefficient of the surface here [1]; infinite: the limb's own counts alone.
        limbs: names of limbs that may hold it; empty for all.
        rolls: about z a limb that holds it may be turned against x by any multiple of 2 pi / ``rolls``; 0: by any
            angle. A limb whose contact is free to turn about z, as that of a hand that rolls, is not bound by it.

    Raises:
        ShapeError, NotFiniteError, RotationError: no name, pose or names. RangeError: friction that is not above 0, or
            a number of turns that is none.
    """

    id: str
    pose: pin.SE3
    on: str = ""
    friction: float = np.inf
    limbs: tuple[str, ...] = ()
    rolls: int = 0

    def __post_init__(self) -> None:
        validation.name("Foothold.id", self.id)
        object.__setattr__(self, "pose", validation.pose("Foothold.pose", self.pose))
        validation.instance("Foothold.on", self.on, str, "the id of a body, or an empty text")
        validation.own_scalars(self, "friction", low=0.0, open_low=True, infinite=True)
        object.__setattr__(self, "limbs", validation.strings("Foothold.limbs", self.limbs))
        object.__setattr__(self, "rolls", validation.integer("Foothold.rolls", self.rolls))


@dataclass(frozen=True, eq=False)
class SceneBody:
    """A shape at a pose in the world; as :class:`wbc.shapes.PlacedShape`, of any shape that distances are known of.

    Attributes:
        shape: a solid, a half-space, a mesh, or a cylinder without end.
        placement: in the world [m].

    Raises:
        ShapeError: no such shape. NotFiniteError, RotationError: no pose.
    """

    shape: Shape
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)

    def __post_init__(self) -> None:
        if not isinstance(self.shape, (Solid, TriangleMesh, Unbounded)):
            raise ShapeError("SceneBody.shape", self.shape, "expected a solid, a mesh or a shape without end")
        object.__setattr__(self, "placement", validation.pose("SceneBody.placement", self.placement))

    def distances(self, points: Array) -> Array:
        """Distances of points of the world ``(n, 3)`` from the shape, negative within it ``(n)`` [m]."""
        local = (points - self.placement.translation) @ self.placement.rotation
        return segments_from(self.shape, local, local)


@dataclass(frozen=True, eq=False)
class ClimbScene:
    """Footholds and bodies in the world.

    Attributes:
        footholds: at least one, ids unique.
        bodies: id -> a shape at its pose in the world, which links must not enter.
        gravity: acceleration [m/s^2], 3 numbers.
        name: short.

    Raises:
        ShapeError: no footholds, things of another type, gravity that is not three numbers. DuplicateNameError: two
            footholds of one id. UnknownNameError: a foothold on a body that is not there. NotFiniteError: gravity.
    """

    footholds: Sequence[Foothold]
    bodies: Mapping[str, PlacedShape | SceneBody] = field(default_factory=dict)
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    name: str = "scene"

    def __post_init__(self) -> None:
        footholds = validation.items("ClimbScene.footholds", self.footholds, "Footholds")
        bodies = validation.mapping("ClimbScene.bodies", self.bodies, "ids to bodies")
        for body, placed in bodies.items():
            validation.instance(f"ClimbScene.bodies, {body}", placed, (PlacedShape, SceneBody), "a SceneBody")
        if not footholds:
            raise ShapeError("ClimbScene.footholds", (), "there is no foothold, so no limb can hold anywhere")
        known = set[str]()
        for foothold in footholds:
            validation.instance("ClimbScene.footholds", foothold, Foothold, "Footholds")
            if foothold.id in known:
                raise DuplicateNameError("ClimbScene.footholds", foothold.id, "two of this id")
            known.add(foothold.id)
            if foothold.on and foothold.on not in bodies:
                raise UnknownNameError(f"foothold {foothold.id}: on", foothold.on, sorted(bodies))
        gravity = validation.ordinary_array("ClimbScene.gravity", self.gravity, (3,))
        for name, value in (("footholds", footholds), ("bodies", bodies), ("gravity", gravity)):
            object.__setattr__(self, name, value)
        validation.name("ClimbScene.name", self.name)

    def __getstate__(self) -> dict[str, Any]:
        return pickling.declared(self)

    @cached_property
    def positions(self) -> Array:
        """Points of contact ``(footholds, 3)`` [m]."""
        return np.array([foothold.pose.translation for foothold in self.footholds])

    @cached_property
    def normals(self) -> Array:
        """Outward normals ``(footholds, 3)``."""
        return np.array([foothold.pose.rotation[:, 2] for foothold in self.footholds])

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {foothold.id: k for k, foothold in enumerate(self.footholds)}

    def row(self, foothold: str) -> int:
        """Row of a foothold.

        Raises:
            UnknownNameError: no such foothold; the nearest ids come first.
        """
        if foothold not in self._rows:
            raise UnknownNameError("foothold", foothold, self._rows)
        return self._rows[foothold]

    def without(self, *ids: str) -> ClimbScene:
        """The scene less some footholds; rows of others change.

        Raises:
            UnknownNameError: no such foothold. ShapeError: none would be left.
        """
        gone = {self.row(foothold) for foothold in ids}
        return replace(self, footholds=tuple(f for k, f in enumerate(self.footholds) if k not in gone))

    def held_by(self, limbs: Sequence[str]) -> ClimbScene:
        """The scene whose footholds only some limbs may hold, by name; those that none of them may are left out.

        Raises:
            ShapeError: none would be left.
        """
        names = validation.strings("limbs", tuple(limbs))
        some = []
        for foothold in self.footholds:
            able = tuple(name for name in names if not foothold.limbs or name in foothold.limbs)
            if able:
                some.append(replace(foothold, limbs=able))
        return replace(self, footholds=some)

    def moved(self, pose: Any) -> ClimbScene:
        """The scene moved by a pose in the world; gravity stays.

        Raises:
            ShapeError, NotFiniteError, RotationError: no pose.
        """
        by = validation.pose("pose", pose)
        bodies = {name: SceneBody(body.shape, by * body.placement) for name, body in self.bodies.items()}
        return replace(self, footholds=[replace(f, pose=by * f.pose) for f in self.footholds], bodies=bodies)


def bar(a: Any, b: Any, radius: float) -> SceneBody:
    """A capsule of a radius about the segment between two points of the world [m]."""
    shape = segment_shape(np.array(a), np.array(b), radius, 0.0)
    return SceneBody(shape.shape, shape.placement)


def frame_along(field: str, position: Any, axis: Any, reference: Any) -> pin.SE3:
    """The frame with z along ``axis`` and x along the part of ``reference`` across it.

    Raises:
        ShapeError, NotFiniteError: not three finite numbers each.
        RangeError: a direction of no length, or two that are parallel within 1e-6 rad.
    """
    z, x = validation.unit_vector(f"{field}.axis", axis), validation.unit_vector(f"{field}.reference", reference)
    across = x - (x @ z) * z
    if np.linalg.norm(across) < LEAST_ANGLE:
        raise RangeError(f"{field}.reference", reference, "parallel to the z axis: the x axis is undetermined")
    across = across / np.linalg.norm(across)
    # Once more, so that the frame is orthonormal to the last digits
    across = across - (across @ z) * z
    across = across / np.linalg.norm(across)
    rotation = np.column_stack([across, np.cross(z, across), z])
    return pin.SE3(rotation, validation.real_array(f"{field}.position", position, (3,)))


def reaches(climber: Climber) -> Array:
    """How far each limb's contact is from the body's origin at most, joints without limits ``(limbs)`` [m]."""
    model, out = climber.robot.model, []
    for limb, chain in zip(climber.limbs, climber.chains, strict=True):
        tip = model.frames[frame_index(model, limb.frame)].placement * limb.placement
        joints = [int(j) for j in model.supports[model.frames[frame_index(model, limb.frame)].parentJoint] if j > 1]
        steps = [float(np.linalg.norm(model.jointPlacements[j].translation)) for j in joints]
        slides = [
            float(np.abs(high - low))
            for low, high, j in zip(*climber.limits[climber.row(limb.name)], chain, strict=False)
            if "P" in model.joints[j].shortname().removeprefix("JointModel")[:1] and np.isfinite(high - low)
        ]
        out.append(sum(steps) + sum(slides) + float(np.linalg.norm(tip.translation)))
    return np.array(out)


def size_of(climber: Climber) -> float:
    """The reach of a climber's shortest limb [m], at which :func:`draw` makes scenes for it."""
    return float(reaches(climber).min())


def check_scale(climber: Climber, scene: ClimbScene) -> None:
    """Refuses footholds on which no two limbs can be at once, or that are all under one limb, as of other units.

    Raises:
        RangeError: with the distance between footholds next to each other and the robot's span.
    """
    if len(scene.footholds) < 2:
        return
    from scipy.spatial import cKDTree

    ordered = np.sort(reaches(climber))
    span = float(ordered[-2:].sum())
    nearest = float(cKDTree(scene.positions).query(scene.positions, k=2)[0][:, 1].min())
    field_name, extent = f"scene {scene.name}", float(np.linalg.norm(np.ptp(scene.positions, axis=0)))
    if nearest > span:
        reason = f"no two footholds are nearer than {nearest:.4g} m, and no two limbs of the robot are further apart "
        raise RangeError(field_name, nearest, reason + f"than {span:.4g} m: lengths are in metres")
    if len(scene.footholds) > len(climber.limbs) and extent < LEAST_SHARE * span:
        reason = f"all footholds are within {extent:.4g} m, and the robot spans {span:.4g} m: lengths are in metres"
        raise RangeError(field_name, extent, reason)
