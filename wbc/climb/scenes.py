"""Scenes drawn from seeds, at the size of a robot: a course each, from one place to another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, pi, sin

import numpy as np

from wbc import validation
from wbc.clearance import CylinderInside, EndlessCylinder, TriangleMesh
from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene, Foothold, SceneBody, bar
from wbc.climb.surfaces import FootholdRules, footholds_on, frame_on
from wbc.multibody import pin
from wbc.shapes import Box, Convex, HalfSpace
from wbc.shapes.surfaces import between_rows
from wbc.validation import Array

#: Gravity of scenes with weight [m/s^2]
EARTH = np.array([0.0, 0.0, -9.81])
#: Gravity of scenes without [m/s^2]
WEIGHTLESS = np.zeros(3)
#: First axis of the world, along courses
X = np.array([1.0, 0.0, 0.0])
#: Second axis of the world, across courses
Y = np.array([0.0, 1.0, 0.0])
#: Third axis of the world, upwards
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class ClimbCourse:
    """A scene and a way through it.

    Attributes:
        scene: what is climbed.
        start, goal: frames on its surface, z outwards and x along the course: under the middle of the robot.
    """

    scene: ClimbScene
    start: pin.SE3
    goal: pin.SE3


def draw(name: str, size: float, seed: int = 0, density: float = 0.8) -> ClimbCourse:
    """A course of a family.

        draw("stairs", 0.5, seed=3)

    Args:
        name: of :func:`families`. size: about the reach of the robot's limbs [m], which all lengths go with.
        seed: what is random is drawn from it.
        density: share of stepping stones, holds on walls and places on rubble that are there (0, 1].

    Raises:
        UnknownNameError: no such family. RangeError, NotFiniteError: a size or density that is none.
    """
    make = _FAMILIES[validation.one_of("scene", name, families())]
    size = validation.scalar("size", size, low=0.0, open_low=True, unit="m")
    density = validation.scalar("density", density, low=0.0, high=1.0, open_low=True)
    course = make(np.random.default_rng(validation.integer("seed", seed)), size, density)
    return replace(course, scene=replace(course.scene, name=name))


def families() -> tuple[str, ...]:
    """Names of the families of scenes."""
    return tuple(_FAMILIES)


def placed(climber: Climber, frame: pin.SE3) -> Array:
    """The climber at rest with the middle of its contacts at a frame on a surface: its normal along z, its x ahead.

    The normal is the mean of the contact frames' z axes; of contacts that fix positions only, up where it stands. Of a
    robot with feet and hands that pull the feet count.
    """
    body, every = climber.body_pose(climber.rest), list(range(len(climber.limbs)))
    limbs = [limb for limb in every if not climber.limbs[limb].contact.pulls] or every
    contacts = {limb: climber.contact_pose(climber.rest, limb) for limb in limbs}
    up = [
        body.rotation.T @ (Z if climber.fixed(limb) == "position" else pose.rotation[:, 2])
        for limb, pose in contacts.items()
    ]
    points = [
        body.actInv(pose.translation) - climber.limbs[limb].contact.height * normal
        for (limb, pose), normal in zip(contacts.items(), up, strict=True)
    ]
    normal = np.mean(up, axis=0)
    normal = normal / np.linalg.norm(normal)
    under = frame_on(np.mean(points, axis=0), normal)
    return climber.with_body(climber.rest, frame * under.inverse())


def _cylinder(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    radius, pitch = 4.0 * size, 0.3 * size
    pose = pin.SE3(pin.utils.rotate("y", pi / 2), -radius * Z)
    footholds = []
    for a in range(21):
        for t in range(-5, 6):
            angle = t * pitch / radius
            normal = np.array([0.0, sin(angle), cos(angle)])
            footholds.append(Foothold(f"{t},{a}", frame_on(a * pitch * X + radius * (normal - Z), normal), "cylinder"))
    return _along(footholds, {"cylinder": SceneBody(EndlessCylinder(radius), pose)}, WEIGHTLESS, 5 * pitch, 15 * pitch)


def _truss(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    bay, radius, bays = 0.8 * size, 0.04 * size, 6
    bars, footholds = dict[str, tuple[Array, Array]](), list[Foothold]()
    corners = [(y, z) for y in (-0.5 * bay, 0.5 * bay) for z in (0.0, -bay)]
    for k, (y, z) in enumerate(corners):
        ends = (np.array([0.0, y, z - radius]), np.array([bays * bay, y, z - radius]))
        bars[f"longeron {k + 1}"] = ends
        if z == 0.0:
            for a in range(3 * bays + 1):
                footholds.append(Foothold(f"{k + 1},{a}", frame_on([a * bay / 3, y, 0.0], Z), f"longeron {k + 1}"))
    for a in range(bays + 1):
        x = a * bay
        for k, ((y, z), (v, w)) in enumerate([(corners[i], corners[j]) for i, j in ((0, 2), (1, 3), (0, 1), (2, 3))]):
            bars[f"batten {a},{k + 1}"] = np.array([x, y, z - radius]), np.array([x, v, w - radius])
        footholds.append(Foothold(f"middle {a}", frame_on([x, 0.0, 0.0], Z), f"batten {a},1"))
    bodies = {name: bar(a, b, radius) for name, (a, b) in bars.items()}
    return _along(footholds, bodies, WEIGHTLESS, bay, (bays - 1) * bay)


def _wall(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    width, height = 3.0 * size, 5.0 * size
    points = _apart(rng, width, height, 0.35 * size / np.sqrt(density))
    footholds = []
    for k, (across, up) in enumerate(points):
        normal = pin.exp3(rng.uniform(-0.25, 0.25, 3)) @ X
        footholds.append(Foothold(f"hold {k + 1}", frame_on([0.0, across, up], normal), "wall"))
    wall = SceneBody(Box((size, 2 * width, 2 * height)), pin.SE3(np.eye(3), -0.5 * size * X + 0.5 * height * Z))
    turn = np.column_stack([Z, np.cross(X, Z), X])
    ends = [pin.SE3(turn, np.array([0.0, 0.0, part * height])) for part in (0.25, 0.75)]
    return ClimbCourse(ClimbScene(footholds, {"wall": wall}, EARTH), *ends)


def _stepping_stones(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    pitch, side = 0.3 * size, 0.22 * size
    footholds, bodies = list[Foothold](), dict[str, SceneBody]()
    for a in range(-4, 22):
        for t in range(-4, 5):
            # The robot stands where it starts and where it ends
            if rng.random() > density and 4 < a < 14:
                continue
            at = np.array([a * pitch, t * pitch, rng.uniform(-0.05, 0.0) * size])
            name = f"stone {t},{a}"
            bodies[name] = SceneBody(Box((side, side, size)), pin.SE3(np.eye(3), at - 0.5 * size * Z))
            footholds.append(Foothold(f"{t},{a}", frame_on(at, Z), name))
    return _along(footholds, bodies, EARTH, 0.0, 18 * pitch)


def _stairs(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    rise, tread, width, steps = 0.22 * size, 0.6 * size, 3.0 * size, 3
    heights = [0.0, *(rise * k for k in range(1, steps + 1)), *(rise * k for k in range(steps - 1, -1, -1))]
    boxes, x = list[tuple[float, float, float]](), -2.0 * size
    for k, height in enumerate(heights):
        long = 3.6 * size if k in (0, len(heights) - 1) else tread
        boxes.append((x, x + long, height))
        x += long
    return _platforms(boxes, size, width, x - 1.8 * size)


def _rail(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    """Three stairs for feet with a rail beside them for the right hand, by the names of a humanoid's limbs."""
    rise, tread, flat, steps = rng.uniform(0.14, 0.16) * size, rng.uniform(0.27, 0.3) * size, 1.2 * size, 3
    heights = [rise * k for k in range(steps + 1)]
    ends = np.cumsum([-flat, flat, *[tread] * (steps - 1), 1.5 * flat])
    course = _platforms(list(zip(ends[:-1], ends[1:], heights, strict=True)), size, size, 0.0, 0.14 * size)
    footholds = [replace(foothold, limbs=("left_foot", "right_foot")) for foothold in course.scene.footholds]
    across, above, radius = -0.33 * size * Y, rng.uniform(0.72, 0.78) * size * Z, 0.02 * size
    corners = [x * X + across + above + height * Z for x, height in ((-flat, 0.0), (-0.5 * tread, 0.0),
               (ends[-2] - 0.5 * tread, heights[-1]), (ends[-1], heights[-1]))]  # fmt: skip
    bodies = dict(course.scene.bodies)
    for k, (a, b) in enumerate(pairwise(corners)):
        name, along = f"rail {k + 1}", (b - a) / np.linalg.norm(b - a)
        bodies[name] = bar(a, b, radius)
        normal = pin.exp3(-0.4 * along) @ np.cross(along, Y)
        turn = np.column_stack([along, np.cross(normal, along), normal])
        for j, part in enumerate(np.arange(0.05 * size, np.linalg.norm(b - a), 0.15 * size)):
            frame = pin.SE3(turn, a + part * along + radius * normal)
            footholds.append(Foothold(f"{name},{j}", frame, name, limbs=("right_hand",), rolls=2))
    end = frame_on([ends[-2] + 0.4 * size, 0.0, heights[-1]], Z)
    return ClimbCourse(ClimbScene(footholds, bodies, EARTH), frame_on([-0.4 * size, 0.0, 0.0], Z), end)


def _gap(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    wide = rng.uniform(0.3, 0.6) * size
    ends = [(-2.0 * size, 1.5 * size, 0.0), (1.5 * size + wide, 5.0 * size, rng.uniform(-0.1, 0.1) * size)]
    return _platforms(ends, size, 3.0 * size, 3.5 * size)


def _passage(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    course = _platforms([(-2.0 * size, 6.0 * size, 0.0)], size, 3.0 * size, 4.0 * size)
    half, long = rng.uniform(0.95, 1.2) * size, 1.5 * size
    bodies = dict(course.scene.bodies)
    for side, name in ((-1.0, "right"), (1.0, "left")):
        at = np.array([2.0 * size, side * (half + 0.25 * size), 0.75 * size])
        bodies[name] = SceneBody(Box((long, 0.5 * size, 1.5 * size)), pin.SE3(np.eye(3), at))
    roof = np.array([2.0 * size, 0.0, rng.uniform(0.95, 1.1) * size + 0.1 * size])
    bodies["roof"] = SceneBody(Box((long, 2.0 * half, 0.2 * size)), pin.SE3(np.eye(3), roof))
    return ClimbCourse(ClimbScene(course.scene.footholds, bodies, EARTH), course.start, course.goal)


def _rubble(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    """Prisms over convex polygons, tilted: the sets of polygons that planners of footsteps take."""
    pitch, bodies, footholds = 0.6 * size, dict[str, SceneBody](), list[Foothold]()
    rules = FootholdRules(0.25 * size, 0.04 * size, max_slope=0.5)
    for a in range(-3, 12):
        for t in range(-2, 3):
            if rng.random() > density and 1 < a < 8:
                continue
            angles = np.sort(rng.uniform(0.0, 2 * pi, 3)) + 0.01
            angles = np.sort(np.concatenate([angles, np.arange(4) * pi / 2]))
            ring = 0.46 * pitch * np.column_stack([np.cos(angles), np.sin(angles)])
            shape = prism(ring, 0.3 * size)
            flat = not 0 < a < 9
            turn = np.eye(3) if flat else pin.exp3(rng.uniform(-0.25, 0.25, 3))
            height = 0.0 if flat else rng.uniform(-0.1, 0.05) * size
            pose = pin.SE3(turn, np.array([a * pitch, t * pitch, height]))
            name = f"piece {t},{a}"
            bodies[name] = SceneBody(shape, pose)
            footholds += footholds_on(name, shape, pose, rules)
    return _along(footholds, bodies, EARTH, -pitch, 9.5 * pitch)


def _chimney(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    half, height = 1.0 * size, 5.0 * size
    rules = FootholdRules(0.3 * size, 0.1 * size, friction=0.9)
    bodies, footholds = dict[str, SceneBody](), list[Foothold]()
    for name, side in (("right", -1.0), ("left", 1.0)):
        at = np.array([0.0, side * (half + 0.1 * size), 0.5 * height])
        body = bodies[name] = SceneBody(Box((2.4 * size, 0.2 * size, height)), pin.SE3(np.eye(3), at))
        inner = [
            f for f in footholds_on(name, body.shape, body.placement, rules) if -side * f.pose.rotation[1, 2] > 0.9
        ]
        footholds += inner
    turn = np.column_stack([X, Y, Z])
    ends = [pin.SE3(turn, np.array([0.0, 0.0, part * height])) for part in (0.3, 0.7)]
    return ClimbCourse(ClimbScene(footholds, bodies, EARTH), *ends)


def _rebar(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    pitch, radius, rows, columns = 0.4 * size, 0.03 * size, 7, 18
    bodies, footholds = dict[str, SceneBody](), list[Foothold]()
    for t in range(rows):
        y = (t - (rows - 1) / 2) * pitch
        bodies[f"along {t}"] = bar(y * Y - radius * Z, y * Y - radius * Z + columns * pitch * X, radius)
        for a in range(columns):
            at = np.array([(a + 0.5) * pitch, y, 0.0])
            footholds.append(Foothold(f"{t},{a}", frame_on(at, Z), f"along {t}"))
    wide = 0.5 * (rows - 1) * pitch
    for a in range(columns + 1):
        at = a * pitch * X - radius * Z
        bodies[f"across {a}"] = bar(at - wide * Y, at + wide * Y, radius)
    return _along(footholds, bodies, WEIGHTLESS, 3 * pitch, (columns - 3) * pitch)


def _inside(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    radius = 2.5 * size
    pose = pin.SE3(pin.utils.rotate("y", pi / 2), radius * Z)
    rules = FootholdRules(0.35 * size, 0.0, max_slope=0.7, extent=4.0 * size)
    footholds = footholds_on("pipe", CylinderInside(radius), pose, rules)
    return _along(footholds, {"pipe": SceneBody(CylinderInside(radius), pose)}, WEIGHTLESS, -2.0 * size, 2.0 * size)


def _mesh(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    """Rolling ground as triangles, concave and convex."""
    x, y = np.meshgrid(np.linspace(-2.0, 6.0, 65) * size, np.linspace(-2.0, 2.0, 33) * size)
    z = np.zeros_like(x)
    for _ in range(6):
        wave, phase = rng.uniform(1.0, 3.0, 2) / size * rng.choice([-1.0, 1.0], 2), rng.uniform(0.0, 2 * pi)
        z += 0.03 * size * np.sin(wave[0] * x + wave[1] * y + phase)
    mesh = TriangleMesh(between_rows(np.stack([x, y, z], axis=2))[:, ::-1])
    rules = FootholdRules(0.25 * size, 0.1 * size, max_slope=0.6, sole=0.05 * size, max_roughness=0.01 * size)
    footholds = footholds_on("ground", mesh, pin.SE3.Identity(), rules)
    return _along(footholds, {"ground": SceneBody(mesh)}, EARTH, 0.0, 4.0 * size)


def _row(rng: np.random.Generator, size: float, density: float) -> ClimbCourse:
    """Grips in a row, of one roll each: for arms that go end over end."""
    along = np.cumsum(rng.uniform(0.37, 0.43, 6)) * size
    footholds = [Foothold(str(k + 1), frame_on(x * X, Z), "plane", rolls=1) for k, x in enumerate(along)]
    return _along(footholds, {"plane": SceneBody(HalfSpace())}, WEIGHTLESS, along[:2].mean(), along[-1])


_FAMILIES: dict[str, Callable[[np.random.Generator, float, float], ClimbCourse]] = {
    "cylinder": _cylinder,
    "truss": _truss,
    "wall": _wall,
    "stepping_stones": _stepping_stones,
    "stairs": _stairs,
    "rail": _rail,
    "rubble": _rubble,
    "chimney": _chimney,
    "gap": _gap,
    "passage": _passage,
    "rebar": _rebar,
    "inside": _inside,
    "mesh": _mesh,
    "row": _row,
}


def prism(ring: Array, thickness: float) -> Convex:
    """The body under a convex polygon: corners ``(n, 2)`` or ``(n, 3)`` [m], down by ``thickness`` [m] along -z.

    Raises:
        RangeError, ShapeError, NotFiniteError: corners that span no polygon.
    """
    corners = validation.real_array("ring", ring)
    top = np.column_stack([corners, np.zeros(len(corners))]) if corners.shape[1:] == (2,) else corners
    return Convex(np.concatenate([top, top - thickness * Z]))


def _along(
    footholds: Sequence[Foothold], bodies: dict[str, SceneBody], gravity: Array, start: float, goal: float
) -> ClimbCourse:
    """A course along x at height 0."""
    ends = [frame_on([x, 0.0, 0.0], Z) for x in (start, goal)]
    return ClimbCourse(ClimbScene(footholds, bodies, gravity), *ends)


def _platforms(
    boxes: Sequence[tuple[float, float, float]], size: float, width: float, goal: float, spacing: float = 0.0
) -> ClimbCourse:
    """Floors from x to x at a height, with footholds on top, a quarter of the size apart unless it is said."""
    bodies, footholds = dict[str, SceneBody](), list[Foothold]()
    rules = FootholdRules(spacing or 0.25 * size, 0.06 * size, max_slope=0.1)
    for k, (a, b, height) in enumerate(boxes):
        at = np.array([(a + b) / 2, 0.0, height - 0.5 * size])
        body = bodies[f"floor {k + 1}"] = SceneBody(Box((b - a, width, size)), pin.SE3(np.eye(3), at))
        footholds += footholds_on(f"floor {k + 1}", body.shape, body.placement, rules)
    start, end = frame_on([0.0, 0.0, boxes[0][2]], Z), frame_on([goal, 0.0, boxes[-1][2]], Z)
    return ClimbCourse(ClimbScene(footholds, bodies, EARTH), start, end)


def _apart(rng: np.random.Generator, width: float, height: float, least: float) -> Array:
    """Random points of a rectangle, symmetrical about 0 across, no nearer to each other than ``least``."""
    out = list[Array]()
    misses = 0
    while misses < 200:
        point = np.array([rng.uniform(-width / 2, width / 2), rng.uniform(0.0, height)])
        if all(np.linalg.norm(point - other) >= least for other in out):
            out.append(point)
            misses = 0
        else:
            misses += 1
    return np.array(out)
