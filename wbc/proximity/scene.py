"""The bodies of some pairs in one Pinocchio geometry model, and the distances of the pairs."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING

import numpy as np

# isort: split
import pinocchio as pin

# isort: split
import coal

from wbc.proximity import memory
from wbc.proximity.body import Body, Pair, joint_of
from wbc.proximity.geometry import Geometry, geometry_of
from wbc.proximity.judge import Judge
from wbc.proximity.memory import Index
from wbc.shapes import HalfSpace, Shape
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot import Robot

#: Tolerance of GJK, and of EPA (overlap), in parts of the robot's characteristic length. At 1e-6 GJK is off by more
#: than 1e-5 m on cylinders about once in a thousand times, at 1e-8 by less than 2e-5 m in 30 000; at 1e-8 EPA fails.
GJK_TOLERANCE = 1e-8
EPA_TOLERANCE = 1e-6

#: A turn of a half-space counts as if nothing of the others were farther from the middle of its boundary [m].
ENDLESS = 1e4


class Scene:
    """Bodies, placed by the configuration and by the pose of what moves from outside, and their pairs.

    Attributes:
        bodies: every body once, in the order in which the pairs name them.
        joints: numbers of the joints that carry them.
        first, second: numbers of the bodies A and B of every pair.
        results: signed distance, unit normal from A to B, and a point of the line through both witness points, of
            every pair at its last :meth:`measure`.
        supports: support functions of the bodies.
        shifts: centres of the bodies' bounding spheres in the frames of their shapes [m].
        radii: of the bounding spheres of both bodies of a pair together [m]; 0 for a half-space.
        gaps: signed distances of the watched pairs at their last :meth:`measure` [m], in the order of :meth:`watch`.
        doubtful: Coal's normal did not hold, or the opposite one holds as well; see :mod:`wbc.proximity.judge`.
    """

    def __init__(self, robot: Robot, pairs: list[Pair], moving: frozenset[str]) -> None:
        self.robot = robot
        self.bodies: list[Body] = list(dict.fromkeys(body for pair in pairs for body in pair))
        number = {body: k for k, body in enumerate(self.bodies)}
        self.first = np.array([number[a] for a, _ in pairs], dtype=np.intp)
        self.second = np.array([number[b] for _, b in pairs], dtype=np.intp)
        self.joints = [joint_of(robot, body, moving) for body in self.bodies]
        geometries = _geometries(self.bodies)
        self._robot_data = robot.model.createData()
        self._model = pin.GeometryModel()
        for k, body in enumerate(self.bodies):
            place = self._on_joint(body, moving) * geometries[k].offset
            self._add(self.joints[k], place, geometries[k])
        self._outside = [
            (self._model.geometryObjects[k], body.placement * geometries[k].offset)
            for k, body in enumerate(self.bodies)
            if body.frame in moving
        ]
        # Pairs of two balls that pad the vector of results at both ends, see Results; never measured
        pads = [self._add(0, pin.SE3.Identity(), geometries[0]) for _ in range(3)]
        ends = ((pads[0], pads[1]), (pads[1], pads[2]))
        numbers = zip(self.first.tolist(), self.second.tolist(), strict=True)
        for a, b in (ends[0], *numbers, ends[1]):
            self._model.collisionPairs.append(pin.CollisionPair(a, b))
        self._data = self._model.createData()
        self._data.deactivateAllCollisionPairs()
        self._active = np.zeros(len(pairs), dtype=bool)
        self._every: Index = np.arange(len(pairs))
        self._configure(robot.characteristic_length)
        self.results = memory.Results(self._data, memory.offsets())
        self._prepare_bounds(geometries, moving)
        self.watch(None)
        self._judge = Judge(self, [g.geometry for g in geometries], [g.center for g in geometries])
        self.doubtful, self.supports = self._judge.doubtful, self._judge.supports
        self.shifts = [g.center for g in geometries]

    @property
    def has_outside(self) -> bool:
        """Whether a body moves from outside."""
        return bool(self._outside)

    def move(self, pose: pin.SE3) -> None:
        """Put what moves from outside at a pose."""
        for item, local in self._outside:
            item.placement = pose * local

    def place(self, q: Array) -> None:
        """Forward kinematics, and the bodies with it."""
        pin.updateGeometryPlacements(self.robot.model, self._robot_data, self._model, self._data, q)
        if self._copied:
            for k in range(len(self.bodies)):
                self.centers[k], self.rotations[k] = self._data.oMg[k].translation, self._data.oMg[k].rotation

    def settle(self) -> None:
        """Take the bodies' present places as those that :meth:`moved` and :meth:`moved_bodies` start from."""
        self._rest[:] = self.poses

    def moved(self) -> float:
        """No pair has come closer than since :meth:`settle` by more than this [m]."""
        squares = self._squares()
        return self._parties * math.sqrt(squares.item(squares.argmax()))

    def moved_bodies(self) -> Array:
        """No point of a body has moved since :meth:`settle` by more than this [m], number by number of the bodies."""
        return np.asarray(np.sqrt(self._squares()))

    def _squares(self) -> Array:
        """2 |change of centre|^2 + (radius |change of rotation|)^2, of which the root is at least the sum of both."""
        np.subtract(self.poses, self._rest, out=self._change)
        np.multiply(self._change, self._scale, out=self._change)
        np.multiply(self._change, self._change, out=self._change)
        return self._change.dot(self._ones, out=self._square)

    def lower_bounds(self) -> Array:
        """No pair is closer than this [m]: bounding spheres, over planes where there are half-spaces. Overwritten by
        the next call.
        """
        self.centers.take(self.first, axis=0, out=self._from, mode="clip")
        self.centers.take(self.second, axis=0, out=self._to, mode="clip")
        np.subtract(self._to, self._from, out=self._to)
        np.multiply(self._to, self._to, out=self._to)
        self._to.dot(self._ones[:3], out=self._bound)
        np.sqrt(self._bound, out=self._bound)
        np.subtract(self._bound, self.radii, out=self._bound)
        if len(self._over):
            axes = self.rotations[self._planes, :, 2]
            height = np.einsum("ij,ij->i", axes, self.centers[self._floating] - self.centers[self._planes])
            self._bound[self._over] = height - self.radii[self._over]
        return self._bound

    def watch(self, which: Index | None) -> None:
        """Choose the pairs that :meth:`measure` measures, and their order (None: all)."""
        wanted = np.ones(len(self._active), dtype=bool)
        if which is not None:
            wanted[:] = False
            wanted[which] = True
        for k in (wanted != self._active).nonzero()[0].tolist():
            if wanted[k]:
                self._data.activateCollisionPair(k + 1)
            else:
                self._data.deactivateCollisionPair(k + 1)
        self._active = wanted
        self._measured = self._every if which is None else which
        self._where = self.results.start[self._measured] + self.results.gap
        self.gaps: Array = np.zeros(len(self._measured))

    def measure(self) -> Array:
        """Exact distances of the watched pairs at the bodies' present places: :attr:`gaps`."""
        pin.computeDistances(self._model, self._data)
        self.results.refresh(self._measured)
        self._read()
        if self._judge.check(self._measured, self.gaps):
            self._read()
        return self.gaps

    def _read(self) -> None:
        # Not "raise", with which numpy takes into a copy; all numbers are valid
        self.results.numbers.take(self._where, out=self.gaps, mode="clip")

    def _add(self, joint: int, place: pin.SE3, geometry: Geometry) -> int:
        name = str(self._model.ngeoms)
        return int(self._model.addGeometryObject(pin.GeometryObject(name, joint, place, geometry.geometry)))

    def _on_joint(self, body: Body, moving: frozenset[str]) -> pin.SE3:
        if body.frame == WORLD or body.frame in moving:
            return body.placement
        frame = self.robot.model.frames[frame_index(self.robot.model, body.frame)]
        return frame.placement * body.placement

    def _configure(self, length: float) -> None:
        """GJK starts from the line between the centres: as quick as from its last answer (0 to 12 % slower for hulls,
        a third quicker than from a fixed direction), and what is measured depends on the places alone.
        """
        with warnings.catch_warnings():
            # Pinocchio sets the old switch for starting from the last answer; there is no other way to unset it
            warnings.simplefilter("ignore", DeprecationWarning)
            for request in self._data.distanceRequests:
                request.enable_cached_gjk_guess = False
                request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
                request.enable_signed_distance = True
                request.gjk_tolerance, request.epa_tolerance = GJK_TOLERANCE * length, EPA_TOLERANCE * length

    def _prepare_bounds(self, geometries: list[Geometry], moving: frozenset[str]) -> None:
        count, bodies = len(self.first), range(len(self.bodies))
        poses = memory.poses([self._data.oMg[k] for k in bodies])
        self._copied = poses is None
        #: rotation, column by column, and centre of the bodies' geometries in the world
        self.poses: Array = np.zeros((len(bodies), 12)) if poses is None else poses
        self.centers = self.poses[:, 9:]
        self.rotations = np.lib.stride_tricks.as_strided(
            self.poses, shape=(len(bodies), 3, 3), strides=(self.poses.strides[0], 8, 24)
        )
        radius = np.array([g.radius for g in geometries])
        flat = np.array([isinstance(body.shape, HalfSpace) for body in self.bodies])
        self._over = np.flatnonzero(flat[self.first] | flat[self.second])
        swapped = flat[self.first[self._over]]
        self._planes = np.where(swapped, self.first[self._over], self.second[self._over])
        self._floating = np.where(swapped, self.second[self._over], self.first[self._over])
        finite = np.where(flat, 0.0, radius)
        self.radii = finite[self.first] + finite[self.second]
        still = np.array([self.joints[k] == 0 and self.bodies[k].frame not in moving for k in bodies])
        self._parties = 1.0 if (still[self.first] | still[self.second]).all() else 2.0
        # A turn by an angle a changes the rotation by 2 sqrt(2) sin(a/2), and moves nothing by more than 2 r sin(a/2)
        self._scale = np.full((len(bodies), 12), np.sqrt(2.0))
        self._scale[:, :9] = np.where(flat, ENDLESS, radius)[:, None]
        self._rest, self._change = np.zeros((len(bodies), 12)), np.zeros((len(bodies), 12))
        self._square, self._ones = np.zeros(len(bodies)), np.ones(12)
        self._from, self._to, self._bound = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)


def _geometries(bodies: list[Body]) -> list[Geometry]:
    """Equal shapes share a geometry."""
    known: dict[Shape, Geometry] = {}
    for body in bodies:
        if body.shape not in known:
            known[body.shape] = geometry_of(body.shape)
    return [known[body.shape] for body in bodies]
