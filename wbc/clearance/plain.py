"""The same as :mod:`wbc.clearance.native` where there is no compiler: numpy, and Coal for what has no closed form."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, inf, pi
from typing import Any

import numpy as np

# isort: split
import pinocchio as pin

# isort: split
import coal

from wbc.clearance.motion import Motion
from wbc.clearance.scene import INSIDE, OUTSIDE, PLANE, SUM, TRIANGLES, SweptScene, sizes_of
from wbc.clearance.tree import Moves
from wbc.proximity.judge import declared
from wbc.proximity.scene import Index
from wbc.proximity.support import Supports, clearance
from wbc.robot.geometry.coal_shapes import geometry_of
from wbc.shapes import Convex, Cylinder
from wbc.validation import Array

#: As in native/sweep.c and native/distance.h
HALVES, EDGES = 48, 256
ANY, LEAST = 2, 1
#: What Coal's distances of triangles, which no normal proves here, may be too large by [m]
SLOP = 1e-6


class PlainSweep:
    """A scene; see :class:`wbc.clearance.native.NativeSweep`. Pieces of the motion are halved level by level."""

    def __init__(self, scene: SweptScene) -> None:
        self.scene = scene
        self.low, self.high, self.when = (np.zeros(len(scene.pairs)) for _ in range(3))
        self.measured = (0, 0)
        self._size = np.array([sizes_of(body.shape) for body in scene.bodies]).reshape(-1, 6)
        self._round = (scene.kind == SUM) & (self._size[:, [0, 1, 3]] == 0.0).all(axis=1)
        self._places = [pin.SE3(pose) for pose in scene.place]
        self._solids = Solids()

    def sweep(
        self, motion: Motion, chosen: Array, exempt: Sequence[Any], aim: int, tolerance: float, far: float
    ) -> int | None:
        """As :meth:`wbc.clearance.native.NativeSweep.sweep`."""
        self._motion, self._exempt = motion, exempt
        self.low[chosen], self.high[chosen], self.when[chosen] = inf, inf, 0.0
        pieces = np.array([[0.0, len(motion.times) - 1.0, 0.0, 1.0, 0.0]])
        piece, pair = np.zeros(len(chosen), dtype=np.intp), np.asarray(chosen, dtype=np.intp)
        exact = nodes = 0
        while len(pair):
            nodes += len(pieces)
            here = _Pieces(self.scene, motion, pieces)
            again, count = self._look(here, piece, pair, aim, tolerance, far)
            exact += count
            self.measured = exact, nodes
            if aim == ANY and (self.high[chosen] < 0.0).any():
                return int(chosen[int(np.argmin(self.high[chosen]))])
            kept, row = np.unique(piece[again], return_inverse=True)
            pieces = np.concatenate([_halves(pieces[kept], side) for side in (0, 1)])
            piece, pair = np.concatenate([row, row + len(kept)]), np.concatenate([pair[again], pair[again]])
        return None

    def at(self, pair: int, knots: float) -> Array:
        """As :meth:`wbc.clearance.native.NativeSweep.at`."""
        k = min(int(knots), len(self._motion.times) - 2)
        here = _Pieces(self.scene, self._motion, np.array([[k, k + 1.0, knots - k, knots - k, 0.0]]))
        gap, points = self._exact(here, 0, pair)
        return np.array([gap, *points.ravel(), self._margin(here, 0, pair, gap, knots, knots)])

    def _look(
        self, here: _Pieces, piece: Index, pair: Index, aim: int, tolerance: float, far: float
    ) -> tuple[Array, int]:
        """Which rows (of a piece and a pair) must be looked at in halves, and how many exact distances that took."""
        scene, i, j = self.scene, self.scene.first[pair].astype(np.intp), self.scene.second[pair].astype(np.intp)
        one, two = (
            here.moved(piece, body, stop) for body, stop in ((i, scene.stops[pair, 0]), (j, scene.stops[pair, 1]))
        )
        off, rest = one[:, 0] + two[:, 0], one[:, 0] + two[:, 0] - one[:, 1] - two[:, 1]
        segment = segment_points(*(here.ends[body, piece, end] for body in (i, j) for end in (0, 1)))
        between = np.linalg.norm(segment[0] - segment[1], axis=1)
        gap = between - scene.line[i, 6] - scene.line[j, 6]
        walls = np.isin(scene.kind, (PLANE, INSIDE, OUTSIDE))
        rough = np.where(walls[i] | walls[j], -inf, gap)
        quick = rough - scene.required[pair]
        again, count = np.zeros(len(pair), dtype=bool), 0
        ends = (rest <= tolerance) | (here.pieces[piece, 4] >= HALVES)
        for row in range(len(pair)):
            p, n = int(pair[row]), int(piece[row])
            if quick[row] - off[row] >= self._enough(p, aim, tolerance, far):
                self.low[p] = min(self.low[p], quick[row] - off[row])
                continue
            plain = self._round[i[row]] and self._round[j[row]]
            exact = float(gap[row]) if plain else self._exact(here, n, p)[0]
            count += 1
            first, last, middle = here.pieces[n, 0], here.pieces[n, 1], here.middle[n]
            span = (first, last) if here.whole[n] else (middle, middle)
            mine, all_ = (self._margin(here, n, p, exact, *times) for times in ((middle, middle), span))
            if mine < self.high[p]:
                self.high[p], self.when[p] = mine, middle
            cut = all_ < mine and self._changes(p, first, last)
            if all_ - off[row] < self._enough(p, aim, tolerance, far) and (not ends[row] or cut):
                again[row] = True
            else:
                self.low[p] = min(self.low[p], all_ - off[row])
        return again, count

    def _enough(self, pair: int, aim: int, tolerance: float, far: float) -> float:
        least = self.high.min() if aim == LEAST else self.high[pair]
        return min(far, float(least) - tolerance)

    def _margin(self, here: _Pieces, n: int, pair: int, gap: float, since: float, until: float) -> float:
        out = gap - float(self.scene.required[pair])
        for which, first, last, side, numbers in self._exempt:
            if which != pair or since < first or until > last:
                continue
            hand = int((self.scene.second if side else self.scene.first)[pair])
            point = here.point(n, int(self.scene.frame[hand]), numbers[:3])
            off = float(np.linalg.norm(point - numbers[3:6]))
            out = max(out, min(gap + numbers[7], numbers[6] - off))
        return out

    def _changes(self, pair: int, first: float, last: float) -> bool:
        return any(
            which == pair and any(first < knot < last for knot in (begins, ends))
            for which, begins, ends, _, _ in self._exempt
        )

    def _exact(self, here: _Pieces, n: int, pair: int) -> tuple[float, Array]:
        """Signed distance and nearest points."""
        i, j = int(self.scene.first[pair]), int(self.scene.second[pair])
        turned = self.scene.kind[i] >= INSIDE or self.scene.kind[i] == PLANE
        if turned:
            i, j = j, i
        gap, points = self._distance(here, n, i, j)
        return gap, points[::-1] if turned else points

    def _distance(self, here: _Pieces, n: int, i: int, j: int) -> tuple[float, Array]:
        scene, size = self.scene, self._size
        a, b = scene.bodies[i].shape, scene.bodies[j].shape
        at, there = (here.pose(n, int(scene.frame[k])) * self._places[k] for k in (i, j))
        if scene.kind[j] == PLANE:
            point = self._solids.farthest(a, at, -there.rotation[:, 2])
            gap = float((point - there.translation) @ there.rotation[:, 2])
            return gap, np.array([point, point - gap * there.rotation[:, 2]])
        if scene.kind[j] == INSIDE:
            return _inside(corners_of(a, size[i]), at, float(size[i, 4]), float(size[j, 3]), there)
        if scene.kind[j] == TRIANGLES:
            return self._solids.surface(a, at, b, there)
        if self._round[i] and self._round[j]:
            ends = [here.ends[k, n] for k in (i, j)]
            one, two = (p[0] for p in segment_points(*(end[None] for pair in ends for end in pair)))
            return _rounded(one, two, float(scene.line[i, 6]), float(scene.line[j, 6]))
        if scene.kind[j] == OUTSIDE:
            axis, radius = there.rotation[:, 2], float(size[j, 3])
            middle = there.translation + ((at.translation - there.translation) @ axis) * axis
            long = 8.0 * float(size[i, 5] + size[i, 4] + radius)
            if self._round[i]:
                half = long / 2 * axis
                ends = [here.ends[i, n, 0], here.ends[i, n, 1], middle - half, middle + half]
                one, two = (p[0] for p in segment_points(*(end[None] for end in ends)))
                return _rounded(one, two, float(scene.line[i, 6]), radius)
            return self._solids.between(a, at, Cylinder(radius, long), pin.SE3(there.rotation, middle))
        return self._solids.between(a, at, b, there)


class _Pieces:
    """All frames and bodies in the middles of some pieces of a motion.

    Attributes:
        pieces: [n, 5]: from which knot to which, or which part of what is between two; how often that was halved.
        ends: of the capsules about the bodies, [bodies, n, 2, 3].
    """

    def __init__(self, scene: SweptScene, motion: Motion, pieces: Array) -> None:
        self.pieces, self._scene, tree = pieces, scene, scene.tree
        first, last, low, high = pieces[:, 0].astype(int), pieces[:, 1].astype(int), pieces[:, 2], pieces[:, 3]
        self.whole = last - first > 1
        knot = np.where(self.whole, (first + last) // 2, first)
        part, half = np.where(self.whole, 0.0, (low + high) / 2), (high - low) / 2
        self.middle = knot + part

        def off_of(way: Array, rate: Array) -> Array:
            both = np.maximum(way[knot] - way[first], way[last] - way[knot])
            return np.asarray(np.where(self.whole[:, None], both, rate[first] * half[:, None]))

        q, off = bernstein(motion.controls[knot], part), off_of(motion.variation, motion.rates)
        count = len(pieces)
        self.rotation, self.position = np.zeros((len(tree.frames), count, 3, 3)), np.zeros((len(tree.frames), count, 3))
        self._off = np.zeros((len(tree.frames), count, 4))
        for f, frame in enumerate(tree.frames):
            R, p = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
            if frame.parent >= 0:
                R, p = self.rotation[frame.parent], self.position[frame.parent]
            p, R = p + R @ frame.place.translation, R @ frame.place.rotation
            c = frame.coordinate
            if frame.moves == Moves.FREE:
                pose, turn = motion.poses[c], motion.turns[c]
                shift = np.diff(pose[:, 9:], axis=0)
                own = pose[knot, :9].reshape(-1, 3, 3) @ np.array([pin.exp3(x) for x in turn[first] * part[:, None]])
                p = p + (R @ (pose[knot, 9:] + part[:, None] * shift[first])[..., None])[..., 0]
                R = R @ own
                rate = np.stack([np.linalg.norm(shift, axis=1), np.linalg.norm(turn, axis=1)], axis=1)
                self._off[f, :, 2:] = motion.free_slack[c]
                self._off[f, :, :2] = off_of(motion.free_variation[c], rate) + motion.free_slack[c]
            elif frame.moves != Moves.FIXED:
                axis, turning = np.array(frame.axis), int(frame.moves == Moves.TURNING)
                x = frame.scale * q[:, c] + frame.offset
                self._off[f, :, 2 + turning] = abs(frame.scale) * motion.slack[c]
                self._off[f, :, turning] = abs(frame.scale) * (off[:, c] + motion.slack[c])
                if turning:
                    R = R @ np.array([pin.exp3(angle * axis) for angle in x])
                else:
                    p = p + (R @ (x[:, None] * axis)[..., None])[..., 0]
            self.rotation[f], self.position[f] = R, p
        lines = scene.line[:, :6].reshape(-1, 2, 3)
        self.ends = np.array(
            [np.stack([self._points(f, x) for x in line], axis=1) for f, line in zip(scene.frame, lines, strict=True)]
        ).reshape(-1, count, 2, 3)
        self._moved: dict[int, Array] = {}

    def _points(self, frame: int, x: Array) -> Array:
        if frame < 0:
            return np.broadcast_to(x, (len(self.pieces), 3))
        return np.asarray(self.position[frame] + self.rotation[frame] @ x)

    def point(self, n: int, frame: int, x: Array) -> Array:
        """A point of a frame in the world."""
        return np.asarray(self._points(frame, x)[n])

    def pose(self, n: int, frame: int) -> pin.SE3:
        """A frame's pose in the world."""
        return pin.SE3.Identity() if frame < 0 else pin.SE3(self.rotation[frame, n], self.position[frame, n])

    def moved(self, piece: Index, body: Index, stop: Index) -> Array:
        """How far points may be off the middle, and the slack in it, row by row [rows, 2]."""
        out = np.zeros((len(piece), 2))
        for b in np.unique(body).tolist():
            if b not in self._moved:
                self._moved[b] = self._gone(b)
            mine = body == b
            out[mine] = self._moved[b][stop[mine], piece[mine]]
        return out

    def _gone(self, b: int) -> Array:
        rows = [np.zeros((len(self.pieces), 2))]
        for f in self._scene.chain[b]:
            d = self.ends[b] - self.position[f][:, None]
            frame = self._scene.tree.frames[f]
            if frame.moves != Moves.FREE:
                axis = self.rotation[f] @ np.array(frame.axis)
                d = d - (d * axis[:, None]).sum(axis=2, keepdims=True) * axis[:, None]
            reach = np.linalg.norm(d, axis=2).max(axis=1) + self._scene.line[b, 7]
            off = self._off[f]
            steps = [off[:, k] + np.minimum(off[:, k + 1], 2.0) * reach for k in (0, 2)]
            rows.append(rows[-1] + np.stack(steps, axis=1))
        return np.array(rows)


class Solids:
    """Distances of solids by Coal, each proven by its normal."""

    def __init__(self) -> None:
        self._meshes: dict[Any, Any] = {}
        self._known: dict[Any, tuple[Any, Supports, Array]] = {}
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        self._request.gjk_tolerance, self._request.epa_tolerance = 1e-8, 1e-6

    def between(self, a: Any, at: pin.SE3, b: Any, there: pin.SE3) -> tuple[float, Array]:
        """Signed distance and nearest points of two solids, whose poses are their centres'."""
        (one, first, _), (two, second, _) = self._of(a), self._of(b)
        supports = _joined(first, second)
        offset = there.translation - at.translation
        normals = declared(at.rotation, there.rotation, offset)
        gap, own = self._coal(one, at, two, there)
        if np.isfinite(own).all() and abs(float(own @ own) - 1.0) < 1e-6:
            normals = [own] if gap > 1e-5 else [own, *normals]
        n = np.array(normals)
        which = (np.zeros(len(n), dtype=np.intp), np.ones(len(n), dtype=np.intp))
        turns = tuple(np.broadcast_to(pose.rotation, (len(n), 3, 3)) for pose in (at, there))
        values = clearance(supports, which, (turns[0], turns[1]), np.broadcast_to(offset, n.shape), n)
        best = int(np.argmax(values))
        # Where the two are apart Coal's point is right also on an edge or a face
        point = self.farthest(a, at, n[best]) if len(normals) > 1 else self._result.getNearestPoint1()
        return float(values[best]), np.array([point, point + values[best] * n[best]])

    def farthest(self, a: Any, at: pin.SE3, direction: Array) -> Array:
        """A point of a solid that reaches farthest along a direction."""
        supports = self._of(a)[1]
        return np.asarray(at * supports.point(0, at.rotation.T @ direction))

    def surface(self, a: Any, at: pin.SE3, surface: Any, there: pin.SE3) -> tuple[float, Array]:
        """A solid and triangles; as far as the balls on the solid's core, where that goes through one."""
        geometry, supports, _ = self._of(a)
        gap, normal = self._coal(geometry, at, self._mesh(surface), there)
        ball = float(supports.ball[0])
        if not abs(float(normal @ normal) - 1.0) < 1e-6:  # a core goes through the surface
            normal = np.array([0.0, 0.0, 1.0])
        gap, point = max(gap - SLOP, -ball), self._result.getNearestPoint1()
        if surface.solid and gap > -ball and enclosed(surface.corners, there.actInv(at).translation):
            return -gap - 2.0 * ball, np.array([point - 2.0 * ball * normal, point + gap * normal])
        return gap, np.array([point, point + gap * normal])

    def _mesh(self, surface: Any) -> Any:
        if surface not in self._meshes:
            mesh = coal.BVHModelOBBRSS()
            mesh.beginModel(len(surface.corners), 3 * len(surface.corners))
            for corners in surface.corners:
                mesh.addTriangle(*corners)
            mesh.endModel()
            self._meshes[surface] = mesh
        return self._meshes[surface]

    def _coal(self, a: Any, at: pin.SE3, b: Any, there: pin.SE3) -> tuple[float, Array]:
        self._result.clear()
        poses = [coal.Transform3s(pose.rotation, pose.translation) for pose in (at, there)]
        gap = float(coal.distance(a, poses[0], b, poses[1], self._request, self._result))
        return gap, np.array(self._result.normal)

    def _of(self, shape: Any) -> tuple[Any, Supports, Array]:
        if shape not in self._known:
            made = geometry_of(shape)
            self._known[shape] = made.geometry, Supports([shape], [made.center]), made.center
        return self._known[shape]


def _joined(a: Supports, b: Supports) -> Supports:
    out = Supports([], [])
    for name in ("ball", "disc", "box", "is_hull"):
        setattr(out, name, np.concatenate([getattr(a, name), getattr(b, name)]))
    out.hulls = {k: one.hulls[0] for k, one in enumerate((a, b)) if one.hulls}
    return out


def enclosed(corners: Array, point: Array) -> bool:
    """Whether a point is within a closed surface of triangles, as native/distance.h."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    under = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    angle = 2.0 * np.arctan2((a * np.cross(b, c)).sum(axis=1), under).sum()
    return bool(abs(angle) > 2.0 * pi)


def corners_of(shape: Any, size: Array) -> Array:
    """Points of a solid without its ball whose hull holds it, about the centre; of lids a polygon about them."""
    if isinstance(shape, Convex):
        return np.asarray(shape.points - shape.points.mean(axis=0))
    if size[3] > 0.0:
        angle, wide = np.linspace(0.0, 2 * pi, EDGES, endpoint=False), size[3] / cos(pi / EDGES)
        rim = wide * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        return np.concatenate([rim + [0.0, 0.0, side * size[2]] for side in (-1.0, 1.0)])
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    return np.asarray(signs * size[:3])


def _inside(corners: Array, at: pin.SE3, ball: float, radius: float, wall: pin.SE3) -> tuple[float, Array]:
    world = corners @ at.rotation.T + at.translation
    flat = ((world - wall.translation) @ wall.rotation)[:, :2]
    far = int(np.argmax((flat**2).sum(axis=1)))
    length = float(np.linalg.norm(flat[far]))
    out = np.append(flat[far] / length, 0.0) if length > 0.0 else np.array([1.0, 0.0, 0.0])
    normal, gap = wall.rotation @ out, radius - length - ball
    point = world[far] + ball * normal
    return gap, np.array([point, point + gap * normal])


def _rounded(one: Array, two: Array, ra: float, rb: float) -> tuple[float, Array]:
    length = float(np.linalg.norm(two - one))
    n = (two - one) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    return length - ra - rb, np.array([one + ra * n, two - rb * n])


def segment_points(a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array]:
    """Nearest points of the segments a b and c d, row by row [n, 3] each: of the ends, and of the lines."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv, uw, vw = ((x * y).sum(axis=1) for x, y in ((u, u), (v, v), (u, v), (u, w), (v, w)))
    over_u, over_v = (np.divide(1.0, x, out=np.zeros_like(x), where=x > 0.0) for x in (uu, vv))
    zero = np.zeros(len(a))

    def clip(x: Array) -> Array:
        return np.clip(x, 0.0, 1.0)

    det = uu * vv - uv * uv
    crossing = det > 1e-15 * uu * vv
    s4 = clip(np.divide(uv * vw - vv * uw, det, out=np.zeros_like(det), where=crossing))
    t4 = clip((uv * s4 + vw) * over_v)
    s5 = clip((uv * t4 - uw) * over_u)
    s = np.stack([zero, zero + 1.0, clip(-uw * over_u), clip((uv - uw) * over_u), s4, s5])
    t = np.stack([clip(vw * over_v), clip((vw + uv) * over_v), zero, zero + 1.0, t4, clip((uv * s5 + vw) * over_v)])
    gap = w + s[..., None] * u - t[..., None] * v
    best, rows = np.argmin((gap**2).sum(axis=2), axis=0), np.arange(len(a))
    return a + s[best, rows, None] * u, c + t[best, rows, None] * v


def bernstein(controls: Array, s: Array) -> Array:
    """De Casteljau's values of coefficients [n, scalars, degree + 1] at s [n]."""
    b = np.array(controls)
    while b.shape[2] > 1:
        b = b[..., :-1] + s[:, None, None] * np.diff(b, axis=2)
    return np.asarray(b[..., 0])


def _halves(pieces: Array, side: int) -> Array:
    out = pieces.copy()
    whole = out[:, 1] - out[:, 0] > 1
    out[whole, 1 - side] = np.floor((out[whole, 0] + out[whole, 1]) / 2)
    cut = ~whole
    out[cut, 3 - side] = (out[cut, 2] + out[cut, 3]) / 2
    out[cut, 4] += 1
    return out
