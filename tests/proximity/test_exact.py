"""Distances that prove themselves: a normal that no point of either body passes, and nearest points on both bodies.

The clearance along any direction is at most the distance of two convex bodies, and any two of their points are at least
as far apart as that. Where both are equal there is nothing left to believe, whoever computed it. The depth of bodies in
each other is the greatest clearance; there the referee is Coal, whose normal must not have a greater one.
"""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from tests.models import Y, arm, spherical_seven
from tests.proximity.test_distances import QUARTERS, reach
from tests.proximity.world import Referee, place, rows_of, sensor
from wbc.proximity import Body, Witness, witnesses
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, Shape, Sphere

KINDS = ("ball", "capsule", "box", "cylinder", "hull", "prism")
BOT = spherical_seven()
HERE = pin.SE3.Identity()


def shape_of(kind: str, rng: np.random.Generator, size: float) -> Shape:
    """Sides between a fiftieth of a size and all of it; balls without radius and capsules without length among them."""
    a, b, c = (size * 50 ** rng.uniform(-1, 0, 3)).tolist()
    if kind == "ball":
        return Sphere(a * (rng.random() > 0.2))
    if kind == "capsule":
        return Capsule(a * (rng.random() > 0.2), b * (rng.random() > 0.2))
    if kind == "box":
        return Box((a, b, c))
    if kind == "cylinder":
        return Cylinder(a, b)
    if kind == "hull":
        return Convex(rng.normal(size=(rng.integers(4, 40), 3)) * [a, b, c] + 0.3 * size * rng.normal(size=3))
    turn = 2 * np.pi * np.arange(rng.integers(3, 9))[:, None]
    rim = a * np.hstack([np.cos(turn / len(turn)), np.sin(turn / len(turn)), 0 * turn])
    return Convex(np.vstack([rim, rim + [0.0, 0.0, b]]))


def poses(rng: np.random.Generator, size: float) -> tuple[pin.SE3, pin.SE3]:
    """At random; on a grid with parallel axes; on it but for 1e-7; about one centre."""
    way, found = rng.integers(4), []
    for _ in range(2):
        spot = place(rng, size)
        if way:
            turn = QUARTERS[rng.integers(9)] @ QUARTERS[rng.integers(9)]
            spot = pin.SE3(turn, 0.25 * size * rng.integers(-2, 3, 3))
        if way == 2:
            spot = spot * pin.SE3(pin.exp3(1e-7 * rng.normal(size=3)), 1e-9 * rng.normal(size=3))
        found.append(spot)
    if way == 3:
        found[1] = pin.SE3(found[1].rotation, found[0].translation)
    return found[0], found[1]


def outside(shape: Shape, pose: pin.SE3, point: np.ndarray) -> float:
    """By how much a point fails to be in a shape [m]."""
    x = pose.actInv(point)
    if isinstance(shape, Sphere):
        return float(np.linalg.norm(x)) - shape.radius
    if isinstance(shape, Capsule):
        z = np.clip(x[2], -shape.length / 2, shape.length / 2)
        return float(np.linalg.norm(x - [0.0, 0.0, z])) - shape.radius
    if isinstance(shape, Box):
        return float((np.abs(x) - np.array(shape.size) / 2).max())
    if isinstance(shape, Cylinder):
        return float(max(np.hypot(x[0], x[1]) - shape.radius, abs(x[2]) - shape.length / 2))
    assert isinstance(shape, Convex)
    faces = ConvexHull(shape.points).equations
    return float((faces[:, :3] @ x + faces[:, 3]).max())


def clear(a: tuple[Shape, pin.SE3], b: tuple[Shape, pin.SE3], n: np.ndarray) -> float:
    """Clearance of two bodies along a unit direction from the first to the second [m]."""
    return float(-reach(*a, n[None])[0] - reach(*b, -n[None])[0])


def measured(a: tuple[Shape, pin.SE3], b: tuple[Shape, pin.SE3]) -> tuple[Witness, Witness, float, float]:
    """What is found in both orders; what Coal finds, checked by support functions; and the clearance that it proves."""
    bodies = Body("a", "world", a[1], a[0]), Body("b", "world", b[1], b[0])
    there, back = witnesses(BOT, [bodies, bodies[::-1]], BOT.neutral)
    gap, normal, *_ = Referee(BOT)(bodies, BOT.neutral)
    unit = bool(abs(normal @ normal - 1.0) < 1e-6)
    proven = clear(a, b, normal) if unit else -np.inf
    # Of bodies in each other Coal is wrong at times: then it says more than its normal proves
    return there, back, gap if gap - proven <= 2e-6 else proven, proven


@pytest.mark.parametrize(("first", "second"), [*itertools.combinations_with_replacement(KINDS, 2)], ids=str)
def test_distances_prove_themselves(first: str, second: str) -> None:
    inside = 0
    for case in range(25):
        rng = np.random.default_rng([KINDS.index(first), KINDS.index(second), case])
        size = float(rng.choice([0.01, 0.3, 3.0]))
        a, b = shape_of(first, rng, size), shape_of(second, rng, size)
        at = poses(rng, size)
        there, back, coal, proven = measured((a, at[0]), (b, at[1]))
        # Of directions that are as good within 1e-9 of the robot's length the first is taken
        near = 1e-9 * (5 * size + BOT.characteristic_length)
        for found, one, two in ((there, (a, at[0]), (b, at[1])), (back, (b, at[1]), (a, at[0]))):
            assert found.normal @ found.normal == pytest.approx(1.0, abs=1e-12)
            assert found.distance == pytest.approx(clear(one, two, found.normal), abs=near)
            assert found.distance > proven - 10 * near
            assert found.distance > coal - 4e-6 * max(1.0, 5 * size)
            if not found.doubtful:
                # Of bodies in each other the normal is as good as the root of EPA's last step
                room = 10 * near if found.distance > 0 else 1e-5 * size
                assert max(outside(*one, found.on_first), outside(*two, found.on_second)) < room
        assert there.distance == pytest.approx(back.distance, abs=10 * near)
        inside += there.distance < 0
    assert inside >= 5


def test_a_ball_over_a_plane_and_under_it() -> None:
    floor = Body("floor", "world", pin.SE3(pin.exp3(np.array([0.3, 0.1, 0.0])), np.array([0.0, 0.0, 0.2])), HalfSpace())
    up = floor.placement.rotation[:, 2]
    rng = np.random.default_rng(1)
    for kind, case in itertools.product(KINDS, range(10)):
        body = Body("it", "world", place(rng, 0.3), shape_of(kind, rng, 0.3))
        there, back = witnesses(BOT, [(floor, body), (body, floor)], BOT.neutral)
        low = -float(reach(body.shape, body.placement, -up[None])[0]) - up @ floor.placement.translation
        for found, normal in ((there, up), (back, -up)):
            assert found.distance == pytest.approx(low, abs=1e-12), case
            assert found.normal == pytest.approx(normal, abs=1e-12)
        assert up @ (there.on_first - floor.placement.translation) == pytest.approx(0.0, abs=1e-12)
        assert up @ (back.on_second - floor.placement.translation) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_no_distance_changes_faster_than_bodies_move(kind: str) -> None:
    """From apart to the other side, through each other: steps of 1 mm, and where they touch."""
    rng = np.random.default_rng(KINDS.index(kind))
    for other in KINDS:
        a, b = shape_of(kind, rng, 0.2), shape_of(other, rng, 0.2)
        turn, way = place(rng).rotation, rng.normal(size=3)
        way /= np.linalg.norm(way)
        # Not quite through the centre
        start = -0.5 * way + 0.01 * rng.normal(size=3)
        steps = np.unique(np.concatenate([np.arange(0.0, 1.0, 0.02), 0.4 + 1e-3 * np.arange(100)]))
        bodies = Body("a", "world", HERE, a)
        spots = [Body("b", "world", pin.SE3(turn, start + s * way), b) for s in steps]
        found = np.array([w.distance for w in witnesses(BOT, [(bodies, spot) for spot in spots], BOT.neutral)])
        assert (np.abs(np.diff(found)) <= np.diff(steps) + 4e-6).all()


@pytest.mark.parametrize("gap", [0.0, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6])
def test_bodies_that_touch(gap: float) -> None:
    """Face to face, edge to edge and end to end, by as little as rounding."""
    turned = pin.SE3(pin.exp3(np.array([0.2, -0.4, 0.9])), np.array([0.3, -0.2, 0.5]))
    tilt = pin.exp3(np.array([np.pi / 4, 0.0, 0.0]))
    edge = pin.exp3(np.array([0.0, np.pi / 4, 0.0]))
    cube, half = Box((0.2, 0.2, 0.2)), np.sqrt(2) / 10
    ring = Convex(0.1 * np.vstack([np.eye(3), -np.eye(3)]))
    for a, here, b, yonder, height in [
        (cube, np.eye(3), cube, np.eye(3), 0.2),
        (cube, tilt, cube, edge, 2 * half),
        (cube, np.eye(3), cube, tilt, 0.1 + half),
        (Sphere(0.1), np.eye(3), Sphere(0.05), np.eye(3), 0.15),
        (Sphere(0.1), np.eye(3), cube, np.eye(3), 0.2),
        (Capsule(0.05, 0.2), np.eye(3), Capsule(0.05, 0.0), np.eye(3), 0.2),
        (Capsule(0.05, 0.2), pin.exp3(np.array([np.pi / 2, 0.0, 0.0])), Capsule(0.0, 0.2), np.eye(3), 0.15),
        (Cylinder(0.1, 0.2), np.eye(3), Cylinder(0.2, 0.1), np.eye(3), 0.15),
        (Cylinder(0.1, 0.2), pin.exp3(np.array([np.pi / 2, 0.0, 0.0])), cube, np.eye(3), 0.2),
        (ring, np.eye(3), ring, np.eye(3), 0.2),
        (ring, np.eye(3), cube, tilt, 0.1 + half),
    ]:
        over = pin.SE3(yonder, np.array([0.0, 0.0, height + gap]))
        bodies = Body("a", "world", turned * pin.SE3(here, np.zeros(3)), a), Body("b", "world", turned * over, b)
        for found in witnesses(BOT, [bodies, bodies[::-1]], BOT.neutral):
            # Coal's EPA is the larger of the two
            assert found.distance == pytest.approx(gap, abs=1e-6)
            assert np.isfinite([*found.normal, *found.on_first, *found.on_second]).all()
            # Two tips in each other leave sideways
            if gap > 1e-10 and not found.doubtful:
                assert abs(found.normal @ turned.rotation[:, 2]) == pytest.approx(1.0, abs=1e-6)


def thin(rng: np.random.Generator, size: float) -> Shape:
    """Plates and needles, as thin as 3e-5 of their length."""
    kind, part = rng.integers(4), float(10 ** rng.uniform(-4.5, -1))
    if kind < 2:
        sides = [size, size, size * part] if kind == 0 else [size, size * part, size * part]
        return Convex(rng.normal(size=(rng.integers(4, 30), 3)) * sides)
    return (
        Box((size, size * part, size))
        if kind == 2
        else Cylinder(size * (part if rng.random() < 0.5 else 1), size * part)
    )


@pytest.mark.parametrize("case", [692, 1544, 3196, *range(10, 22)])
def test_thin_bodies(case: int) -> None:
    """Of a needle across a disc nearly every way is as short: the polytope has to grow all round before it knows."""
    rng = np.random.default_rng([9, case])
    size = float(rng.choice([0.01, 0.3, 3.0, 50.0]))
    a, b = thin(rng, size), thin(rng, size)
    at = poses(rng, size * 0.5)
    there, back, _, proven = measured((a, at[0]), (b, at[1]))
    near = 1e-8 * (5 * size + 1.0)
    for found, one, two in ((there, (a, at[0]), (b, at[1])), (back, (b, at[1]), (a, at[0]))):
        assert found.distance == pytest.approx(clear(one, two, found.normal), abs=near)
        assert found.distance > proven - near
        if not found.doubtful:
            room = near if found.distance > 0 else 1e-5 * size
            assert max(outside(*one, found.on_first), outside(*two, found.on_second)) < room


SLAB = Box((0.2, 0.2, 0.02))


def slab_on_a_hinge(tilt: float) -> tuple[float, float, float]:
    """(distance, row's derivative, jump's bound) of a slab that a hinge tilts above a table, 0.1 m over it."""
    bot = arm("hinge", [(Y, (0.0, 0.0, 0.0))])
    table = Body("table", "world", pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.12])), SLAB)
    sensing, numbers = sensor(bot, [(table, Body("slab", "F1", pin.SE3.Identity(), SLAB))], 1)
    q = np.array([tilt])
    sensing.sense(q)
    assert not sensing.doubtful.any()
    return float(numbers["distance"][0]), float(rows_of(bot, numbers, q)[0, 0]), SLAB.size[0] / 2


def test_a_row_jumps_by_the_width_of_the_face() -> None:
    """The lower edge changes sides: from -0.1 m/rad to +0.1 m/rad, the lever arms of the two edges."""
    for tilt in (1e-3, 1e-6):
        left, right = slab_on_a_hinge(-tilt), slab_on_a_hinge(tilt)
        assert left[0] == pytest.approx(right[0], abs=1e-12)
        assert left[0] == pytest.approx(0.1, abs=2.1e-4)
        assert (left[1], right[1]) == (pytest.approx(left[2], abs=2e-4), pytest.approx(-right[2], abs=2e-4))
    assert abs(slab_on_a_hinge(0.0)[1]) <= SLAB.size[0] / 2 + 1e-9


def test_a_normal_jumps_where_two_ways_out_are_as_short() -> None:
    """A ball in a slab's edge, nearer to the top or to the side: distances agree, normals are at right angles."""
    bot = arm("hinge", [(Y, (0.0, 0.0, 0.0))])
    found = []
    for shift in (-1e-6, 1e-6):
        ball = Body("ball", "world", pin.SE3(np.eye(3), np.array([0.095 + shift, 0.0, 0.005])), Sphere(0.01))
        sensing, numbers = sensor(bot, [(ball, Body("slab", "F1", pin.SE3.Identity(), SLAB))], 1)
        sensing.sense(bot.neutral)
        found.append((numbers["distance"][0], numbers["line"][:3].copy()))
    assert found[0][0] == pytest.approx(found[1][0], abs=2e-6)
    assert found[0][1] == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)
    assert found[1][1] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-9)


def test_a_ball_in_a_cylinder_leaves_by_the_shorter_way() -> None:
    """Coal's closed form takes the wall also where the lid is nearer; on the axis it has no answer at all."""
    bot = arm("hinge", [(Y, (0.0, 0.0, 0.0))])
    for x, z, distance, normal, doubtful in [
        (0.01, 0.19, -0.02, [0.0, 0.0, -1.0], None),
        (0.0, 0.19, -0.02, [0.0, 0.0, -1.0], None),
        (0.09, 0.0, -0.02, [-1.0, 0.0, 0.0], False),
    ]:
        ball = Body("ball", "world", pin.SE3(np.eye(3), np.array([x, 0.0, z])), Sphere(0.01))
        can = Body("can", "F1", pin.SE3.Identity(), Cylinder(0.1, 0.4))
        sensing, numbers = sensor(bot, [(ball, can)], 1)
        sensing.sense(bot.neutral)
        assert numbers["distance"][0] == pytest.approx(distance, abs=1e-9)
        assert numbers["line"][:3] == pytest.approx(normal, abs=1e-9)
        assert doubtful is None or bool(sensing.doubtful[0]) is doubtful
