"""Random structures from seeds, without weight: those where a climb may hit what stands in its way, and those of scarce
holds.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from math import ceil, cos, pi, radians, sin

import numpy as np
from scipy.spatial import ConvexHull

from wbc import validation
from wbc.clearance import TriangleMesh
from wbc.climb.places import surface_frames
from wbc.climb.scene import FLIP, ClimbScene, Foothold, SceneBody, bar, frame_along
from wbc.climb.scenes import ClimbCourse
from wbc.multibody import pin
from wbc.shapes import Box, Capsule, HalfSpace
from wbc.validation import Array

#: Distance between holds [m]
PITCH = 0.235
#: Holds are left out that are this near to an obstacle [m]
FREE_OF = 0.12
#: Body and necks of the published walker, whichever way they are turned, are within this radius about the normal of
#: the hold that they stand over [m]
BODY = 0.41
#: And between these heights [m]
HEIGHTS = (0.55, 1.43)
#: Obstacles are so far from all points of it that are looked at [m]
ROOM = 0.09
#: Beginning and end are so far apart at least [m]
APART = 1.2
#: And so far from the outline of all holds [m]
MARGIN = 0.75
#: The body under holds on a plane
PLANE = {"surface": SceneBody(HalfSpace())}
#: Down, along which hands come to holds of level ground
DOWN = np.array([0.0, 0.0, -1.0])
#: First axis, to which holds are turned
AHEAD = np.array([1.0, 0.0, 0.0])
Bodies = Mapping[str, SceneBody]
#: Ids of the holds over which a climb begins and ends; None: there are none with place for a body
Ends = tuple[str, str] | None
Made = tuple[ClimbScene, Ends]


def structure(family: str, seed: int, body: float = BODY) -> ClimbCourse:
    """The course of a seed from hold to hold.

    Args:
        body: radius about its normal within which the robot's body has place at both ends [m].

    Raises:
        UnknownNameError: no such family.
    """
    validation.one_of("family", family, (*OBSTRUCTED, *SCARCE))
    table, more = (SCARCE, [77]) if family in SCARCE else (OBSTRUCTED, [])
    rng = np.random.default_rng([*more, list(table).index(family), seed])
    while True:
        scene, ends = table[family](rng, f"{family}-{seed}")
        ends = ends or _ends(rng, scene, body)
        if ends is not None:
            return ClimbCourse(scene, *surface_frames(scene, ends))
        # It is so full that a wide body has no place at two ends: another one


def _lattice(rows: int, columns: int) -> dict[str, Array]:
    """Points "T,A" on the plane z = 0 [m]."""
    return {f"{t},{a}": np.array([PITCH * a, PITCH * t, 0.0]) for t in range(rows) for a in range(columns)}


def _hold(name: str, at: Array, on: str = "", axis: Array = DOWN, along: Array = AHEAD, rolls: int = 0) -> Foothold:
    """By the direction along which a hand comes to it, and its x axis."""
    return Foothold(name, frame_along("hold", at, axis, along) * FLIP, on, rolls=rolls)


def _made(name: str, holds: list[Foothold], bodies: Bodies, begin: Array, end: Array) -> Made:
    """From the hold nearest to one point to that nearest to another."""
    scene = ClimbScene(holds, bodies, np.zeros(3), name)
    near = [int(np.linalg.norm(scene.positions - point, axis=1).argmin()) for point in (begin, end)]
    return scene, (scene.footholds[near[0]].id, scene.footholds[near[1]].id)


def _on_plane(name: str, obstacles: Bodies, rows: int = 15, columns: int = 18) -> ClimbScene:
    """A plane with a lattice, less the holds that obstacles stand on or are close to."""
    lattice = _lattice(rows, columns)
    points = np.array([*lattice.values()])
    free = np.all([obstacle.distances(points) >= FREE_OF for obstacle in obstacles.values()], axis=0)
    holds = [_hold(key, at, "surface") for (key, at), clear in zip(lattice.items(), free, strict=True) if clear]
    return ClimbScene(holds, {**obstacles, **PLANE}, np.zeros(3), name)


def _ends(rng: np.random.Generator, scene: ClimbScene, body: float) -> Ends:
    """Two holds over which a body has place, at least APART, and MARGIN from the outline of all holds [m]."""
    points = scene.positions
    low, high = points.min(axis=0), points.max(axis=0)
    flat = high - low <= 2 * MARGIN
    rows = np.flatnonzero(np.all(((points >= low + MARGIN) & (points <= high - MARGIN)) | flat, axis=1))
    gaps = np.linalg.norm(points[rows, None] - points[rows], axis=2)
    first, last = np.nonzero((gaps >= APART) & (gaps <= APART + 0.8))
    place = functools.cache(lambda row: has_place(scene, points[row], body))
    pairs = ((rows[first[k]], rows[last[k]]) for k in rng.permutation(len(first)))
    pair = next((pair for pair in pairs if place(pair[0]) and place(pair[1])), None)
    return None if pair is None else (scene.footholds[pair[0]].id, scene.footholds[pair[1]].id)


def has_place(scene: ClimbScene, foot: Array, within: float) -> bool:
    """Whether a body has place at its usual height over a point of the plane z = 0, whichever way it is turned."""
    grid = np.meshgrid(np.linspace(0.0, within, 4), np.arange(16) * pi / 8, np.linspace(*HEIGHTS, 9))
    radius, angle, height = (axis.ravel() for axis in grid)
    body = foot + np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    return all(obstacle.distances(body).min() >= ROOM for name, obstacle in scene.bodies.items() if name != "surface")


def _posts(rng: np.random.Generator, name: str) -> Made:
    """Posts of any height that stand among the holds."""
    posts = {}
    for k in range(int(rng.integers(3, 9))):
        foot = np.append(rng.uniform([0.3, 0.3], [3.7, 3.0]), 0.0)
        posts[f"post {k}"] = bar(foot, foot + [0.0, 0.0, rng.uniform(0.3, 1.7)], float(rng.uniform(0.02, 0.06)))
    return _on_plane(name, posts), None


def _bars(rng: np.random.Generator, name: str) -> Made:
    """Bars at any height that cross the holds."""
    bars = {}
    for k in range(int(rng.integers(2, 6))):
        angle, middle = rng.uniform(0, pi), np.append(rng.uniform([0.5, 0.5], [3.5, 2.8]), rng.uniform(0.15, 1.5))
        along = np.array([cos(angle), sin(angle), rng.uniform(-0.2, 0.2)]) * rng.uniform(0.3, 1.2)
        bars[f"bar {k}"] = bar(middle - along, middle + along, float(rng.uniform(0.02, 0.05)))
    return _on_plane(name, bars), None


def _ladder(rng: np.random.Generator, name: str) -> Made:
    """A ladder that leans or lies among the holds: two rails and their rungs."""
    foot = np.append(rng.uniform([0.8, 0.8], [3.2, 2.5]), 0.08)
    angle, lean = rng.uniform(0, 2 * pi), rng.uniform(0, 1.4)
    up = np.array([cos(angle) * cos(lean), sin(angle) * cos(lean), sin(lean)])
    across, length = rng.uniform(0.15, 0.3) * np.array([-sin(angle), cos(angle), 0.0]), rng.uniform(1.0, 2.0)
    parts = {f"rail {side:+d}": bar(foot + side * across, foot + side * across + length * up, 0.025)
             for side in (-1, 1)}  # fmt: skip
    for k, at in enumerate(np.arange(0.15, length, 0.3)):
        parts[f"rung {k}"] = bar(*(foot + at * up + side * across for side in (-1, 1)), 0.018)
    return _on_plane(name, parts), None


def _corner(rng: np.random.Generator, name: str) -> Made:
    """Two planes that meet in a corner or an edge; the body goes from the one to the other."""
    angle = float(rng.choice([-1.0, 1.0]) * rng.uniform(radians(15), radians(75)))  # > 0: a corner
    rows, columns, thick, holds, slabs = 11, 8, 0.1, list[Foothold](), dict[str, SceneBody]()
    for side, turn, letter in ((-1, 0.0, "a"), (1, angle, "c")):
        rotation = pin.utils.rotate("y", -turn)
        # Holds begin where a hand has place beside the other plane
        first = 0.25 + max(angle, 0.0) * 0.2
        for key, point in _lattice(rows, columns).items():
            at = rotation @ [side * (first + point[0]), point[1], 0.0]
            holds.append(_hold(f"{letter}{key}", at, f"slab {letter}", -rotation[:, 2], rotation[:, 0]))
        long = first + PITCH * columns
        middle = rotation @ np.array([side * long / 2, PITCH * (rows - 1) / 2, -thick / 2])
        slabs[f"slab {letter}"] = SceneBody(Box((long, PITCH * (rows + 2), thick)), pin.SE3(rotation, middle))
    row = int(rng.integers(4, 7))
    ends = f"a{row},{int(rng.integers(3, 5))}", f"c{int(rng.integers(4, 7))},{int(rng.integers(3, 5))}"
    return ClimbScene(holds, slabs, np.zeros(3), name), ends


def _inside(rng: np.random.Generator, name: str) -> Made:
    """The inside of a cylinder about x, of staves; holds on the wall."""
    radius, length, half = float(rng.uniform(2.4, 4.0)), 18 * PITCH, radians(75)
    count = ceil(2 * half * radius / PITCH)
    angles, holds, staves = np.linspace(-half, half, count), list[Foothold](), dict[str, SceneBody]()
    step = angles[1] - angles[0]
    sizes = length + 2 * PITCH, float(2 * (radius + 0.1) * np.tan(step / 2)), 0.1
    for t, angle in enumerate([-half - step, *angles, half + step], start=-1):
        turn = pin.utils.rotate("x", angle)
        staves[f"stave {t}"] = SceneBody(Box(sizes), pin.SE3(turn, [length / 2, 0, 0] - (radius + 0.05) * turn[:, 2]))
        for a in range(18 if 0 <= t < count else 0):
            at = [PITCH * a, 0, 0] - radius * turn[:, 2]
            holds.append(_hold(f"{t},{a}", at, f"stave {t}", -turn[:, 2]))
    t = sorted(rng.integers(count // 3, count - count // 3, 2).tolist())
    a = (int(rng.integers(4, 6)), int(rng.integers(10, 13)))
    return ClimbScene(holds, staves, np.zeros(3), name), (f"{t[0]},{a[0]}", f"{t[1]},{a[1]}")


def _tilted(rng: np.random.Generator, name: str) -> Made:
    """A lattice on a plane in any attitude, jittered, with holds that lean a little and are held with any rolls."""
    attitude = pin.SE3(pin.Quaternion(*_unit(rng.normal(size=4))).matrix(), rng.uniform(-2, 2, 3))
    jitter, lean = rng.uniform(0.0, 0.06), rng.uniform(0.0, radians(12))
    rolls, holds = [0, 1, 2, 4, 6][int(rng.integers(5))], list[Foothold]()
    for key, at in _lattice(15, 18).items():
        axis = _unit(np.append(np.tan(lean) * rng.uniform(-1, 1, 2), -1.0))
        place = at + np.append(rng.uniform(-jitter, jitter, 2), 0.0)
        holds.append(_hold(key, place, "surface", axis, rolls=rolls))
    flat = ClimbScene(holds, PLANE, np.zeros(3), name)
    return flat.moved(attitude), _ends(rng, flat, BODY)


def _mesh(rng: np.random.Generator, name: str) -> Made:
    """Rocks as meshes, on the plane and above it."""
    rocks = {}
    for k in range(int(rng.integers(2, 6))):
        place, size = rng.uniform([0.5, 0.5, 0.0], [3.5, 2.8, 1.0]), float(rng.uniform(0.1, 0.3))
        corners = np.array([_unit(rng.normal(size=3)) * size * rng.uniform(0.6, 1.0) for _ in range(24)])
        rocks[f"rock {k}"] = SceneBody(TriangleMesh(_hull(corners), solid=True), pin.SE3(np.eye(3), place))
    return _on_plane(name, rocks), None


def _hull(points: Array) -> Array:
    """The triangles of the hull of points, outwards and of single precision as in files ``(n, 3, 3)`` [m]."""
    hull = ConvexHull(points := points.astype(np.float32).astype(np.float64))
    corners: Array = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turned = (normals * hull.equations[:, :3]).sum(axis=1) < 0
    corners[turned] = corners[turned][:, ::-1]
    return corners


def _unit(vector: Array) -> Array:
    out: Array = vector / np.linalg.norm(vector)
    return out


def _scattered(rng: np.random.Generator, low: Array, high: Array, apart: float, count: int) -> Iterator[Array]:
    """Points of a rectangle that are no nearer to each other than so much [m]."""
    known = np.zeros((0, 2))
    for point in rng.uniform(low, high, (count, 2)):
        if not len(known) or np.linalg.norm(known - point, axis=1).min() >= apart:
            known = np.vstack([known, point])
            yield point


def _rungs(rng: np.random.Generator, name: str) -> Made:
    """A wide ladder of round rungs at random distances, some of them askew."""
    holds, rungs, x, k = list[Foothold](), dict[str, SceneBody](), 0.0, 0
    while x < 4.6:
        skew, radius = float(rng.uniform(-0.15, 0.15)), 0.03
        along = np.array([sin(skew), cos(skew), 0.0])
        middle = np.array([x, 0.0, -radius])
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
        rungs[f"rung {k}"] = SceneBody(Capsule(radius, 3.0), pin.SE3(turn, middle))
        for j, far in enumerate(np.arange(-1.4, 1.41, 0.28)):
            holds.append(_hold(f"{k},{j}", middle + far * along + [0.0, 0.0, radius], f"rung {k}"))
        x, k = x + float(rng.uniform(0.22, 0.5)), k + 1
    return _made(name, holds, rungs, np.array([1.2, 0.0, 0.0]), np.array([rng.uniform(2.6, 3.2), 0.0, 0.0]))


def _spiral(rng: np.random.Generator, name: str) -> Made:
    """Holds along a spiral on a plane, turn beside turn."""
    pitch, step, angle = float(rng.uniform(0.3, 0.42)), float(rng.uniform(0.2, 0.28)), pi
    points = list[Array]()
    while angle < 2.0 * pi * 2.6 / pitch:
        radius = pitch * angle / (2.0 * pi)
        points.append(np.array([radius * cos(angle), radius * sin(angle), 0.0]))
        angle += step / radius
    holds = [_hold(str(k), point, "surface") for k, point in enumerate(points)]
    about = rng.uniform(0.0, 2.0 * pi)
    end = 1.1 * np.array([cos(about), sin(about), 0.0])
    return _made(name, holds, PLANE, -end, end)


def _roof(rng: np.random.Generator, name: str) -> Made:
    """Scattered holds on two slabs that meet in a ridge."""
    fall, holds, slabs = float(rng.uniform(radians(10), radians(25))), list[Foothold](), dict[str, SceneBody]()
    for side in (-1, 1):
        rotation, slab = pin.utils.rotate("y", side * fall), f"slab {'ab'[side > 0]}"
        for k, (x, y) in enumerate(_scattered(rng, np.array([0.12, -1.5]), np.array([2.4, 1.5]), 0.2, 220)):
            at = rotation @ np.array([side * x, y, 0.0])
            holds.append(_hold(f"{'ab'[side > 0]}{k}", at, slab, rotation @ DOWN))
        middle = rotation @ np.array([side * 1.25, 0.0, -0.05])
        slabs[slab] = SceneBody(Box((2.5, 3.4, 0.1)), pin.SE3(rotation, middle))
    ends = [pin.utils.rotate("y", side * fall) @ np.array([side * 0.9, 0.0, 0.0]) for side in (-1, 1)]
    return _made(name, holds, slabs, *ends)


def _leaning(rng: np.random.Generator, name: str) -> Made:
    """Scattered holds that lean any way, but for those under the body's ends."""
    ends, most, holds = (np.array([1.2, 1.4, 0.0]), np.array([2.7, 1.4, 0.0])), radians(30), list[Foothold]()
    for k, (x, y) in enumerate(_scattered(rng, np.zeros(2), np.array([4.0, 2.8]), 0.24, 400)):
        axis = np.array([*(np.tan(most) * rng.uniform(-0.7, 0.7, 2)), -1.0])
        holds.append(_hold(str(k), np.array([x, y, rng.uniform(-0.1, 0.1)]), axis=_unit(axis)))
    holds += [_hold(f"end {k}", end) for k, end in enumerate(ends)]
    return _made(name, holds, {}, *ends)


def _islands(rng: np.random.Generator, name: str) -> Made:
    """Small groups of holds on a plane with nothing between them."""
    holds = list[Foothold]()
    for x in np.arange(0.0, 4.3, 0.85):
        for y in np.arange(0.0, 2.7, 0.85):
            corner = np.array([x, y]) + rng.uniform(-0.08, 0.08, 2)
            for point in _scattered(rng, corner, corner + 0.35, 0.16, 12):
                holds.append(_hold(str(len(holds)), np.append(point, 0.0), "surface"))
    return _made(name, holds, PLANE, np.array([1.1, 1.3, 0.0]), np.array([rng.uniform(2.4, 3.1), 1.3, 0.0]))


#: Where something is in the way: family -> (generator, name) -> its scene, and the holds at its ends
OBSTRUCTED: dict[str, Callable[[np.random.Generator, str], Made]] = {
    "posts": _posts,
    "bars": _bars,
    "ladder": _ladder,
    "corner": _corner,
    "inside": _inside,
    "tilted": _tilted,
    "mesh": _mesh,
}
#: Those of scarce holds
SCARCE: dict[str, Callable[[np.random.Generator, str], Made]] = {
    "rungs": _rungs,
    "spiral": _spiral,
    "roof": _roof,
    "leaning": _leaning,
    "islands": _islands,
}
