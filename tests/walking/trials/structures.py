"""Random structures of seven families, from seeds: what stands in the way is where a walk may hit it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, cos, pi, radians, sin
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from wbc import validation
from wbc.clearance import TriangleMesh
from wbc.shapes import Box, Capsule
from wbc.validation import Array
from wbc.walking import Hold, Obstacle, PlaneSurface, Structure, save_structure
from wbc.walking.holds.hold import FIXED, FREE, frame_of

#: Distance between holds, and height of the body over them [m]
PITCH, HEIGHT = 0.235, 1.32
#: Holds are left out that are this near to an obstacle [m]
FREE_OF = 0.12
#: Tilt that the holds allow [rad]
TILT = 0.05
#: Body and necks, whichever way they are turned, are within this radius about the normal of the hold that they stand
#: over, and between these heights; obstacles are ROOM from all points of it that are looked at [m]
BODY, LOW, HIGH, ROOM = 0.41, 0.55, 1.43, 0.09
#: Beginning and end are so far apart at least, and so far from the outline of all holds [m]
APART, MARGIN = 1.2, 0.75
#: Ids of the holds over which a walk begins and ends; None: they are drawn
Ends = tuple[str, str] | None


@dataclass(frozen=True, eq=False)
class Trial:
    """A random structure, and the holds over which a body begins and ends on it."""

    family: str
    seed: int
    structure: Structure
    start: str
    goal: str

    @property
    def name(self) -> str:
        """Family and seed."""
        return f"{self.family} {self.seed}"

    def save(self, folder: Path) -> Path:
        """Writes the structure's file; returns it."""
        folder.mkdir(parents=True, exist_ok=True)
        return save_structure(self.structure, folder / f"{self.family}-{self.seed}.csv")


def random_structure(family: str, seed: int, body: float = BODY) -> Trial:
    """The structure of a seed.

    Args:
        body: radius about the body's z axis within which it is with its necks [m].

    Raises:
        UnknownNameError: no such family.
    """
    make = FAMILIES[validation.one_of("family", family, tuple(FAMILIES))]
    rng = np.random.default_rng([list(FAMILIES).index(family), seed])
    while True:
        structure, ends = make(rng, f"{family}-{seed}")
        ends = ends or _ends(rng, structure, body)
        if ends is not None:
            return Trial(family, seed, structure, *ends)
        # It is so full that a wide body has no place at two ends: another one


def _lattice(rows: int, columns: int) -> dict[str, Array]:
    """Grasp points "T,A" on the plane z = 0 [m]."""
    return {f"{t},{a}": np.array([PITCH * a, PITCH * t, 0.0]) for t in range(rows) for a in range(columns)}


def _on_plane(name: str, obstacles: list[Obstacle], rows: int = 15, columns: int = 18) -> Structure:
    """A plane with a lattice, less the holds that obstacles stand on or are close to."""
    lattice = _lattice(rows, columns)
    points = np.array([*lattice.values()])
    free = np.all([obstacle.distance(points) >= FREE_OF for obstacle in obstacles], axis=0)
    holds = [
        Hold(key, frame_of("hold", at, (0, 0, -1), (1, 0, 0)), FREE, TILT)
        for (key, at), clear in zip(lattice.items(), free, strict=True)
        if clear
    ]
    return Structure(name, tuple(holds), tuple(obstacles), PlaneSurface(pin.SE3.Identity()))


def _ends(rng: np.random.Generator, structure: Structure, body: float) -> Ends:
    """Two holds over which a body has place, at least APART, and MARGIN from the outline of all holds [m]; None: there
    are none.
    """
    points = structure.positions
    low, high = points.min(axis=0), points.max(axis=0)
    flat = high - low <= 2 * MARGIN
    inner = np.all(((points >= low + MARGIN) & (points <= high - MARGIN)) | flat, axis=1)
    rows = np.flatnonzero(inner)
    gaps = np.linalg.norm(points[rows, None] - points[rows], axis=2)
    first, last = np.nonzero((gaps >= APART) & (gaps <= APART + 0.8))
    place = functools.cache(lambda row: has_place(structure, points[row], body))
    pairs = ((rows[first[k]], rows[last[k]]) for k in rng.permutation(len(first)))
    found = next((pair for pair in pairs if place(pair[0]) and place(pair[1])), None)
    return None if found is None else (structure.ids[found[0]], structure.ids[found[1]])


def has_place(structure: Structure, foot: Array, within: float) -> bool:
    """Whether a body has place at its usual height over a point of the plane z = 0, whichever way it is turned."""
    grid = np.meshgrid(np.linspace(0.0, within, 4), np.arange(16) * pi / 8, np.linspace(LOW, HIGH, 9))
    radius, angle, height = (axis.ravel() for axis in grid)
    body = foot + np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    return all(float(obstacle.distance(body).min()) >= ROOM for obstacle in structure.obstacles)


def capsule_between(name: str, a: Array, b: Array, radius: float) -> Obstacle:
    """A capsule about the segment a b [m]."""
    length = float(np.linalg.norm(b - a))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (b - a) / length).matrix()
    return Obstacle(name, Capsule(radius, length), pin.SE3(turn, (a + b) / 2))


def _posts(rng: np.random.Generator, name: str) -> tuple[Structure, Ends]:
    """Posts of any height that stand among the holds."""
    posts = []
    for k in range(int(rng.integers(3, 9))):
        foot = np.append(rng.uniform([0.3, 0.3], [3.7, 3.0]), 0.0)
        top = foot + [0.0, 0.0, rng.uniform(0.3, 1.7)]
        posts.append(capsule_between(f"post {k}", foot, top, float(rng.uniform(0.02, 0.06))))
    return _on_plane(name, posts), None


def _bars(rng: np.random.Generator, name: str) -> tuple[Structure, Ends]:
    """Bars at any height that cross the holds."""
    bars = []
    for k in range(int(rng.integers(2, 6))):
        angle, middle = rng.uniform(0, pi), np.append(rng.uniform([0.5, 0.5], [3.5, 2.8]), rng.uniform(0.15, 1.5))
        along = np.array([cos(angle), sin(angle), rng.uniform(-0.2, 0.2)]) * rng.uniform(0.3, 1.2)
        bars.append(capsule_between(f"bar {k}", middle - along, middle + along, float(rng.uniform(0.02, 0.05))))
    return _on_plane(name, bars), None


def _ladder(rng: np.random.Generator, name: str) -> tuple[Structure, Ends]:
    """A ladder that leans or lies among the holds: two rails and their rungs."""
    foot, angle, lean = (
        np.append(rng.uniform([0.8, 0.8], [3.2, 2.5]), 0.08),
        rng.uniform(0, 2 * pi),
        rng.uniform(0, 1.4),
    )
    up = np.array([cos(angle) * cos(lean), sin(angle) * cos(lean), sin(lean)])
    across, half, length = np.array([-sin(angle), cos(angle), 0.0]), rng.uniform(0.15, 0.3), rng.uniform(1.0, 2.0)
    parts = [
        capsule_between(
            f"rail {side:+d}", foot + side * half * across, foot + side * half * across + length * up, 0.025
        )
        for side in (-1, 1)
    ]
    for k, at in enumerate(np.arange(0.15, length, 0.3)):
        parts.append(capsule_between(f"rung {k}", *(foot + at * up + s * half * across for s in (-1, 1)), 0.018))
    return _on_plane(name, parts), None


def _corner(rng: np.random.Generator, name: str) -> tuple[Structure, Ends]:
    """Two planes that meet in a corner or an edge; the body goes from the one to the other."""
    angle = float(rng.choice([-1.0, 1.0]) * rng.uniform(radians(15), radians(75)))  # > 0: a corner
    rows, columns, thick, holds, slabs = 11, 8, 0.1, [], []
    for side, turn in ((-1, 0.0), (1, angle)):
        rotation = pin.utils.rotate("y", -turn) if side > 0 else np.eye(3)
        # Holds begin where a hand has place beside the other plane
        first = 0.25 + max(angle, 0.0) * 0.2
        for key, point in _lattice(rows, columns).items():
            at = rotation @ (side * np.array([first, 0, 0]) + [side * point[0], point[1], 0.0])
            pose = frame_of("hold", at, -rotation[:, 2], rotation[:, 0])
            holds.append(Hold(f"{'abc'[side + 1]}{key}", pose, FREE, TILT))
        long = first + PITCH * columns
        middle = rotation @ np.array([side * long / 2, PITCH * (rows - 1) / 2, -thick / 2])
        sizes = (long, PITCH * (rows + 2), thick)
        slabs.append(Obstacle("slab a" if side < 0 else "slab c", Box(sizes), pin.SE3(rotation, middle)))
    structure = Structure(name, tuple(holds), tuple(slabs))
    row = int(rng.integers(4, 7))
    return structure, (f"a{row},{int(rng.integers(3, 5))}", f"c{int(rng.integers(4, 7))},{int(rng.integers(3, 5))}")


def _inside(rng: np.random.Generator, name: str) -> tuple[Structure, Ends]:
    """The inside of a cylinder about x, of staves; holds on the wall."""
    radius, length, half = float(rng.uniform(2.4, 4.0)), 18 * PITCH, radians(75)
    count = ceil(2 * half * radius / PITCH)
    angles, holds = np.linspace(-half, half, count), []
    for t, angle in enumerate(angles):
        outward = np.array([0.0, sin(angle), -cos(angle)])
        for a in range(18):
            pose = frame_of("hold", radius * outward + [PITCH * a, 0, 0], outward, (1, 0, 0))
            holds.append(Hold(f"{t},{a}", pose, FREE, TILT))
    staves = []
    step = angles[1] - angles[0]
    for k, angle in enumerate(np.arange(-half - step, half + 1.5 * step, step)):
        turn = pin.utils.rotate("x", angle)
        width = 2 * (radius + 0.1) * np.tan(step / 2)
        at = turn @ np.array([0.0, 0.0, -(radius + 0.05)]) + [length / 2, 0, 0]
        staves.append(Obstacle(f"stave {k}", Box((length + 2 * PITCH, float(width), 0.1)), pin.SE3(turn, at)))
    structure = Structure(name, tuple(holds), tuple(staves))
    t = sorted(rng.integers(count // 3, count - count // 3, 2).tolist())
    a = (int(rng.integers(4, 6)), int(rng.integers(10, 13)))
    return structure, (f"{t[0]},{a[0]}", f"{t[1]},{a[1]}")


def _tilted(rng: np.random.Generator, name: str) -> tuple[Structure, Ends]:
    """A lattice on a plane in any attitude, jittered, with holds of every kind that lean a little."""
    attitude = pin.SE3(pin.Quaternion(*_unit(rng.normal(size=4))).matrix(), rng.uniform(-2, 2, 3))
    jitter, lean = rng.uniform(0.0, 0.06), rng.uniform(0.0, radians(12))
    roll = [FREE, FIXED, 2, 4, 6][int(rng.integers(5))]
    holds = []
    for key, at in _lattice(15, 18).items():
        axis = _unit(np.append(np.tan(lean) * rng.uniform(-1, 1, 2), -1.0))
        place = at + np.append(rng.uniform(-jitter, jitter, 2), 0.0)
        holds.append(Hold(key, frame_of("hold", place, axis, (1, 0, 0)), roll, float(rng.choice([0.0, TILT]))))
    flat = Structure(name, tuple(holds), (), PlaneSurface(pin.SE3.Identity()))
    return flat.moved(attitude), _ends(rng, flat, BODY)


def rock(rng: np.random.Generator, size: float) -> Array:
    """Corners of a convex rock about the origin, [n, 3] m."""
    return np.array([_unit(rng.normal(size=3)) * size * rng.uniform(0.6, 1.0) for _ in range(24)])


def surface_of(points: Array) -> Array:
    """The triangles of the hull of points, outwards and of single precision as in files, [n, 3, 3] m."""
    points = points.astype(np.float32).astype(np.float64)
    hull = ConvexHull(points)
    corners: Array = points[hull.simplices]
    turned = (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * hull.equations[:, :3]).sum(1) < 0
    corners[turned] = corners[turned][:, ::-1]
    return corners


def _mesh(rng: np.random.Generator, name: str) -> tuple[Structure, Ends]:
    """Rocks as meshes, on the plane and above it."""
    rocks = []
    for k in range(int(rng.integers(2, 6))):
        place = rng.uniform([0.5, 0.5, 0.0], [3.5, 2.8, 1.0])
        shape = TriangleMesh(surface_of(rock(rng, float(rng.uniform(0.1, 0.3)))), solid=True)
        rocks.append(Obstacle(f"rock {k}", shape, pin.SE3(np.eye(3), place)))
    return _on_plane(name, rocks), None


def _unit(vector: Array) -> Array:
    out: Array = vector / np.linalg.norm(vector)
    return out


#: Family -> (generator, name) -> structure, and the holds over which a walk begins and ends; None: such as have place
FAMILIES: dict[str, Callable[[np.random.Generator, str], tuple[Structure, Ends]]] = {
    "posts": _posts,
    "bars": _bars,
    "ladder": _ladder,
    "corner": _corner,
    "inside": _inside,
    "tilted": _tilted,
    "mesh": _mesh,
}
