"""Scenes that are built in: holds on the published cylinder, on a plane, on a truss and on a module of a station."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import cos, pi, radians, sin
from typing import Any, NamedTuple

import numpy as np

from wbc import validation
from wbc.clearance import EndlessCylinder
from wbc.climb.scene import FLIP, ClimbScene, Foothold, SceneBody, bar, frame_along
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.shapes import Box, HalfSpace

#: Metres in an inch
INCH = 0.0254
#: Radius of the published cylinder [m]
RADIUS = 100 * INCH
#: Distance between its rows of holds along the axis, and between holds of the plane [m]
PITCH = 9.25 * INCH
#: Holds round the published cylinder [1]
GRID_ROUND = 25
#: Holds along the published cylinder [1]
GRID_ALONG = 24
#: Longest module that is built [m]
LONGEST = 1e3
#: Most rows, columns and bays that are built [1]: more holds than a planner looks at
MOST_BUILT = 1000
#: Rails of the module stand so far off its hull [m]
STANDOFF = 0.07
#: No hold of the module is nearer to a box of equipment [m]
KEPT_OFF = 0.15
#: Structures of the built-in scenes are without weight [m/s^2]
FLOATING = np.zeros(3)
#: Along which hands come to holds of level structures
DOWN = np.array([0.0, 0.0, -1.0])


class GridPlace(NamedTuple):
    """A place on the published cylinder: T round it, A along it, fractions allowed, and the heading [rad]."""

    t: float
    a: float
    heading: float = 0.0


def grid_angle(t: float) -> float:
    """ang(T) = 25 + 5 T degrees, of the published cylinder [rad]."""
    return radians(25.0 + 5.0 * t)


def grid_pose(t: float, a: float, radius: float = RADIUS, heading: float = 0.0) -> pin.SE3:
    """The frame over (T, A) of the published cylinder, at ``radius`` [m] from its axis, z inwards.

    Rz(-ang) Ry(90 deg) Rz(heading): for heading 0 [rad] x is the direction of +A (-z of the cylinder), y that of +T.
    """
    angle = grid_angle(t)
    rotation = pin.utils.rotate("z", -angle) @ pin.utils.rotate("y", pi / 2) @ pin.utils.rotate("z", heading)
    return pin.SE3(rotation, np.array([radius * cos(pi - angle), radius * sin(pi - angle), -PITCH * a]))


def grid_place(field: str, value: Any) -> GridPlace:
    """A place on the published cylinder from the text ``T,A`` or ``T,A,heading`` [deg], or from numbers [rad].

    Raises:
        ShapeError: something else. RangeError: a place beside the grid.
    """
    expected = "expected T,A or T,A,heading [deg]"
    if isinstance(value, str):
        try:
            numbers = [float(part) for part in value.split(",")]
        except ValueError as error:
            raise ShapeError(field, value, expected) from error
        numbers[2:] = [radians(angle) for angle in numbers[2:]]
    else:
        numbers = validation.real_array(field, value, finite=False).ravel().tolist()
    if len(numbers) not in (2, 3):
        raise ShapeError(field, value, expected)
    t, a, heading = (*numbers, 0.0)[:3]
    t = validation.scalar(f"{field}.T", t, low=1.0, high=float(GRID_ROUND))
    a = validation.scalar(f"{field}.A", a, low=1.0, high=float(GRID_ALONG))
    return GridPlace(t, a, validation.scalar(f"{field}.heading", heading, unit="rad"))


def cylinder_grid() -> ClimbScene:
    """The published cylinder: radius 100 in, 25 x 24 holds "T,A", T = 1 to 25 and A = 1 to 24.

    Holds: x = 100 cos(180 - ang), y = 100 sin(180 - ang), z = -9.25 A [in], of any roll.
    """
    holds = [(f"{t},{a}", grid_pose(t, a)) for t in range(1, GRID_ROUND + 1) for a in range(1, GRID_ALONG + 1)]
    bodies = {"surface": SceneBody(EndlessCylinder(RADIUS))}
    return ClimbScene(
        [Foothold(name, pose * FLIP, "surface") for name, pose in holds], bodies, FLOATING, "cylinder_grid"
    )


def plane_grid(rows: int = 16, columns: int = 24, pitch: float = PITCH) -> ClimbScene:
    """The plane z = 0 with ``rows`` x ``columns`` holds "T,A" at x = ``pitch`` A and y = ``pitch`` T [m], of any roll.

    Raises:
        ShapeError, RangeError, NotFiniteError: fewer than one row or column, too many, or no pitch.
    """
    rows, columns = (
        validation.integer(name, count, 1, MOST_BUILT) for name, count in (("rows", rows), ("columns", columns))
    )
    pitch = validation.scalar("pitch", pitch, low=0.0, open_low=True, unit="m")
    footholds = [
        _hold(f"{t},{a}", (pitch * a, pitch * t, 0.0), DOWN, (1, 0, 0), "surface")
        for t in range(1, rows + 1)
        for a in range(1, columns + 1)
    ]
    return ClimbScene(footholds, {"surface": SceneBody(HalfSpace())}, FLOATING, "plane_grid")


def truss_grid(bays: int = 6, side: float = 0.94, radius: float = 0.025) -> ClimbScene:
    """A truss of square section along x, with holds on top of its three upper longerons and of every batten.

    Bars are capsules of ``radius`` [m]; a bay is as long as the section's ``side`` [m]. Holds are 1/4 bay apart and
    named "bar,number": "L1", "L2", "L3" for the longerons, "B0" ... for the battens; x along the bar, of any roll.

    Raises:
        ShapeError, RangeError, NotFiniteError: fewer than one bay, too many, a side or radius that is not above 0.
    """
    bays = validation.integer("bays", bays, 1, MOST_BUILT)
    side = validation.scalar("side", side, low=0.0, open_low=True, unit="m")
    radius = validation.scalar("radius", radius, low=0.0, open_low=True, high=side / 8, unit="m")
    step, length, footholds, bodies = side / 4, bays * side, list[Foothold](), dict[str, SceneBody]()

    def add_bar(name: str, a: tuple[float, float, float], b: tuple[float, float, float]) -> None:
        bodies[name] = bar(a, b, radius)

    def add_hold(on: str, number: int, x: float, y: float, along: tuple[int, int, int]) -> None:
        footholds.append(_hold(f"{on},{number}", (x, y, radius), DOWN, along, on))

    for number, y in enumerate((-side / 2, 0.0, side / 2), start=1):
        add_bar(f"L{number}", (0.0, y, 0.0), (length, y, 0.0))
        for k in range(4 * bays + 1):
            add_hold(f"L{number}", k, k * step, y, (1, 0, 0))
    for bay in range(bays + 1):
        x = bay * side
        add_bar(f"B{bay}", (x, -side / 2, 0.0), (x, side / 2, 0.0))
        for k, y in ((1, -step), (2, step)):
            add_hold(f"B{bay}", k, x, y, (0, 1, 0))
        for corner, y in (("left", -side / 2), ("right", side / 2)):
            add_bar(f"post {bay} {corner}", (x, y, 0.0), (x, y, -side))
            if bay < bays:
                add_bar(f"diagonal {bay} {corner}", (x, y, 0.0), (x + side, y, -side))
        add_bar(f"lower batten {bay}", (x, -side / 2, -side), (x, side / 2, -side))
    for corner, y in (("left", -side / 2), ("right", side / 2)):
        add_bar(f"lower longeron {corner}", (0.0, y, -side), (length, y, -side))
    return ClimbScene(footholds, bodies, FLOATING, "truss_grid")


def module(length: float = 6.0, radius: float = 2.1) -> ClimbScene:
    """A station module: a hull about the x axis with handrails, and three boxes of equipment that stand out.

    Rails run along the hull every 6 degrees over its upper half and stand 0.07 m off it; holds are 0.22 m apart on top
    of them, in rails of three with a gap of 0.3 m, named "rail,number", x along +x, of any roll. Those within 0.15 m of
    a box are left out. The body ``surface`` is that of the rails' tops, so that what stays above it clears the rails.

    Raises:
        RangeError, NotFiniteError: a module too short for one rail, or a radius under 1 m.
    """
    length = validation.scalar("length", length, low=1.0, high=LONGEST, unit="m")
    radius = validation.scalar("radius", radius, low=1.0, unit="m")
    top, spacing, gap, per_rail = radius + STANDOFF, 0.22, 0.3, 3
    rail = (per_rail - 1) * spacing
    count = int((length + gap) // (rail + gap))
    bodies = dict[str, SceneBody]()
    for name, share, degrees in (("valve box", 0.35, -40), ("camera box", 0.55, 10), ("antenna box", 0.75, 45)):
        turn = pin.utils.rotate("x", radians(degrees))
        centre = turn @ np.array([0.0, 0.0, top + 0.1]) + [share * length, 0.0, 0.0]
        bodies[name] = SceneBody(Box((0.3, 0.2, 0.2)), pin.SE3(turn, centre))
    footholds = []
    for number, degrees in enumerate(range(-90, 91, 6)):
        outward = pin.utils.rotate("x", radians(degrees)) @ np.array([0.0, 0.0, 1.0])
        # Rails of neighbouring rows are half a period apart, as are the gaps between them
        start = (rail + gap) / 2 if number % 2 else 0.0
        for k in range(count * per_rail):
            x = start + (k // per_rail) * (rail + gap) + (k % per_rail) * spacing
            if x <= length:
                at = top * outward + [x, 0.0, 0.0]
                footholds.append(_hold(f"{number},{k}", at, -outward, (1, 0, 0), "surface"))
    points = np.array([foothold.pose.translation for foothold in footholds])
    off = np.min([box.distances(points) for box in bodies.values()], axis=0)
    bodies["surface"] = SceneBody(EndlessCylinder(top), pin.SE3(pin.utils.rotate("y", pi / 2), np.zeros(3)))
    kept = [foothold for foothold, distance in zip(footholds, off, strict=True) if distance >= KEPT_OFF]
    return ClimbScene(kept, bodies, FLOATING, "module")


#: Name -> function without arguments that makes the scene
GRIDS: dict[str, Callable[[], ClimbScene]] = {
    "cylinder_grid": cylinder_grid,
    "plane_grid": plane_grid,
    "truss_grid": truss_grid,
    "module": module,
}
#: Name -> footholds from over which to over which a climb goes when nothing is said
GRID_ENDS = {
    "cylinder_grid": ("13,6", "13,18"),
    "plane_grid": ("8,6", "8,17"),
    "truss_grid": ("L2,6", "L2,18"),
    "module": ("15,4", "15,14"),
}


def remove_rows(scene: ClimbScene, rows: Any) -> ClimbScene:
    """The scene less all footholds "T,A" whose A is within ``rows``: a number, or a text as "12-14" or "3,12-14".

    Raises:
        ShapeError: neither, or no foothold would be left. RangeError: no such text, a row that no foothold has, or
            footholds that are not named by two whole numbers.
    """
    return _less(scene, "rows", rows, 1)


def remove_columns(scene: ClimbScene, columns: Any) -> ClimbScene:
    """The scene less all footholds "T,A" whose T is within ``columns``; see :func:`remove_rows`."""
    return _less(scene, "columns", columns, 0)


def remove_fraction(scene: ClimbScene, share: float, seed: int = 0) -> ClimbScene:
    """The scene less a random choice of ``share`` of its footholds, rounded; the same seed, the same choice.

    Raises:
        RangeError, NotFiniteError: a share outside [0, 1], a seed below 0. ShapeError: no foothold would be left.
    """
    footholds = validation.instance("scene", scene, ClimbScene, "a ClimbScene").footholds
    share = validation.scalar("share", share, low=0.0, high=1.0)
    order = np.random.default_rng(validation.integer("seed", seed)).permutation(len(footholds))
    return scene.without(*(footholds[k].id for k in order[: round(share * len(footholds))]))


def _hold(name: str, at: Any, approach: Any, along: Any, on: str) -> Foothold:
    """A foothold by the direction along which a hand comes to it, and its x axis."""
    return Foothold(name, frame_along("hold", at, approach, along) * FLIP, on)


def _less(scene: ClimbScene, field: str, wanted: Any, place: int) -> ClimbScene:
    validation.instance("scene", scene, ClimbScene, "a ClimbScene")
    spans, keys = _spans(field, wanted), dict[str, int]()
    for foothold in scene.footholds:
        match = re.fullmatch(r"(-?\d+),(-?\d+)", foothold.id)
        if match is None:
            raise RangeError(field, foothold.id, "this scene's footholds are not named by two whole numbers T,A")
        keys[foothold.id] = int(match[place + 1])
    present = set(keys.values())
    for span in spans:
        lost = next((number for number in span if number not in present), None)
        if lost is not None:
            raise RangeError(field, wanted, f"no foothold has {lost}; they have {min(present)} to {max(present)}")
    return scene.without(*(name for name, number in keys.items() if any(number in span for span in spans)))


def _spans(field: str, wanted: Any) -> list[range]:
    """Ranges of whole numbers out of a number or a text of numbers and ranges."""
    if isinstance(wanted, int) and not isinstance(wanted, bool):
        return [range(wanted, wanted + 1)]
    if not isinstance(wanted, str):
        raise ShapeError(field, wanted, "expected a whole number or a text such as '12-14'")
    out = list[range]()
    for part in wanted.split(","):
        match = re.fullmatch(r"\s*(\d{1,9})(?:\s*-\s*(\d{1,9}))?\s*", part)
        if match is None or int(match[2] or match[1]) < int(match[1]):
            raise RangeError(field, wanted, "expected numbers and ranges such as '3,12-14'")
        out.append(range(int(match[1]), int(match[2] or match[1]) + 1))
    return out
