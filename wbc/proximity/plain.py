"""The same as :mod:`wbc.proximity.native` where there is no compiler: Coal, asked pair by pair, and numpy."""

from __future__ import annotations

from typing import Any

import numpy as np

# isort: split
import pinocchio as pin

# isort: split
import coal

from wbc.proximity.choice import OFF, Choice
from wbc.proximity.corners import NEAR, CornerDistances
from wbc.proximity.judge import Judge
from wbc.proximity.missing import Missing
from wbc.proximity.rows import PairRows
from wbc.proximity.scene import TIE, Index, PairScene
from wbc.robot.geometry.coal_shapes import geometry_of
from wbc.shapes import FAR, HalfSpace, Shape
from wbc.validation import Array

#: Tolerance of GJK, and of EPA (overlap), in parts of the robot's characteristic length. At 1e-6 GJK is off by more
#: than 1e-5 m on cylinders about once in a thousand times, at 1e-8 by less than 2e-5 m in 30 000; at 1e-8 EPA fails.
GJK_TOLERANCE = 1e-8
EPA_TOLERANCE = 1e-6


class PlainSensing:
    """A scene, its rows and what was measured.

    Attributes:
        scene: bodies and pairs.
        rows: what is written, or None where nothing is.
        pairs: number of the pair of each row, -1 without.
        distances, normals, points: of every pair at its last measurement: signed distance, unit normal from A to B, and
            a point of the line through both witness points.
        doubtful: the normal is a declared one; see :mod:`wbc.proximity.judge`.
        measured: how many pairs the last call measured.
        urgent: which pairs come before others, see :class:`wbc.proximity.missing.Missing`.
        poses: rotation, column by column, and centre of the bodies in the world; ``rotations`` and ``centers`` show the
            same numbers.
        geometries: Coal's, body by body.
        supports: support functions of the bodies.
    """

    def __init__(self, scene: PairScene, rows: PairRows | None = None) -> None:
        self.scene, self.rows = scene, rows
        pairs = len(scene.first)
        self.distances, self.normals, self.points = np.zeros(pairs), np.zeros((pairs, 3)), np.zeros((pairs, 3))
        self.measured = 0
        self.poses = np.zeros((len(scene.bodies), 12))
        self.rotations = self.poses[:, :9].reshape(-1, 3, 3).transpose(0, 2, 1)
        self.centers = self.poses[:, 9:]
        self.geometries = _geometries(scene)
        self._data = scene.robot.model.createData()
        self._outside, self._transforms = pin.SE3.Identity(), [coal.Transform3s() for _ in scene.bodies]
        self._q = scene.robot.neutral
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        length = scene.robot.characteristic_length
        self._request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
        self._request.gjk_tolerance, self._request.epa_tolerance = GJK_TOLERANCE * length, EPA_TOLERANCE * length
        self.tie, self.off = TIE * length, OFF * length
        flat = np.array([isinstance(body.shape, HalfSpace) for body in scene.bodies])
        self._planes: Index = np.flatnonzero(flat[scene.first] | flat[scene.second])
        self._radii = np.where(flat, 0.0, scene.radii)
        self._judge = Judge(self)
        self.doubtful, self.supports = self._judge.doubtful, self._judge.supports
        self._missing = Missing(self)
        self.urgent = self._missing.urgent
        self._choice = Choice(self, 0 if rows is None else rows.count, self.urgent)
        self.pairs = self._choice.pairs
        self._corners = CornerDistances(self, rows.corners) if rows is not None and rows.corners else None

    def reset(self) -> None:
        """Forget the rows."""
        self.pairs[:], self.urgent[:] = -1, 0

    def measure(self, q: Array, pose: pin.SE3) -> None:
        """All pairs."""
        self._outside = pose
        self._place(q)
        self.ask(np.arange(len(self.distances)))

    def sense(self, q: Array) -> None:
        """Measure and write the rows."""
        assert self.rows is not None
        if self.rows.pose is not None:
            self._outside = pin.SE3(self.rows.pose[:9].reshape(3, 3).T, self.rows.pose[9:])
        self._place(q)
        self._choice.update()
        self._write(self.rows)

    def missing(self, v: Array, dt: float, braking: Array) -> int:
        """See :meth:`wbc.proximity.sensor.PairSensor.missing`; at the configuration of the last :meth:`sense`."""
        return self._missing(self._q, v, dt, braking, self._outside_twist())

    def gaps(self, which: Index) -> Array:
        """Distances of some pairs as they count for the margin [m]."""
        return self.distances[which] + (0.0 if self.rows is None else self.rows.extra(which))

    def rows_of(self, pair: int) -> tuple[Array, Array]:
        """(distances, lines) of the nearest points of a pair that was measured; where it is near, of its corners."""
        gaps, normal = self.gaps(np.array([pair])), self.normals[pair]
        lines = np.concatenate([normal, np.cross(self.points[pair], normal)])
        if self._corners is None or gaps[0] >= self._near_limit():
            return gaps, lines[None]
        more, others = self._corner_rows(pair)
        there = more < FAR
        return np.concatenate([gaps, more[there]]), np.vstack([lines, others[there]])

    def _corner_rows(self, pair: int) -> tuple[Array, Array]:
        """(distances, lines) of a pair's nearest corners, see :class:`CornerDistances`."""
        assert self.rows is not None
        assert self._corners is not None
        gaps, lines = self._corners.measure(pair)
        return np.where(gaps < FAR, gaps + self.rows.extra(np.array([pair])), FAR), lines

    def _near_limit(self) -> float:
        """Pairs no farther apart than this have rows for corners [m]."""
        assert self.rows is not None
        return self.rows.margin.item() + NEAR * self.scene.robot.characteristic_length

    def _outside_twist(self) -> Array:
        """Of what moves from outside, at the world's origin."""
        assert self.rows is not None
        if self.rows.velocity is None or self.rows.pose is None:
            return np.zeros(6)
        return twist_at_origin(self.rows.velocity, self.rows.pose[9:])

    def bounds(self) -> Array:
        """No pair is closer than this [m]: bounding spheres, over planes where there are half-spaces."""
        scene = self.scene
        offset = self.centers[scene.second] - self.centers[scene.first]
        out: Array = np.linalg.norm(offset, axis=1) - self._radii[scene.first] - self._radii[scene.second]
        for k in self._planes.tolist():
            a, b = int(scene.first[k]), int(scene.second[k])
            plane, body, sign = (a, b, 1.0) if isinstance(scene.bodies[a].shape, HalfSpace) else (b, a, -1.0)
            out[k] = sign * self.rotations[plane, :, 2] @ offset[k] - self._radii[body]
        return out

    def ask(self, which: Index) -> Array:
        """Distances of some pairs at the bodies' present places."""
        self.measured = len(which)
        for k in which.tolist():
            a, b = int(self.scene.first[k]), int(self.scene.second[k])
            found = self.distance(a, self._transforms[a], b, self._transforms[b])
            self.distances[k], self.normals[k], self.points[k] = found
        self._judge.check(which)
        return self.distances[which]

    def distance(self, a: int, at: Any, b: int, there: Any) -> tuple[float, Array, Array]:
        """(distance, normal, witness on A) of two bodies at some places, as Coal says."""
        self._result.clear()
        gap = coal.distance(self.geometries[a], at, self.geometries[b], there, self._request, self._result)
        return gap, np.array(self._result.normal), self._result.getNearestPoint1()

    def _place(self, q: Array) -> None:
        self._q, scene = q.copy(), self.scene
        pin.forwardKinematics(scene.robot.model, self._data, q)
        for k, (joint, local) in enumerate(zip(scene.joints, scene.places, strict=True)):
            pose = (self._outside if scene.moving[k] else self._data.oMi[joint]) * local
            self.rotations[k], self.centers[k] = pose.rotation, pose.translation
            self._transforms[k] = coal.Transform3s(pose.rotation, pose.translation)

    def _write(self, rows: PairRows) -> None:
        at = np.flatnonzero(self.pairs >= 0)
        pairs = self.pairs[at]
        rows.distance[at] = self.gaps(pairs)
        line, side = rows.line.reshape(-1, 6), rows.side.reshape(len(rows.distance), -1)
        line[at, :3], line[at, 3:] = self.normals[pairs], np.cross(self.points[pairs], self.normals[pairs])
        side[at] = rows.pair_side[pairs]
        if self._corners is not None:
            more = slice(rows.count, None)
            rows.distance[more], rows.line[6 * rows.count :], side[more] = FAR, 0.0, 0.0
            near = at[rows.distance[at] < self._near_limit()]
            if len(near):
                found = [self._corner_rows(pair) for pair in self.pairs[near].tolist()]
                gaps, lines = (np.array(parts) for parts in zip(*found, strict=True))
                places = rows.count + rows.corners * near[:, None] + np.arange(rows.corners)
                rows.distance[places], line[places] = gaps, lines
                side[places] = np.where(gaps[:, :, None] < FAR, rows.pair_side[self.pairs[near], None], 0.0)
        rows.drift[:] = 0.0
        if rows.velocity is not None:
            outward = np.where(self.pairs >= 0, self.scene.outward[self.pairs], 0.0)
            rows.drift[:] = line @ self._outside_twist() * np.concatenate([outward, np.repeat(outward, rows.corners)])


def twist_at_origin(velocity: Array, origin: Array) -> Array:
    """A twist (linear; angular) in world axes, taken from one point of the body to its point at the world's origin."""
    return np.concatenate([velocity[:3] + np.cross(origin, velocity[3:]), velocity[3:]])


def _geometries(scene: PairScene) -> list[Any]:
    """Equal shapes share a geometry."""
    known: dict[Shape, Any] = {}
    for body in scene.bodies:
        if body.shape not in known:
            known[body.shape] = geometry_of(body.shape).geometry
    return [known[body.shape] for body in scene.bodies]
